"""Logs as vehicles without motion capture write them: an IMU in place of the pose, positions a few
times a second, motor commands in place of rotor speeds.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from windwrench.identification.logs.flight_log import FlightLog


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


def without_pose(
    log: FlightLog, seed: int = 0, position_hz: float = 0.0, noise: ImuNoise = IMU
) -> FlightLog:
    """Return a log with noise and bias on its true gyro and accelerometer, and with its positions
    alone, ``position_hz`` of them a second, or with no pose at all.
    """
    rng = np.random.default_rng((seed, 7))
    count = len(log.t)

    def read(true: np.ndarray | None, std: float, bias: float) -> np.ndarray:
        assert true is not None
        off = bias * rng.standard_normal(3)
        return np.asarray(true + off + std * rng.standard_normal((count, 3)))

    position = np.full((count, 3), np.nan)
    if position_hz > 0.0:
        every = round(1.0 / (position_hz * log.period))
        position[::every] = log.position[::every]
    return replace(
        log,
        position=position,
        quaternion=np.full((count, 4), np.nan),
        valid=np.zeros(count, dtype=np.bool_),
        gyro=read(log.gyro, noise.gyro, noise.gyro_bias),
        accelerometer=read(log.accelerometer, noise.accelerometer, noise.accelerometer_bias),
    )


LOGS: Mapping[str, Callable[[FlightLog, int], FlightLog]] = {
    "no pose": without_pose,
    f"position at {POSITION_HZ:g} Hz": partial(without_pose, position_hz=POSITION_HZ),
}
