"""A named effect that is bent to the limits of its law is no sure name."""

from types import SimpleNamespace

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.inference.coefficient_range import implausible_coefficients
from windwrench.identification.inference.gram_matrix import Gram
from windwrench.identification.inference.search import FittedEffects
from windwrench.studies.trials.practice_flights import fly_practice

VEHICLE = load_vehicle("ardrone2")
LEVEL = SimpleNamespace(
    signals=SimpleNamespace(velocity=np.tile([1.0, 0.0, 0.0], (5, 1))), rows=np.arange(5)
)  # at 1 m/s


def search(columns, pulls, precision=1e8):
    """A search whose regression would move each coefficient, all at zero, by so many standard
    deviations.
    """
    count = len(columns)
    std = 1.0 / np.sqrt(precision)
    block = np.zeros((1, count + 1, count + 1))
    block[0, :count, :count] = precision * np.eye(count)
    block[0, :count, -1] = precision * std * np.array(pulls)
    zero, far = np.zeros(count), np.full(count, np.inf)
    gram = Gram(
        tuple(columns),
        np.zeros((0, 6, count + 1)),
        np.zeros(1, dtype=np.intp),
        block,
        zero,
        zero,
        zero,
        far,
    )
    return SimpleNamespace(
        flights=SimpleNamespace(vehicle=VEHICLE, pieces=lambda setting: [LEVEL]),
        gram_at=lambda fit: gram,
    )


@pytest.mark.parametrize(
    ("pull", "doubtful"), [(-6.0, True), (-2.0, False), (0.0, False), (6.0, False)]
)
def test_a_coefficient_that_would_leave_its_range_is_a_doubt(pull, doubtful):
    columns = [("body_drag", "dx"), ("body_drag", "cx")]
    fit = FittedEffects({"body_drag": {"dx": 1e-4, "dy": 1e-4, "dz": 1e-4, "cx": 0.0}})
    found = implausible_coefficients(search(columns, [1.0, pull]), fit)
    assert bool(found) == doubtful
    assert not doubtful or "cx" in found[0]


@pytest.mark.parametrize(
    ("dx", "dz", "doubtful"), [(0.0, 1e-3, True), (1e-3, 1e-3, False), (1e-3, 0.0, False)]
)
def test_air_that_damps_yaw_alone_is_a_doubt(dx, dz, doubtful):
    fit = FittedEffects({"rate_damping": {"dx": dx, "dy": dx, "dz": dz}})
    assert bool(implausible_coefficients(search([("rate_damping", "dz")], [1.0]), fit)) == doubtful


def test_what_is_small_beside_the_effect_itself_is_no_doubt():
    columns = [("body_drag", "dx"), ("body_drag", "cx")]
    fit = FittedEffects({"body_drag": {"dx": 0.1, "dy": 0.1, "dz": 0.1, "cx": 0.0}})
    assert not implausible_coefficients(search(columns, [1.0, -6.0]), fit)


@pytest.mark.parametrize(
    ("dx", "cx", "std", "doubtful"),
    [
        (0.0, 0.0, 0.003, True),
        (0.0, 0.0, 0.01, False),
        (0.02, 0.0, 0.001, False),
        (0.0, 0.02, 0.001, False),
    ],
)
def test_a_body_that_air_drags_along_some_axes_alone_is_a_doubt(dx, cx, std, doubtful):
    fit = FittedEffects(
        {"body_drag": {"dx": dx, "dy": 0.05, "dz": 0.1, "cx": cx}}, {("body_drag", "dx"): std}
    )
    assert bool(implausible_coefficients(search([("body_drag", "dx")], [0.0]), fit)) == doubtful


def test_a_wind_that_no_room_has_is_a_doubt_and_any_mass_is_none():
    columns = [("wind", "wx"), ("mass", "dm")]
    assert implausible_coefficients(
        search(columns, [0.0, 0.0]), FittedEffects({"wind": {"wx": 30.0, "cd": 1e-5}})
    )
    assert not implausible_coefficients(
        search(columns, [0.0, 0.0]), FittedEffects({"wind": {"wx": 2.0, "cd": 0.04}})
    )
    assert not implausible_coefficients(
        search(columns, [0.0, 0.0]), FittedEffects({"mass": {"dm": 1.0}})
    )


def test_a_wind_on_hardly_any_drag_is_a_steady_force_unless_another_drag_feels_it():
    columns, wind = [("wind", "wx")], {"wx": 6.0, "cd": 1e-3}
    (doubt,) = implausible_coefficients(search(columns, [0.0]), FittedEffects({"wind": wind}))
    assert "hardly any drag" in doubt
    assert not implausible_coefficients(
        search(columns, [0.0]), FittedEffects({"wind": wind, "rotor_drag": {"kdx": 1e-4}})
    )


def test_a_dry_friction_is_no_sure_drag():
    log = fly_practice(
        VEHICLE, trajectory="vertical", seconds=40.0, seed=3, outsider="dry_friction", sensor=2.0
    )
    found = diagnose([log], VEHICLE)
    assert found.verdict in ("partly explained", "unexplained")
    assert all(effect.tentative for effect in found.effects)
