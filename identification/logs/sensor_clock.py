"""The clock of a log's inertial sensors against the clock of its pose.

Over a window the mean of the gyro is the turn of the attitude. The offset of the likeliest windows
is searched over +-0.3 s. The rotors tell which of the two clocks is wrong: torques turn the body at
once.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation, Slerp

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import resampled
from .evidence import GOOD, Evidence
from .excerpt import excerpt
from .flight_log import FlightLog
from .inertial import STILL, WINDOW, middle, windows
from .table import Array, Mask

_FARTHEST = 0.3  # s, of the search
_COARSE, _FINE = 0.01, 0.001  # s, of its steps
# s: smaller offsets are delays of the sensors' own filters, and of stamps at a sample's end
_LEAST = 0.01
_PARTS = 4  # of the flight; the scatter of their offsets is the uncertainty
_SURE = 4.0  # standard deviations
_FEWEST = 40  # windows


def on_one_clock(log: FlightLog, vehicle: Vehicle | None) -> tuple[FlightLog, tuple[str, ...]]:
    """Return a log with IMU and pose on one clock, and a note on an offset beyond 10 ms.

    Samples are moved by whole rows. Beyond 0.3 s the inertial sensors are left out.

    Args:
        log: the flight, as read.
        vehicle: as declared, for the rotors' torques; None: rotors on one side turn the body to the
            other.
    """
    late, std = _imu_delay(log)
    if not abs(late) > max(_LEAST, _SURE * std):
        return log, ()
    if abs(late) > _FARTHEST - _COARSE:
        left_out: dict[str, Any] = {"gyro": None, "accelerometer": None}
        return replace(log, **left_out), (
            f"the IMU's clock is off by more than {_FARTHEST:g} s against the pose's: gyro and "
            "accelerometer were left out",
        )
    whose = "late" if late > 0.0 else "early"
    if log.has_rotor_speeds and abs(_rotor_delay(log, vehicle)) > 0.5 * abs(late):
        # rotors and IMU share a clock
        pose = {"position": log.position, "quaternion": log.quaternion}
        moved = _moved(log.t, log.valid, -late, pose)
        whose = "early" if late > 0.0 else "late"
        note = f"the pose is {abs(late):.3f} s {whose} against the IMU and the rotor speeds"
        return replace(log, **moved, valid=np.isfinite(moved["position"][:, 0])), (
            f"{note} (standard deviation {std:.3f} s), and was moved",
        )
    sensors = {"gyro": log.gyro, "accelerometer": log.accelerometer}
    for name, x in sensors.items():
        if x is not None:
            log = replace(log, **_moved(log.t, np.isfinite(x[:, 0]), late, {name: x}))
    note = f"the IMU is {abs(late):.3f} s {whose} against the pose and the rotor speeds"
    return log, (f"{note} (standard deviation {std:.3f} s), and was moved",)


def _imu_delay(log: FlightLog) -> tuple[float, float]:
    """Return the delay in s of the IMU against the pose, and its standard deviation; 0: unknown."""
    if log.gyro is None or not log.valid.any():
        return 0.0, 0.0
    read = np.isfinite(log.gyro[:, 0])
    seen = np.flatnonzero(log.valid)
    t, pose_times = log.t[read], log.t[seen]
    begins = windows(pose_times, t, before=0.0)
    if len(begins):
        inside = (begins > t[0] + _FARTHEST) & (begins < t[-1] - _FARTHEST - WINDOW)
        begins = begins[inside]
    if len(begins) < _FEWEST:
        return 0.0, 0.0
    at = Slerp(pose_times, Rotation.from_quat(log.quaternion[seen], scalar_first=True))
    turned = (at(begins).inv() * at(begins + WINDOW)).as_rotvec() / WINDOW
    sum_of = cumulative_trapezoid(log.gyro[read], t, axis=0, initial=0.0)

    def left(late: float, part: slice | Array) -> float:
        """Return the middle squared difference of turns and gyro in some windows."""
        begin, motion = begins[part] + late, turned[part]
        mean = (resampled(begin + WINDOW, t, sum_of) - resampled(begin, t, sum_of)) / WINDOW
        off = motion - mean
        return middle(off - np.median(off, axis=0))

    def likeliest(part: slice | Array) -> float:
        found = 0.0
        for reach, step in ((_FARTHEST, _COARSE), (_COARSE, _FINE)):
            tried = found + np.arange(-round(reach / step), round(reach / step) + 1) * step
            found = float(tried[np.argmin([left(x, part) for x in tried])])
        return found

    late = likeliest(slice(None))
    motion = middle(turned - np.median(turned, axis=0))
    if left(late, slice(None)) > GOOD * (motion + STILL**2):
        return 0.0, 0.0
    parts = np.array_split(np.arange(len(begins)), _PARTS)
    return late, float(np.std([likeliest(part) for part in parts])) / np.sqrt(_PARTS)


def _rotor_delay(log: FlightLog, vehicle: Vehicle | None) -> float:
    """Return the delay in s of the pose's motion behind the rotor speeds; 0: unknown."""
    short = excerpt([log])[0]
    pose = [np.where(short.valid[:, None], x, np.nan) for x in (short.position, short.quaternion)]
    evidence = Evidence(short.t, np.square(short.rotor_speeds), *pose, vehicle=vehicle)
    return evidence.delay() if evidence.enough else 0.0


def _moved(t: Array, there: Mask, late: float, columns: dict[str, Array]) -> dict[str, Any]:
    """Return columns (N, k) with the samples ``there`` (N,) moved ``late`` s back in time, to the
    nearest rows; NaN elsewhere.
    """
    source = np.flatnonzero(there)
    when = t[source] - late
    inside = (when >= t[0]) & (when <= t[-1])
    source, when = source[inside], when[inside]
    after = np.clip(np.searchsorted(t, when), 1, len(t) - 1)
    target = after - (when - t[after - 1] < t[after] - when)
    out = {name: np.full_like(x, np.nan) for name, x in columns.items()}
    for name, x in columns.items():
        out[name][target] = x[source]
    return out
