"""Inertial measurements in the wrench filter."""

import numpy as np
import pytest

from tests.support.flights import PERIOD, yawing_flight
from tests.support.literal_ukf import matrix
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.estimator import UKFTuning, WrenchUKF

VEHICLE = load_vehicle("ardrone2")
FORCE, TORQUE = np.array([0.3, -0.2, -0.1]), np.array([0.0, 0.0, 0.02])
GYRO, ACCELEROMETER = 0.005, 0.05


def run(imu, attitude=True, steps=1600, seed=1):
    flight = yawing_flight(VEHICLE, steps, seed=seed, sigma_position=0.01, sigma_attitude=0.05)
    ukf = WrenchUKF(
        VEHICLE,
        UKFTuning(
            position_noise=0.01,
            attitude_noise=0.05,
            gyro_noise=GYRO,
            accelerometer_noise=ACCELEROMETER,
        ),
        PERIOD,
    )
    ukf.reset(
        flight["true_x"][0],
        flight["true_q"][0],
        velocity=flight["velocity"][0],
        angular_velocity=flight["omega"][0],
    )
    rng, rows = np.random.default_rng(0), []
    for k in range(1, steps):
        e = ukf.step(
            flight["rotors"][k],
            flight["position"][k],
            flight["quaternion"][k] if attitude else None,
        )
        if imu:
            R = matrix(flight["true_q"][k])
            up = R @ [0, 0, VEHICLE.k @ flight["rotors"][k] ** 2]
            gyro = flight["omega"][k] + GYRO * rng.standard_normal(3)
            e = ukf.correct_imu(
                gyro, R.T @ (up + FORCE) / VEHICLE.mass + ACCELEROMETER * rng.standard_normal(3)
            )
        rows.append(
            np.concatenate(
                [e.force - FORCE, e.torque - TORQUE, e.angular_velocity - flight["omega"][k]]
            )
        )
        assert np.linalg.eigvalsh(e.covariance)[0] > 0
    return np.sqrt(np.mean(np.array(rows)[600:].reshape(-1, 3, 3) ** 2, axis=(0, 2)))


def test_an_imu_sharpens_every_part_of_the_estimate():
    without, with_imu = run(False), run(True)
    assert with_imu[0] < 0.5 * without[0]
    assert with_imu[1] < 0.2 * without[1]
    assert with_imu[2] < 0.2 * without[2]


def test_with_an_imu_a_position_is_enough():
    force, torque, rate = run(True, attitude=False)
    assert force < 0.05
    assert torque < 0.002
    assert rate < 0.01


def test_a_linear_measurement_is_a_kalman_update():
    """A gyro's sigma points must come to the closed form."""
    ukf = WrenchUKF(VEHICLE, UKFTuning(), PERIOD)
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    for _ in range(20):
        ukf.step(np.full(4, VEHICLE.hover_rate), [0, 0, 1], [1, 0, 0, 0])
    P, before = ukf.covariance, ukf.estimate
    z = np.array([0.1, -0.2, 0.3])
    after = ukf.correct_imu(gyro=z)
    S = P[3:6, 3:6] + 0.005**2 * np.eye(3)
    K = P[:, 3:6] @ np.linalg.inv(S)
    innovation = z - before.angular_velocity
    np.testing.assert_allclose(
        after.angular_velocity, before.angular_velocity + (K @ innovation)[3:6], atol=1e-9
    )
    np.testing.assert_allclose(after.force, before.force + (K @ innovation)[15:18], atol=1e-9)
    np.testing.assert_allclose(after.covariance, P - K @ S @ K.T, atol=1e-9)
    assert after.nis == pytest.approx(innovation @ np.linalg.solve(S, innovation), rel=1e-9)


def test_a_declared_effect_is_in_what_the_accelerometer_should_read():
    declared = VEHICLE.with_effects(EffectSetting("constant_force", {"fx": 0.5}))
    ukf = WrenchUKF(declared, UKFTuning(), PERIOD)
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    ukf.step(np.full(4, VEHICLE.hover_rate))
    e = ukf.correct_imu(accelerometer=[0.5 / VEHICLE.mass, 0.0, VEHICLE.gravity])
    assert e.nis < 1e-6


@pytest.mark.parametrize("arguments", [{"gyro": [1, 2]}, {"accelerometer": [0, 0, np.nan]}])
def test_bad_inertial_measurements_are_named(arguments):
    ukf = WrenchUKF(VEHICLE)
    ukf.reset([0, 0, 1], [1, 0, 0, 0])
    before = ukf.estimate
    with pytest.raises(InputError, match=next(iter(arguments))):
        ukf.correct_imu(**arguments)
    np.testing.assert_array_equal(ukf.estimate.state, before.state)
