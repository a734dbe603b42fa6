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


DRAG = {"dx": 1e-4, "dy": 1e-4, "dz": 1e-4, "cx": 0.0}
LARGE_DRAG = {"dx": 0.1, "dy": 0.1, "dz": 0.1, "cx": 0.0}
FLAT = {"dx": 0.0, "dy": 0.05, "dz": 0.1, "cx": 0.0}
WEAK_WIND = {"wx": 6.0, "cd": 1e-3}


@pytest.mark.parametrize(
    ("setting", "pulls", "std", "word"),
    [
        # a coefficient that would leave its range
        ({"body_drag": DRAG}, {"dx": 1.0, "cx": -6.0}, {}, "cx"),
        ({"body_drag": DRAG}, {"dx": 1.0, "cx": -2.0}, {}, None),
        ({"body_drag": DRAG}, {"dx": 1.0, "cx": 0.0}, {}, None),
        ({"body_drag": DRAG}, {"dx": 1.0, "cx": 6.0}, {}, None),
        # which is small beside the effect itself
        ({"body_drag": LARGE_DRAG}, {"dx": 1.0, "cx": -6.0}, {}, None),
        # air that damps yaw alone
        ({"rate_damping": {"dx": 0.0, "dy": 0.0, "dz": 1e-3}}, {"dz": 1.0}, {}, "rate_damping"),
        ({"rate_damping": {"dx": 1e-3, "dy": 1e-3, "dz": 1e-3}}, {"dz": 1.0}, {}, None),
        ({"rate_damping": {"dx": 1e-3, "dy": 1e-3, "dz": 0.0}}, {"dz": 1.0}, {}, None),
        # a body that air drags along some axes alone
        ({"body_drag": FLAT}, {"dx": 0.0}, {"dx": 0.003}, "body_drag"),
        ({"body_drag": FLAT}, {"dx": 0.0}, {"dx": 0.01}, None),
        ({"body_drag": FLAT | {"dx": 0.02}}, {"dx": 0.0}, {"dx": 0.001}, None),
        ({"body_drag": FLAT | {"cx": 0.02}}, {"dx": 0.0}, {"dx": 0.001}, None),
        # a wind that no room has, and any mass
        ({"wind": {"wx": 30.0, "cd": 1e-5}}, {"wx": 0.0}, {}, "wind"),
        ({"wind": {"wx": 2.0, "cd": 0.04}}, {"wx": 0.0}, {}, None),
        ({"mass": {"dm": 1.0}}, {"dm": 0.0}, {}, None),
        # a wind on hardly any drag is a steady force, unless another drag feels it
        ({"wind": WEAK_WIND}, {"wx": 0.0}, {}, "hardly any drag"),
        ({"wind": WEAK_WIND, "rotor_drag": {"kdx": 1e-4}}, {"wx": 0.0}, {}, None),
    ],
)
def test_coefficients_beyond_what_is_plausible_are_doubts(setting, pulls, std, word):
    effect = next(iter(setting))
    columns = [(effect, name) for name in pulls]
    fit = FittedEffects(setting, {(effect, name): value for name, value in std.items()})
    doubts = implausible_coefficients(search(columns, list(pulls.values())), fit)
    assert bool(doubts) == (word is not None)
    assert word is None or any(word in doubt for doubt in doubts)


def test_a_dry_friction_is_no_sure_drag():
    log = fly_practice(
        VEHICLE, trajectory="vertical", seconds=40.0, seed=3, outsider="dry_friction", sensor=2.0
    )
    found = diagnose([log], VEHICLE)
    assert found.verdict in ("partly explained", "unexplained")
    assert all(effect.tentative for effect in found.effects)
