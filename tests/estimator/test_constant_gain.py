"""The filter with a constant gain against the full one."""

import numpy as np
import pytest
from numpy.linalg import norm
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.flights import fly, yawing_flight
from tests.support.model_flights import ANISOTROPIC, GUSTS
from tests.support.sizes import rms
from tests.support.vehicles import POSE, VEHICLE
from windwrench.dynamics import EffectSetting
from windwrench.estimator import ConstantGainFilter, WrenchUKF

# standard deviations of the converged filter: m, m/s, rad/s, N, Nm
DEVIATION = {
    "position": 4.2e-4,
    "velocity": 0.011,
    "angular_velocity": 0.13,
    "force": 0.033,
    "torque": 3.2e-3,
}


def largest_differences(a, b):
    return {
        name: max(abs(getattr(x, name) - getattr(y, name)).max() for x, y in zip(a, b, strict=True))
        for name in DEVIATION
    }


def assert_close(a, b, share):
    """No difference exceeds a share of its standard deviation, or ten times that of the rate's:
    tilt turns the inertia.
    """
    for name, difference in largest_differences(a, b).items():
        assert difference < share * DEVIATION[name] * (10 if name == "angular_velocity" else 1), (
            name
        )


def both(vehicle, flight, settled, missing=(), kind=ConstantGainFilter):
    """The estimates of the full filter and of this one along a flight, once both have settled."""
    return [fly(f, flight, missing)[settled:] for f in (WrenchUKF(vehicle), kind(vehicle))]


@pytest.fixture(scope="module")
def turning():
    """A flight that starts yawed by 120 degrees, turns at 1.5 to 4.5 rad/s and translates."""
    return yawing_flight(VEHICLE, 2400, seed=6, torque=(0.01, -0.015, 0.02), substeps=3)


GAP = range(1200, 1300)  # half a second without poses


@pytest.fixture(scope="module")
def through_a_gap(turning):
    """The estimates of both filters along ``turning``, and whether the gain of each step was the
    constant one.
    """
    steady = []

    class Watched(ConstantGainFilter):
        def step(self, *arguments):
            estimate = super().step(*arguments)
            steady.append(int(self.record[0]["steady"]))
            return estimate

    return *both(VEHICLE, turning, 0, set(GAP), Watched), steady


def test_it_follows_the_full_filter_through_a_yawing_flight(through_a_gap):
    *estimates, steady = through_a_gap
    assert all(steady[: GAP[0] - 1])
    assert not any(steady[GAP[-1] - 20 : GAP[-1] + 60])
    assert all(steady[-500:])
    for settled in (slice(1000, GAP[0] - 1), slice(1800, None)):
        full, constant = (each[settled] for each in estimates)
        assert_close(full, constant, 0.1)
        assert np.mean([e.nis for e in constant]) == pytest.approx(6.0, abs=1.0)


def test_after_a_gap_it_is_honest_at_any_heading(turning, through_a_gap):
    """Through half a second unseen, in a turn of several rad/s: deviations widen as those of the
    full filter do, and what is estimated lies within them from the first pose on.
    """
    full, constant, _ = through_a_gap
    rise = 200
    first = constant[GAP[0] - 1]
    last = constant[GAP[-1] - 1]
    assert all(np.isnan(e.nis) for e in constant[GAP[0] - 1 : GAP[-1]])
    assert_array_equal(first.force, last.force)
    assert norm(last.position - first.position) > 0.01
    deviations = [np.sqrt(np.diag(e[GAP[-1] - 1].covariance)) for e in (full, constant)]
    ratio = deviations[1] / deviations[0]
    assert np.all((ratio[6:] > 0.4) & (ratio[6:] < 1.6))  # it does not know of the tilt
    assert (
        deviations[1][6:12] > 3.0 * np.sqrt(np.diag(constant[GAP[0] - 2].covariance))[6:12]
    ).all()
    truth = {"velocity": turning["velocity"], "position": turning["true_x"]}
    truth["torque"] = np.tile((0.01, -0.015, 0.02), (len(turning["rotors"]), 1))
    truth["force"] = np.tile((0.3, -0.2, -0.1), (len(turning["rotors"]), 1))
    rows = {"position": 6, "velocity": 9, "torque": 12, "force": 15}
    for name, row in rows.items():
        scores = []
        for k in range(GAP[-1], GAP[-1] + 2 * rise):
            std = np.sqrt(np.diag(constant[k].covariance))[row : row + 3]
            scores.append(abs(getattr(constant[k], name) - truth[name][k + 1]) / std)
        assert rms(scores) < 1.5, name
        assert np.max(scores[-1]) < 3.0, name


def test_it_knows_the_declared_effects():
    vehicle = VEHICLE.with_effects(EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}))
    flight = yawing_flight(VEHICLE, 2000, seed=2, substeps=3)
    full, constant = both(vehicle, flight, 1500)
    _, plain = both(VEHICLE, flight, 1500)
    difference = largest_differences(full, constant)
    assert difference["force"] < 0.01
    assert difference["torque"] < 0.001
    assert largest_differences(full, plain)["force"] > 0.1


@pytest.mark.parametrize("tuning", [ANISOTROPIC, GUSTS], ids=["walks", "gusts"])
def test_noise_of_its_own_on_every_axis_is_exact_at_hover(tuning):
    full = WrenchUKF(VEHICLE, tuning)
    constant = ConstantGainFilter(VEHICLE, tuning)
    rng = default_rng(0)
    steps = 3000
    speeds = VEHICLE.rotor_speeds(1.02 * VEHICLE.weight, np.zeros(3))
    position = [0.0, 0.0, 1.0] + 0.002 * rng.standard_normal((steps, 3))
    attitude = np.column_stack([np.ones(steps), 0.0025 * rng.standard_normal((steps, 3))])
    attitude /= norm(attitude, axis=1, keepdims=True)
    found = []
    for f in (full, constant):
        f.reset(*POSE)
        found.append([f.step(speeds, *pose) for pose in zip(position, attitude, strict=True)])
    assert_close(*(estimates[2500:] for estimates in found), 0.1)
    assert_allclose(np.diag(constant.covariance), np.diag(full.covariance), rtol=1e-3)


def test_a_gap_widens_its_covariance_with_the_declared_effects():
    """Drag holds a velocity that nobody measures: without it the deviation would be larger."""
    vehicle = VEHICLE.with_effects(EffectSetting("rotor_drag", {"kdx": 2e-3, "kdy": 2e-3}))
    deviations = []
    for f in (WrenchUKF(vehicle), ConstantGainFilter(vehicle), ConstantGainFilter(VEHICLE)):
        f.reset(*POSE)
        for k in range(1225):
            pose = ([0, 0, 1], [1, 0, 0, 0]) if k < 1200 else (None, None)
            e = f.step(np.full(4, vehicle.hover_rate), *pose)
        deviations.append(np.sqrt(np.diag(e.covariance))[9:11])  # of the horizontal velocity
    full, constant, free = deviations
    assert_allclose(constant, full, rtol=1e-3)
    assert (free > 1.1 * constant).all()
