"""What programs do to a pose before they write it to a log."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfiltfilt

from windwrench.dynamics.vehicle import Vehicle
from windwrench.estimator import UKFTuning, WrenchEKF
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.motion.smoothing import continuous

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
