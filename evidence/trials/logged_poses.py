"""Logs of practice flights as vehicles and programs write them.

A program filters the pose before it writes the pose to a log. A vehicle without motion capture
writes its IMU in place of the pose, and its position a few times a second.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfiltfilt

from windwrench.dynamics.vehicle import Vehicle
from windwrench.estimator import UKFTuning
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.smoothing import continuous
from windwrench.reproduction import WrenchEKF

Array = NDArray[np.float64]
Filter = Callable[[FlightLog, Vehicle], FlightLog]

CUTOFFS_HZ = (5.0, 10.0, 20.0)
RESAMPLED_HZ = 80.0  # from which a log is interpolated back to its own rate


def _each(log: FlightLog, smooth: Callable[[Array], Array]) -> FlightLog:
    """Return a log whose position (n, 3) and quaternion (n, 4) went through ``smooth``."""
    quaternion = smooth(continuous(log.quaternion))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return replace(log, position=smooth(log.position), quaternion=quaternion)


def unfiltered(log: FlightLog, _vehicle: Vehicle) -> FlightLog:
    """Return the log itself."""
    return log


def causal(log: FlightLog, _vehicle: Vehicle, cutoff_hz: float) -> FlightLog:
    """Return a log behind a second-order Butterworth low-pass, as a program runs it in flight."""
    sections = butter(2, 2.0 * cutoff_hz * log.period, output="sos")
    return _each(log, lambda x: sosfilt(sections, x - x[0], axis=0) + x[0])


def acausal(log: FlightLog, _vehicle: Vehicle, cutoff_hz: float) -> FlightLog:
    """Return a log behind the same low-pass run forwards and backwards, as a script does it."""
    sections = butter(2, 2.0 * cutoff_hz * log.period, output="sos")
    return _each(log, lambda x: sosfiltfilt(sections, x, axis=0))


def estimated(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return a log with the pose of an extended Kalman filter that knows the declared vehicle."""
    noise = vehicle.mocap
    tuning = UKFTuning(position_noise=noise.sigma_pos_m, attitude_noise=noise.sigma_att_rad)
    ekf = WrenchEKF(vehicle, tuning, period=log.period)
    ekf.reset(log.position[0], log.quaternion[0])
    poses = [(log.position[0], log.quaternion[0])]
    for speeds, position, quaternion in zip(
        log.rotor_speeds[1:], log.position[1:], log.quaternion[1:], strict=True
    ):
        estimate = ekf.step(speeds, position, quaternion)
        poses.append((estimate.position.copy(), estimate.quaternion.copy()))
    return replace(
        log, position=np.array([p for p, _ in poses]), quaternion=np.array([q for _, q in poses])
    )


def resampled(log: FlightLog, _vehicle: Vehicle) -> FlightLog:
    """Return a log whose pose was kept at a lower rate and interpolated back to the log's own."""
    coarse = np.arange(log.t[0], log.t[-1] + 1.0 / RESAMPLED_HZ, 1.0 / RESAMPLED_HZ)

    def through(x: Array) -> Array:
        kept = [np.interp(coarse, log.t, column) for column in x.T]
        return np.column_stack([np.interp(log.t, coarse, column) for column in kept])

    return _each(log, through)


FILTERS: Mapping[str, Filter] = {
    "as measured": unfiltered,
    **{f"causal {f:g} Hz": partial(causal, cutoff_hz=f) for f in CUTOFFS_HZ},
    **{f"acausal {f:g} Hz": partial(acausal, cutoff_hz=f) for f in CUTOFFS_HZ},
    "extended Kalman filter": estimated,
    f"resampled from {RESAMPLED_HZ:g} Hz": resampled,
}


@dataclass(frozen=True)
class ImuNoise:
    """Noise of one sample of a MEMS IMU at 200 Hz on a vehicle, and its bias: standard deviations,
    each axis.
    """

    gyro: float = 0.005  # rad/s
    accelerometer: float = 0.1  # m/s2: vibration more than the sensor
    gyro_bias: float = 0.01  # rad/s
    accelerometer_bias: float = 0.1  # m/s2


IMU = ImuNoise()
POSITION_HZ = 10.0


def pose_removed(log: FlightLog, position_every: int = 0) -> FlightLog:
    """Return a log without its pose, or with each so many-th position alone."""
    count = len(log.t)
    position = np.full((count, 3), np.nan)
    if position_every:
        position[::position_every] = log.position[::position_every]
    none, nothing = np.full((count, 4), np.nan), np.zeros(count, dtype=np.bool_)
    return replace(log, position=position, quaternion=none, valid=nothing)


def without_pose(
    log: FlightLog, seed: int = 0, position_hz: float = 0.0, noise: ImuNoise = IMU
) -> FlightLog:
    """Return a log with noise and bias on its true gyro and accelerometer, and with its positions
    alone, ``position_hz`` of them a second, or with no pose at all.
    """
    rng = np.random.default_rng((seed, 7))

    def read(true: np.ndarray | None, std: float, bias: float) -> np.ndarray:
        assert true is not None
        off = bias * rng.standard_normal(3)
        return np.asarray(true + off + std * rng.standard_normal((len(log.t), 3)))

    every = round(1.0 / (position_hz * log.period)) if position_hz > 0.0 else 0
    return replace(
        pose_removed(log, every),
        gyro=read(log.gyro, noise.gyro, noise.gyro_bias),
        accelerometer=read(log.accelerometer, noise.accelerometer, noise.accelerometer_bias),
    )


LOGS: Mapping[str, Callable[[FlightLog, int], FlightLog]] = {
    "no pose": without_pose,
    f"position at {POSITION_HZ:g} Hz": partial(without_pose, position_hz=POSITION_HZ),
}
