"""From streams with clocks of their own (topics of a bag, of a ULog) to one flight log at the
pose's times.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from ....runtime.errors import InputError
from ..flight_log import FlightLog, Mask, time_notes

Array = NDArray[np.float64]

_NORM_TOLERANCE = 0.02  # of a quaternion's length
_SENSOR_GAP = 3.5  # median steps, across which an inertial sensor is not interpolated
_ROTOR_GAP = 0.5  # s without rotor speeds that deserves a note


@dataclass(frozen=True, eq=False)
class Stream:
    """Samples of one topic."""

    name: str  # of the topic
    t: Array  # (N,) s, all streams of a log on one clock
    values: Array  # (N, K)

    def forward(self) -> "tuple[Stream, tuple[str, ...]]":
        """Return the samples that are later than every one before them, and a note where that left
        some out.
        """
        keep: Mask = np.concatenate([[True], self.t[1:] > np.maximum.accumulate(self.t)[:-1]])[
            : len(self.t)
        ]
        if keep.all():
            return self, ()
        note = (
            f"{self.name}: {int(np.sum(~keep))} of {len(keep)} samples repeat or go back in time "
            "and were left out"
        )
        return Stream(self.name, self.t[keep], self.values[keep]), (note,)

    def at(self, t: Array) -> Array:
        """Return the values (M, K) at times (M,) in s, linear between samples and held beyond the
        first and the last.
        """
        return np.column_stack([np.interp(t, self.t, column) for column in self.values.T])

    def between(self, t: Array) -> Array:
        """Return the values (M, K) at times (M,) in s, linear between samples; NaN beyond the first
        and the last, and where samples are missing.
        """
        out = self.at(t)
        step = np.diff(self.t)
        after = np.clip(np.searchsorted(self.t, t), 1, len(self.t) - 1)
        there = step[after - 1] <= _SENSOR_GAP * float(np.median(step))
        out[~there | (t < self.t[0]) | (t > self.t[-1])] = np.nan
        return out


def from_ned(position: Array, quaternion: Array) -> tuple[Array, Array]:
    """Return positions (N, 3) and quaternions (N, 4) from NED and FRD (world and body z down) to z
    up and y left.

    Both frames turn by half a turn about their own x axis: x stays north and forward, east becomes
    -y (west), down becomes -z. So the vector part of the quaternion changes like a position.
    """
    half_turn = np.array([1.0, -1.0, -1.0])
    return position * half_turn, quaternion * np.concatenate([[1.0], half_turn])


def slerp(t: Array, attitude: Stream) -> Array:
    """Return attitudes (M, 4), scalar first, at times (M,) in s; NaN before the first sample and
    after the last.
    """
    out = np.full((len(t), 4), np.nan)
    good = np.linalg.norm(attitude.values, axis=1) > 0.5  # False where NaN
    times = attitude.t[good]
    if len(times) < 2:
        return out
    inside = (t >= times[0]) & (t <= times[-1])
    turn = Slerp(times, Rotation.from_quat(attitude.values[good][:, [1, 2, 3, 0]]))(t[inside])
    out[inside] = turn.as_quat()[:, [3, 0, 1, 2]]
    return out


def flight_log(
    path: Path,
    reader: str,
    pose: Stream,
    rotors: Stream,
    voltage: Stream | None,
    notes: tuple[str, ...],
    accelerometer: Stream | None = None,
    gyro: Stream | None = None,
) -> FlightLog:
    """Return the log of a pose (position and scalar-first quaternion), rotor speeds and, where
    they are there, a voltage, an accelerometer (m/s2) and a gyro (rad/s), body axes forward, left,
    up.

    Rows are the pose's samples within the span of the rotor speeds; the others are interpolated to
    their times. A pose with a number that is not finite is not valid.

    Raises:
        InputError: too few samples, a rotor speed that is not finite, a quaternion that is none, or
            streams that do not overlap.
    """
    for stream in (pose, rotors):
        if len(stream.t) < 2:
            raise InputError(
                f"{path}: {stream.name}: {len(stream.t)} message(s); expected at least two"
            )
    pose, pose_notes = pose.forward()
    rotors, rotor_notes = rotors.forward()
    bad = np.argwhere(~np.isfinite(rotors.values))
    if bad.size:
        raise InputError(
            f"{path}: {rotors.name}, message {bad[0][0] + 1}: the rotor speed of rotor "
            f"{bad[0][1] + 1} is "
            f"{rotors.values[tuple(bad[0])]}; expected a finite number"
        )
    inside = (pose.t >= rotors.t[0]) & (pose.t <= rotors.t[-1])
    if inside.sum() < 2:
        raise InputError(
            f"{path}: {pose.name} (from {pose.t[0]:.6g} to {pose.t[-1]:.6g} s) and {rotors.name} "
            f"(from "
            f"{rotors.t[0]:.6g} to {rotors.t[-1]:.6g} s) do not overlap; expected both over the "
            f"same flight"
        )
    t, values = pose.t[inside], pose.values[inside]
    valid: Mask = np.isfinite(values).all(axis=1)
    length = np.linalg.norm(values[:, 3:], axis=1)
    off = np.flatnonzero(valid & (np.abs(length - 1.0) > _NORM_TOLERANCE))
    if off.size:
        raise InputError(
            f"{path}: {pose.name}, at {t[off[0]]:.6g} s: a quaternion of length "
            f"{length[off[0]]:.4g}; "
            f"expected 1 within {_NORM_TOLERANCE:g}"
        )
    if not valid.any():
        raise InputError(
            f"{path}: {pose.name}: no pose has seven finite numbers; expected at least one"
        )
    values = np.where(valid[:, None], values, np.nan)
    notes = (*notes, *pose_notes, *rotor_notes)
    if not valid.all():
        notes += (f"{pose.name}: {int(np.sum(~valid))} of {len(t)} rows without a whole pose",)
    if (longest := float(np.diff(rotors.t).max())) > _ROTOR_GAP:
        notes += (
            f"{rotors.name}: up to {longest:.2g} s between messages; the rotor speeds there are "
            f"interpolated",
        )
    speeds = rotors.at(t)
    if np.any(speeds < 0.0):
        notes += (
            f"{rotors.name}: negative rotor speeds (a sense of rotation) were taken as positive",
        )
    if voltage is not None:
        good = np.isfinite(voltage.values[:, 0]) & (voltage.values[:, 0] > 0.0)
        if good.any():
            voltage, _ = Stream(voltage.name, voltage.t[good], voltage.values[good]).forward()
        else:
            notes += (f"{voltage.name}: no positive voltage; left out",)
            voltage = None
    return FlightLog(
        t=t - t[0],
        position=values[:, :3],
        quaternion=values[:, 3:] / length[:, None],
        rotor_speeds=np.abs(speeds),
        voltage=None if voltage is None else voltage.at(t)[:, 0],
        accelerometer=_sensor(accelerometer, t),
        gyro=_sensor(gyro, t),
        name=path.stem if path.is_file() else path.name,
        source=f"{path} (reader {reader})",
        notes=(*notes, *time_notes(t - t[0])),
        valid=valid,
    )


def _sensor(sensor: Stream | None, t: Array) -> Array | None:
    """Return what an inertial sensor measured (M, 3) at times (M,) in s, or None where it did not.

    A sensor that is faster than the pose is thinned to the pose's times.
    """
    if sensor is None:
        return None
    good = np.isfinite(sensor.values).all(axis=1)
    sensor, _ = Stream(sensor.name, sensor.t[good], sensor.values[good]).forward()
    if len(sensor.t) < 2:
        return None
    values = sensor.between(t)
    return values if np.isfinite(values[:, 0]).any() else None
