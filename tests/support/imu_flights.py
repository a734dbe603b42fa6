"""Flights with an IMU, for the tests."""

from dataclasses import replace

import numpy as np

from windwrench.envs.recording import background, record_flight
from windwrench.identification.logs.flight_log import FlightLog


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


def pose_removed(log, position_every=0):
    """The log without its pose, or with each so many-th position alone."""
    count = len(log.t)
    position = np.full((count, 3), np.nan)
    if position_every:
        position[::position_every] = log.position[::position_every]
    return replace(
        log,
        position=position,
        quaternion=np.full((count, 4), np.nan),
        valid=np.zeros(count, dtype=np.bool_),
    )
