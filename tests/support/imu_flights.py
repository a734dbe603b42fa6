"""Flights with an IMU, for the tests."""

from dataclasses import replace

import numpy as np

from windwrench.envs.recording import background, record_flight
from windwrench.evidence.trials.logged_poses import pose_removed
from windwrench.identification.logs.flight_log import FlightLog

__all__ = ["imu_flight", "pose_removed"]


def imu_flight(vehicle, effects=(), seconds=20.0, trajectory="excite", seed=1, turbulence=0.0):
    """A simulated flight: pose, rotor speeds, and an IMU with noise and bias."""
    settings = background(vehicle, turbulence)
    log = FlightLog(
        **record_flight(vehicle, effects, trajectory, seconds, seed, settings, imu=True),
        name="imu_flight",
    )
    noise = np.random.default_rng(seed).standard_normal((2, len(log.t), 3))
    return replace(
        log,
        accelerometer=log.accelerometer + 0.1 * noise[0] + [0.05, -0.1, 0.08],
        gyro=log.gyro + 0.005 * noise[1] + [0.01, -0.005, 0.008],
    )
