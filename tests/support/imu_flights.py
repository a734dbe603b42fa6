"""Flights with an IMU, for the tests."""

from dataclasses import replace

from numpy.random import default_rng

from windwrench.envs.recording import background, record_flight
from windwrench.evidence.trials.logged_poses import pose_removed
from windwrench.identification.logs.flight_log import FlightLog

__all__ = ["imu_flight", "pose_removed"]


def imu_flight(vehicle, effects=(), seconds=20.0, trajectory="excite"):
    """A simulated flight: pose, rotor speeds, and an IMU with noise and bias."""
    settings = background(vehicle, 0.0)
    log = FlightLog(
        **record_flight(vehicle, effects, trajectory, seconds, 1, settings, imu=True),
        name="imu_flight",
    )
    noise = default_rng(1).standard_normal((2, len(log.t), 3))
    return replace(
        log,
        accelerometer=log.accelerometer + 0.1 * noise[0] + [0.05, -0.1, 0.08],
        gyro=log.gyro + 0.005 * noise[1] + [0.01, -0.005, 0.008],
    )
