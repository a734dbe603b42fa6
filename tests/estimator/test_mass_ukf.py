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


@pytest.mark.parametrize("arguments", [{"mass_std": 0.0}, {"mass_walk": -1.0}])
def test_bad_settings_are_named(arguments):
    with pytest.raises(InputError, match=next(iter(arguments))):
        WrenchMassUKF(VEHICLE, **arguments)
