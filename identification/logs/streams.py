"""From streams with clocks of their own (topics of a bag, messages of an autopilot's log) to one
flight log.

Rows are the pose's samples. Where an inertial sensor is much faster than the pose, or where there
is no pose, they are the sensor's: the kit's form has room for rows without a pose.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .commanded_speeds import with_commanded_speeds
from .flight_log import FlightLog, Mask, time_notes
from .log_map import Commands

Array = NDArray[np.float64]

_NORM_TOLERANCE = 0.02  # of a quaternion's length
_SENSOR_GAP = 3.5  # median steps, across which an inertial sensor is not interpolated
_ROTOR_GAP = 0.5  # s without rotor speeds that deserves a note
# times faster than the pose from which an inertial sensor has rows of its own: a pose is put to the
# nearest of them, so it moves by a tenth of the pose's step at most, and its noise stays its own
_OWN_ROWS = 5.0


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
        there |= (self.t[after] == t) | (self.t[after - 1] == t)
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
    turn = Slerp(times, Rotation.from_quat(attitude.values[good], scalar_first=True))(t[inside])
    out[inside] = turn.as_quat(scalar_first=True)
    return out


def flight_log(
    path: Path,
    reader: str,
    pose: Stream | None,
    rotors: Stream | None,
    voltage: Stream | None,
    notes: tuple[str, ...],
    accelerometer: Stream | None = None,
    gyro: Stream | None = None,
    command: Stream | None = None,
    vehicle: Vehicle | None = None,
    commanded: bool = False,
    vehicle_name: str = "",
    model: Commands | None = None,
) -> FlightLog:
    """Return the log of a pose (position and scalar-first quaternion), rotor speeds (rad/s) or
    motor commands (0 to 1), and where they are there a voltage (V), an accelerometer (m/s2) and a
    gyro (rad/s), body axes forward, left, up.

    Rows are the pose's samples within the span of the motors' stream. Of a sensor 5 times faster
    than the pose, or of a log without a pose, they are the sensor's; a pose then stands in the
    nearest row, moved there along the line to its neighbour. Everything else is interpolated to the
    rows. A pose with a number that is not finite is not valid.

    Args:
        path: the file, for errors and the log's name.
        reader: its reader's name.
        pose: (N, 7); None: the log has none, and then accelerometer and gyro must be there.
        rotors: (N, 4) rad/s in the kit's order; None: not known, and then ``command`` must be
            there.
        voltage: (N, 1) V.
        notes: what the reader assumed.
        accelerometer: (N, 3) m/s2.
        gyro: (N, 3) rad/s.
        command: (N, 4), 0 to 1, in the kit's order.
        vehicle: turns commands into rotor speeds where none are known, by its motor curve or by an
            assumption that the notes state; None: they stay unknown.
        commanded: ``rotors`` were computed from commands.
        vehicle_name: the vehicle that flew, where the reader knows it.
        model: what commands are assumed to give where the vehicle states no motor curve.

    Raises:
        InputError: too few samples, a rotor speed that is not finite, a quaternion that is none,
            nothing to find motion from, no motors, or streams that do not overlap.
    """
    motors = rotors if rotors is not None else command
    if motors is None:
        raise InputError(f"{path}: no motors; expected rotor speeds or motor commands")
    accelerometer, gyro = readable(accelerometer), readable(gyro)
    if pose is None and (accelerometer is None or gyro is None):
        absent = " and no ".join(
            name for name, s in (("accelerometer", accelerometer), ("gyro", gyro)) if s is None
        )
        raise InputError(
            f"{path}: no pose, and no {absent}; expected a pose, or accelerometer and gyro"
        )
    for stream in (pose, rotors, command):
        if stream is not None and len(stream.t) < 2:
            raise InputError(
                f"{path}: {stream.name}: {len(stream.t)} message(s); expected at least two"
            )
    if pose is not None:
        pose, pose_notes = pose.forward()
        notes += pose_notes
        _check_pose(path, pose)
    if rotors is not None:
        rotors, rotor_notes = rotors.forward()
        notes += rotor_notes
        _check_rotor_speeds(path, rotors)
    if command is not None:
        command = readable(command)
        if command is None or len(command.t) < 2:
            raise InputError(
                f"{path}: {motors.name}: no two commands are finite numbers; expected some"
            )
        command = Stream(command.name, command.t, np.clip(command.values, 0.0, 1.0))
    motors = rotors if rotors is not None else command
    assert motors is not None
    if (longest := float(np.diff(motors.t).max())) > _ROTOR_GAP:
        notes += (
            f"{motors.name}: up to {longest:.2g} s between messages; the "
            f"{'rotor speeds' if rotors is not None else 'commands'} there are interpolated",
        )
    t, values, row_notes = _rows(path, pose, motors, gyro or accelerometer)
    notes += row_notes
    valid: Mask = np.asarray(np.isfinite(values).all(axis=1))
    length = np.linalg.norm(values[:, 3:], axis=1)
    values = np.where(valid[:, None], values, np.nan)
    if rotors is not None and np.any(rotors.values < 0.0):
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
    volts = None if voltage is None else voltage.at(t)[:, 0]
    commands = None if command is None else command.at(t)
    speeds = np.full((len(t), 4), np.nan) if rotors is None else np.abs(rotors.at(t))
    log = FlightLog(
        t=t - t[0],
        position=values[:, :3],
        quaternion=values[:, 3:] / np.where(valid, length, 1.0)[:, None],
        rotor_speeds=speeds,
        voltage=volts,
        accelerometer=_sensor(accelerometer, t),
        gyro=_sensor(gyro, t),
        name=path.stem.removesuffix(".csv") if path.is_file() else path.name,
        source=f"{path} (reader {reader})",
        notes=(*notes, *time_notes(t - t[0])),
        valid=valid,
        commanded=commanded,
        command=commands,
        vehicle=vehicle_name,
    )
    return with_commanded_speeds(log, vehicle, model)


def _rows(
    path: Path, pose: Stream | None, motors: Stream, sensor: Stream | None
) -> tuple[Array, Array, tuple[str, ...]]:
    """Return the rows' times (M,) in s, the poses (M, 7) in them, NaN where there is none, and
    notes.

    Raises:
        InputError: fewer than two rows lie within the span of the motors' stream.
    """
    own = sensor is not None and (pose is None or _step(pose.t) > _OWN_ROWS * _step(sensor.t) > 0.0)
    stream = sensor if own else pose
    assert stream is not None
    inside = (stream.t >= motors.t[0]) & (stream.t <= motors.t[-1])
    if pose is not None and own:  # the pose and the motors must meet, too
        together = (pose.t >= motors.t[0]) & (pose.t <= motors.t[-1])
        stream, inside = (pose, together) if together.sum() < 2 else (stream, inside)
    if inside.sum() < 2:
        raise InputError(
            f"{path}: {stream.name} (from {stream.t[0]:.6g} to {stream.t[-1]:.6g} s) and "
            f"{motors.name} (from "
            f"{motors.t[0]:.6g} to {motors.t[-1]:.6g} s) do not overlap; expected both over the "
            f"same flight"
        )
    t = stream.t[inside]
    if pose is None:
        note = f"rows are those of {stream.name}, {1.0 / _step(t):.4g} Hz"
        return t, np.full((len(t), 7), np.nan), (note,)
    if not own:
        values = pose.values[inside]
        whole = np.isfinite(values).all(axis=1)
        if whole.all():
            return t, values, ()
        note = f"{pose.name}: {int(np.sum(~whole))} of {len(t)} rows without a whole pose"
        return t, values, (note,)
    values = np.full((len(t), 7), np.nan)
    here = pose.values[np.isfinite(pose.values).all(axis=1)]
    times = pose.t[np.isfinite(pose.values).all(axis=1)]
    if len(times) >= 2:
        near = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
        near -= times - t[near - 1] < t[near] - times
        reach = max(0.6 * _step(t), 0.5 * _step(times) / _OWN_ROWS)
        near = np.unique(near[np.abs(t[near] - times) <= reach])
        near = near[(t[near] >= times[0]) & (t[near] <= times[-1])]
        attitude = slerp(t[near], Stream(pose.name, times, here[:, 3:]))
        values[near] = np.column_stack(
            [Stream(pose.name, times, here[:, :3]).at(t[near]), attitude]
        )
    return (
        t,
        values,
        (
            f"rows are those of {stream.name}, {1.0 / _step(stream.t):.4g} Hz; the pose of "
            f"{pose.name}, {1.0 / _step(pose.t):.4g} Hz, stands in the nearest of them",
        ),
    )


def _step(t: Array) -> float:
    """Return the median time step, s."""
    return float(np.median(np.diff(t)))


def _check_pose(path: Path, pose: Stream) -> None:
    whole = np.isfinite(pose.values).all(axis=1)
    length = np.linalg.norm(pose.values[:, 3:], axis=1)
    off = np.flatnonzero(whole & (np.abs(length - 1.0) > _NORM_TOLERANCE))
    if off.size:
        raise InputError(
            f"{path}: {pose.name}, at {pose.t[off[0]]:.6g} s: a quaternion of length "
            f"{length[off[0]]:.4g}; "
            f"expected 1 within {_NORM_TOLERANCE:g}"
        )
    if not whole.any():
        raise InputError(
            f"{path}: {pose.name}: no pose has seven finite numbers; expected at least one"
        )


def _check_rotor_speeds(path: Path, rotors: Stream) -> None:
    bad = np.argwhere(~np.isfinite(rotors.values))
    if bad.size:
        raise InputError(
            f"{path}: {rotors.name}, message {bad[0][0] + 1}: the rotor speed of rotor "
            f"{bad[0][1] + 1} is "
            f"{rotors.values[tuple(bad[0])]}; expected a finite number"
        )


def readable(sensor: Stream | None) -> Stream | None:
    """Return the samples (N, K) that are finite and in order of time; None where they are fewer
    than two.
    """
    if sensor is None:
        return None
    good = np.isfinite(sensor.values).all(axis=1)
    sensor, _ = Stream(sensor.name, sensor.t[good], sensor.values[good]).forward()
    return sensor if len(sensor.t) >= 2 else None


def _sensor(sensor: Stream | None, t: Array) -> Array | None:
    """Return what an inertial sensor measured (M, 3) at times (M,) in s, or None where it did not.

    A sensor that is faster than the rows is thinned to them.
    """
    if sensor is None:
        return None
    values = sensor.between(t)
    return values if np.isfinite(values[:, 0]).any() else None
