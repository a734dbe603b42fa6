"""The noise of a log's sensors, estimated from the log itself, and the residual of this noise
alone.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.vehicle import Mocap, Vehicle
from ..logs.flight_log import FlightLog, Logs
from ..logs.table import Array
from .inertial_signals import imu_noise, pose_rate, reads_imu
from .smoothing import CUTOFFS, high_pass, robust_std, turned


class _SensorNoise(NamedTuple):
    """Standard deviations of one sample, per axis."""

    position: float  # m
    attitude: float  # rad
    rounding: float  # rad/s, step of the rotor speeds
    gyro: float = 0.0  # rad/s, where the motion is read from an IMU
    accelerometer: float = 0.0  # m/s2, likewise


def sensor_noise(log: FlightLog, vehicle: Vehicle, hidden: bool = False) -> _SensorNoise:
    """Return the noise of a log. A pose's noise is the part above a quarter of the sampling rate,
    taken as white; ``hidden``: no less than the noise of motion capture by the vehicle's file.

    The rotor speeds' noise is the vehicle's rounding step.
    """
    none = Mocap(0.0, 0.0, 0.0)
    step = vehicle.omega_lsb if vehicle.omega_source == "measured" else 0.0
    if reads_imu(log):  # the few poses beside it show no noise of their own
        mocap = vehicle.mocap if pose_rate(log) > 0.0 else none
        return _SensorNoise(mocap.sigma_pos_m, mocap.sigma_att_rad, step, *imu_noise(log))
    seen = np.flatnonzero(log.valid)
    steps = np.diff(log.t[seen])
    whole = np.flatnonzero(steps < 1.5 * np.median(steps))
    position = high_pass(log.position[seen], CUTOFFS.noise_share_of_rate)[whole]
    angle = high_pass(turned(log.quaternion[seen]), CUTOFFS.noise_share_of_rate)
    least = vehicle.mocap if hidden else none
    return _SensorNoise(
        max(robust_std(position), least.sigma_pos_m),
        max(robust_std(angle), least.sigma_att_rad),
        step,
    )


def with_noise(log: FlightLog, noise: _SensorNoise, rng: np.random.Generator) -> FlightLog:
    """Return a log with this noise added once more."""
    n = len(log.t)
    turn = Rotation.from_rotvec(noise.attitude * rng.standard_normal((n, 3)))
    quaternion = log.quaternion.copy()
    if log.valid.any():
        quaternion[log.valid] = (
            Rotation.from_quat(log.quaternion[log.valid], scalar_first=True) * turn[log.valid]
        ).as_quat(scalar_first=True)

    def noisier(x: Array | None, std: float) -> Array | None:
        return x if x is None or std == 0.0 else x + std * rng.standard_normal((n, 3))

    return replace(
        log,
        position=log.position + noise.position * rng.standard_normal((n, 3)),
        quaternion=quaternion,
        rotor_speeds=log.rotor_speeds + noise.rounding * (rng.random((n, 4)) - 0.5),
        gyro=noisier(log.gyro, noise.gyro),
        accelerometer=noisier(log.accelerometer, noise.accelerometer),
    )


def noisy_logs(logs: Logs, vehicle: Vehicle, hidden: bool = False) -> list[FlightLog]:
    """Return logs with their own noise added once more: any change of a result is made by noise.

    ``hidden``: a filter took the noise out of the logs' upper band, and only a part of it shows.
    Then the noise of motion capture by the vehicle's file is added, if larger.
    """
    rng = np.random.default_rng(0)
    return [with_noise(log, sensor_noise(log, vehicle, hidden), rng) for log in logs]
