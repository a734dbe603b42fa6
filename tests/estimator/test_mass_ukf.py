"""The wrench filter with the mass as a state."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.flights import PERIOD, yawing_flight
from windwrench.dynamics import InputError, load_vehicle
from windwrench.estimator import UKFTuning, WrenchMassUKF, WrenchUKF

VEHICLE = load_vehicle("ardrone2")


def test_a_flight_with_vertical_acceleration_weighs_the_vehicle():
    flight = yawing_flight(
        replace(VEHICLE, mass=VEHICLE.mass + 0.053), 3000, seed=1, force=(0, 0, 0), torque=(0, 0, 0)
    )
    ukf = WrenchMassUKF(VEHICLE, UKFTuning(), PERIOD)
    ukf.reset(
        flight["position"][0],
        flight["quaternion"][0],
        velocity=flight["velocity"][0],
        angular_velocity=flight["omega"][0],
    )
    for k in range(1, 3000):
        e = ukf.step(flight["rotors"][k], flight["position"][k], flight["quaternion"][k])
    assert abs(ukf.mass - VEHICLE.mass - 0.053) < 3 * ukf.mass_std
    assert ukf.mass_std < 0.008
    assert np.abs(e.force).max() < 0.05


def test_with_a_mass_that_is_known_it_is_the_wrench_filter():
    flight = yawing_flight(VEHICLE, 300, seed=2)
    one, two = WrenchUKF(VEHICLE), WrenchMassUKF(VEHICLE, mass_std=1e-9, mass_walk=1e-12)
    for ukf in (one, two):
        ukf.reset(flight["position"][0], flight["quaternion"][0])
    for k in range(1, 300):
        W, x, q = (flight[n][k] for n in ("rotors", "position", "quaternion"))
        if k in range(100, 120):
            x, q = None, None
        a, b = one.step(W, x, q), two.step(W, x, q)
    # kappa spreads the points of a larger state a little more: not equal, but very near
    np.testing.assert_allclose(a.force, b.force, atol=1e-4)
    np.testing.assert_allclose(a.torque, b.torque, atol=1e-5)
    np.testing.assert_allclose(np.diag(a.covariance), np.diag(b.covariance), rtol=1e-3)
    assert two.mass == pytest.approx(VEHICLE.mass, abs=1e-7)


def test_a_reset_forgets_the_mass():
    ukf = WrenchMassUKF(VEHICLE)
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    for _ in range(50):
        ukf.step(np.full(4, 1.1 * VEHICLE.hover_rate), [0, 0, 1], [1, 0, 0, 0])
    assert ukf.mass != VEHICLE.mass
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    assert ukf.mass == VEHICLE.mass


def hover_under(ukf, forces):
    """Hover at rest, the rotors balancing vertical forces (K,) in N that come on the way; check
    that mass and force stay right to three of their own deviations where there is no transient.
    """
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    since = 0
    for k, force in enumerate(forces):
        since = 0 if k == 0 or force != forces[k - 1] else since + 1
        speed = VEHICLE.hover_rate * np.sqrt(1.0 - force / VEHICLE.weight)
        e = ukf.step(np.full(4, speed), [0, 0, 1], [1, 0, 0, 0])
        assert abs(ukf.mass - VEHICLE.mass) < 3.0 * ukf.mass_std
        if since > 400:  # two rise times
            assert abs(e.force[2] - force) < 3.0 * np.sqrt(e.covariance[17, 17])
        whole = ukf.memory[1].view(np.float64).reshape(19, 19)
        scale = 1.0 / np.sqrt(np.diag(whole))
        assert np.linalg.eigvalsh(whole * scale[:, None] * scale)[0] > 0.0
    return e


def test_a_force_that_comes_at_once_is_not_taken_for_mass_with_certainty():
    """With a small vertical walk the filter must explain a step by mass; it then doubts both."""
    tuning = UKFTuning(force_walk=(3.26e-3, 3.26e-3, 1e-4))
    ukf = WrenchMassUKF(VEHICLE, tuning, PERIOD)
    hover_under(ukf, [0.0] * 1000 + [-0.52] * 1000)
    assert ukf.mass_std > 0.03


def test_rotor_speeds_that_lie_leave_no_mass_behind():
    ukf = WrenchMassUKF(VEHICLE, UKFTuning(), PERIOD)
    # rotors that read zero, and rotors that read twice their speed, of a vehicle at rest
    hover_under(ukf, [0.0] * 400 + [VEHICLE.weight] * 200 + [0.0] * 600 + [-4.0] * 200)
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    for fault in ([0.0] * 4, [700.0, 0.0, 900.0, 100.0]):
        for k in range(800):
            speeds = fault if k < 150 else np.full(4, VEHICLE.hover_rate)
            e = ukf.step(speeds, [0, 0, 1], [1, 0, 0, 0])
        assert abs(ukf.mass - VEHICLE.mass) < 3.0 * ukf.mass_std
        assert np.all(np.abs(e.force) < 3.0 * np.sqrt(np.diag(e.covariance)[15:18]))


def test_a_gap_says_nothing_of_the_mass():
    flight = yawing_flight(
        replace(VEHICLE, mass=VEHICLE.mass + 0.03), 1600, seed=3, force=(0, 0, 0), torque=(0, 0, 0)
    )
    ukf = WrenchMassUKF(VEHICLE, UKFTuning(), PERIOD)
    ukf.reset(
        flight["position"][0],
        flight["quaternion"][0],
        velocity=flight["velocity"][0],
        angular_velocity=flight["omega"][0],
    )
    for k in range(1, 1600):
        ukf.step(flight["rotors"][k], flight["position"][k], flight["quaternion"][k])
    known = ukf.mass_std
    assert known < 0.02
    for _ in range(4000):
        ukf.step(flight["rotors"][0])
    e = ukf.step(flight["rotors"][0], [0, 0, 1], [1, 0, 0, 0])
    assert e.status == "restarted"
    # it has walked for 20 s
    assert ukf.mass_std == pytest.approx(np.hypot(known, 1e-5 * np.sqrt(4000)), rel=0.05)


@pytest.mark.parametrize("arguments", [{"mass_std": 0.0}, {"mass_walk": -1.0}])
def test_bad_settings_are_named(arguments):
    with pytest.raises(InputError, match=next(iter(arguments))):
        WrenchMassUKF(VEHICLE, **arguments)
