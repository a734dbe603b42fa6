"""Streams with clocks of their own, and one flight log from them.

Rows are the pose's samples. For an inertial sensor much faster than the pose, or without a pose,
rows are the sensor's: the kit's form has room for rows without a pose.

A log with held slow channels, or resampled along straight lines, has unmeasured rows:
``source_rate`` returns a channel's rate of measurement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from ..motion.smoothing import resampled
from .commanded_speeds import flown_vehicle, speeds_of_wrench, with_commanded_speeds
from .flight_log import FlightLog, time_notes
from .log_map import LogMap
from .table import Array, Names, Rows, finite_rows, median_step
from .what_flew import UNSTATED, WhatFlew

_SENSOR_GAP = 3.5  # median steps, the longest gap for interpolating an inertial sensor
# V: below, a lithium cell is empty, and above no multirotor's pack of 14 cells of 4.35 V
LEAST_VOLTS, MOST_VOLTS = 2.5, 61.0
_ROTOR_GAP = 0.5  # s without rotor speeds; longer gaps get a note
_MOTORS = {"rotors": "rotor speeds", "commands": "commands", "wrench": "commanded wrenches"}
# times faster than the pose: an inertial sensor has rows of its own. A pose is put to the nearest
# row, so the pose moves by a tenth of its step at most, with its own noise
_OWN_ROWS = 5.0


@dataclass(frozen=True, eq=False)
class Stream:
    """Samples of one quantity."""

    name: str  # topic's or column's name
    t: Array  # (N,) s, all streams of a log on one clock
    values: Array  # (N, K); NaN: not measured

    def whole(self) -> "Stream":
        """Return the samples of finite values."""
        good = finite_rows(self.values)
        return self if good.all() else Stream(self.name, self.t[good], self.values[good])

    def at(self, t: Array) -> Array:
        """Return the values (M, K) at times (M,) in s: each column is linear between its finite
        values and held beyond the first and the last. A column without any is NaN.
        """
        out = np.full((len(t), self.values.shape[1]), np.nan)
        for i, column in enumerate(self.values.T):
            good = np.isfinite(column)
            if good.any():
                out[:, i] = np.interp(t, self.t[good], column[good])
        return out

    def between(self, t: Array) -> Array:
        """Return the values (M, K) at times (M,) in s: a sample's own at its time, else linear
        between its neighbours; NaN beyond the first and the last, and where samples are missing.
        """
        out = resampled(t, self.t, self.values)
        step = np.diff(self.t)
        after = np.clip(np.searchsorted(self.t, t), 1, len(self.t) - 1)
        there = step[after - 1] <= _SENSOR_GAP * np.median(step)
        there |= (self.t[after] == t) | (self.t[after - 1] == t)
        out[~there | (t < self.t[0]) | (t > self.t[-1])] = np.nan
        return out


def readable(stream: Stream | None) -> Stream | None:
    """Return the finite samples (N, K); None: fewer than two."""
    finite = None if stream is None else stream.whole()
    return None if finite is None or len(finite.t) < 2 else finite


def slerp(t: Array, attitude: Stream, longest: float = np.inf) -> Array:
    """Return attitudes (M, 4), scalar first, at times (M,) in s; NaN outside the samples, and
    within a gap of more than ``longest`` s. Samples at all of the times are returned as they are,
    whatever their length.
    """
    out = np.full((len(t), 4), np.nan)
    good = np.linalg.norm(attitude.values, axis=1) > 0.5  # False where NaN
    times, values = attitude.t[good], attitude.values[good]
    after = np.searchsorted(times, t)
    exact = np.isin(t, times)
    if exact.all():
        return np.asarray(values[after])
    if len(times) < 2:
        return out
    inside = (t >= times[0]) & (t <= times[-1])
    inside &= exact | (np.diff(times)[np.clip(after, 1, len(times) - 1) - 1] <= longest)
    if inside.any():
        turn = Slerp(times, Rotation.from_quat(values, scalar_first=True))(t[inside])
        out[inside] = turn.as_quat(scalar_first=True)
    return out


@dataclass(frozen=True)
class Recording:
    """The channels of a log in the kit's units, axes and order of rotors."""

    path: Path  # the file, for errors and the log's name
    reader: str  # its name; nothing: the file is a table of the kit's own or of a map
    log_map: LogMap  # with the sections that are there
    # by section: position (N, 7) m, with its scalar-first quaternion; rotors (N, 4) rad/s, commands
    # (N, 4) 0 to 1, or wrench (N, 4) N and Nm, commanded; battery (N, 1) V; accelerometer (N, 3)
    # m/s2 and gyro (N, 3) rad/s; force and torque (N, 3), truth
    streams: dict[str, Stream]
    notes: list[str]  # the reader's assumptions
    extra: dict[str, Stream]  # further channels, by name
    flown: WhatFlew = UNSTATED

    def log(self, vehicle: Vehicle | None) -> FlightLog:
        """Return the flight log.

        Rows are the pose's samples within the span of the motors' stream. For a sensor 5 times
        faster than the pose, or without a pose, rows are the sensor's. A pose then stands in the
        nearest row, moved there along the line to its neighbour. Everything else is interpolated to
        the rows. A pose with NaN or an infinite number is not valid.

        Args:
            vehicle: the vehicle, to turn commands into rotor speeds by its motor curve or by an
                assumption in the notes; None: the map's, if a preset.

        Raises:
            InputError: too few samples, an infinite rotor speed, neither a pose nor gyro and
                accelerometer, no motors, or streams without overlap.
        """
        path, reader, log_map = self.path, self.reader, self.log_map
        vehicle = flown_vehicle(vehicle, log_map.vehicle)
        made, words = _cleaned(path, self.streams)
        notes = (*self.notes, *words)
        sensors = {name: made[name] for name in ("gyro", "accelerometer") if name in made}
        kind = next(name for name in _MOTORS if name in made)
        motors = made[kind].whole()
        t, pose, words = _rows(path, made.get("position"), motors, [*sensors.values()])
        notes += words
        after = np.searchsorted(motors.t, t)  # rows lie within the motors' span
        steps = np.diff(motors.t)[after[motors.t[after] != t] - 1]
        if (longest := steps.max(initial=0.0)) > _ROTOR_GAP:
            notes += (
                f"{motors.name}: up to {longest:.2g} s between messages; the {_MOTORS[kind]} there "
                "are interpolated",
            )
        valid = finite_rows(pose)
        if np.isfinite(pose[:, 3:]).any():  # else positions without an attitude, which are kept
            pose[~valid] = np.nan
        pose[valid, 3:] /= np.linalg.norm(pose[valid, 3:], axis=1)[:, None]
        speeds = np.full((len(t), 4), np.nan)
        if "rotors" in made:
            speeds = made["rotors"].at(t)
        elif kind == "wrench" and vehicle is not None:
            speeds, wrench_notes = speeds_of_wrench(made["wrench"].at(t), vehicle)
            notes += tuple(wrench_notes)
        measured = {name: x for name, s in sensors.items() if np.isfinite(x := s.between(t)).any()}
        truth = {name: made[name].at(t) for name in ("force", "torque") if name in made}
        kept = {name: stream.between(t) for name, stream in self.extra.items()}
        times = t - t[0] if log_map.time.offset is None else t
        notes += time_notes(times)
        without = np.count_nonzero(~valid) if valid.any() else 0
        if without and measured:  # the sensor may be faster than the pose
            notes += tuple(f"of the pose: {text}" for text in time_notes(times[valid]))
        elif without:
            first = times[np.argmin(valid)]
            notes += (f"{without} of {len(t)} rows without a pose, the first at t = {first:.6g} s",)
        log = FlightLog(
            times,
            pose[:, :3],
            pose[:, 3:],
            speeds,
            voltage=made["battery"].at(t)[:, 0] if "battery" in made else None,
            name=Path(path.name.removesuffix(".gz")).stem if path.is_file() else path.name,
            source=f"{path} (reader {reader})" if reader else str(path),
            notes=notes,
            valid=valid,
            extra={name: x[:, 0] if x.shape[1] == 1 else x for name, x in kept.items()},
            commanded=kind == "wrench",
            command=made["commands"].at(t) if "commands" in made else None,
            vehicle=log_map.vehicle,
            flown=self.flown,
            rates={name: source_rate(s.t, s.values) for name, s in made.items()},
            **measured,
            **truth,
        )
        return with_commanded_speeds(log, vehicle, log_map.commands)


def _cleaned(path: Path, streams: Mapping[str, Stream]) -> tuple[dict[str, Stream], Names]:
    """Return the streams with values, within a flight's limits, and notes.

    Raises:
        InputError: too few samples, or an infinite rotor speed.
    """
    made: dict[str, Stream] = {}
    notes: Names = ()
    for name, stream in streams.items():
        if name in ("position", *_MOTORS) and len(stream.t) < 2:
            raise InputError(
                f"{path}: {stream.name}: {len(stream.t)} message(s); expected at least two"
            )
        values = stream.values
        if name in _MOTORS:
            infinite = np.argwhere(np.isinf(values))
            if infinite.size and name == "rotors":
                row, rotor = infinite[0]
                raise InputError(
                    f"{path}: {stream.name}, message {row + 1}: the rotor speed of rotor "
                    f"{rotor + 1} is {values[row, rotor]}; expected a finite number"
                )
            if len(stream.whole().t) < 2:
                raise InputError(
                    f"{path}: {stream.name}: no two samples have four finite {_MOTORS[name]}; "
                    "expected some"
                )
            if name == "rotors" and np.any(values < 0.0):
                notes += (f"{stream.name}: negative rotor speeds were taken as positive",)
            values = np.abs(values) if name == "rotors" else values
            values = np.clip(values, 0.0, 1.0) if name == "commands" else values
        elif name == "battery":
            plausible = (values >= LEAST_VOLTS) & (values <= MOST_VOLTS)
            wrong = values[~plausible & (values > 0.0)]
            if len(wrong):
                notes += (
                    f"{stream.name}: {len(wrong)} of {len(values)} voltages, {wrong.min():.3g} to "
                    f"{wrong.max():.3g} V, are none of a vehicle's battery; left out",
                )
            values = np.where(plausible, values, np.nan)
        elif name in ("accelerometer", "gyro"):
            values = np.where(np.isfinite(values).all(axis=1, keepdims=True), values, np.nan)
        if name == "position" or (np.isfinite(values).any() and len(values) > 1):
            made[name] = Stream(stream.name, stream.t, values)
        elif name == "battery" and not np.any(values > 0.0):
            notes += (f"{stream.name}: no positive voltage; left out",)
    return made, notes


def _rows(
    path: Path, pose: Stream | None, motors: Stream, sensors: Sequence[Stream]
) -> tuple[Array, Array, Names]:
    """Return the rows' times (M,) in s, the poses (M, 7) in them, NaN where there is none, and
    notes.

    Raises:
        InputError: fewer than two rows lie within the span of the motors' stream.
    """
    sensor = sensors[0] if sensors else None
    own = sensor is not None and (
        pose is None or median_step(pose.t) > _OWN_ROWS * median_step(sensor.t) > 0.0
    )
    stream = sensor if own else pose
    assert stream is not None
    inside = (stream.t >= motors.t[0]) & (stream.t <= motors.t[-1])
    if pose is not None and own:  # the pose and the motors must meet, too
        together = (pose.t >= motors.t[0]) & (pose.t <= motors.t[-1])
        stream, inside = (pose, together) if together.sum() < 2 else (stream, inside)
    if inside.sum() < 2:
        raise InputError(
            f"{path}: {stream.name} (from {stream.t[0]:.6g} to {stream.t[-1]:.6g} s) and "
            f"{motors.name} (from {motors.t[0]:.6g} to {motors.t[-1]:.6g} s) do not overlap; "
            "expected both over the same flight"
        )
    t = stream.t[inside]
    if not own:
        assert pose is not None
        return t, pose.values[inside], ()
    rows = f"rows are those of {stream.name}, {1.0 / median_step(stream.t):.4g} Hz"
    placed = np.full((len(t), 7), np.nan)
    if pose is None:
        return t, placed, (rows,)
    seen = pose.whole()
    if len(seen.t) >= 2:
        near = np.clip(np.searchsorted(t, seen.t), 1, len(t) - 1)
        near -= seen.t - t[near - 1] < t[near] - seen.t
        reach = max(0.6 * median_step(t), 0.5 * median_step(seen.t) / _OWN_ROWS)
        near = np.unique(near[np.abs(t[near] - seen.t) <= reach])
        near = near[(t[near] >= seen.t[0]) & (t[near] <= seen.t[-1])]
        placed[near, :3] = Stream(pose.name, seen.t, seen.values[:, :3]).at(t[near])
        placed[near, 3:] = slerp(t[near], Stream(pose.name, seen.t, seen.values[:, 3:]))
    rate = 1.0 / median_step(pose.t)
    rows += f"; the pose of {pose.name}, {rate:.4g} Hz, stands in the nearest of them"
    return t, placed, (rows,)


@dataclass(frozen=True)
class MotorRates:
    """How often rotor speeds or commands must be measured.

    Between samples they are taken along a straight line: 0.9 of an oscillation's amplitude passes
    up to 0.18 of their rate. Forces are judged up to 3.5 Hz. Torques turn a vehicle within a tenth
    of a second: they need the rate of a pose and a gyro.
    """

    force_hz: float = 20.0
    torque_hz: float = 45.0
    jitter: float = 1.1  # tolerance of a rate, as a factor

    def serves(self, rate: float, least: float) -> bool:
        """Return whether a rate is high enough, Hz."""
        return rate * self.jitter >= least


MOTOR_RATES = MotorRates()


# When values repeat because nothing was measured, and not because they were rounded.
# share of the median spacing of changes: rounded values change at any spacing, held ones at
# their own
_LEAST_SPACING = 0.6
_LEAST_ROWS = 2.0  # median spacing in rows; below, each row is a sample
_EARLY = 0.05  # quantile of spacings compared with the median
# share of the RMS distance from the line between both neighbours: on the line
_ON_LINE = 1e-3
_ROUNDED = 1.001  # rounding steps by which three rounded values leave a line, at most
_MOST_CORNERS = 2 / 3  # of the rows; with more no two corners can be told apart
_LEAST_CHANGES = 8  # for a spacing


def source_rate(t: Array, values: Array) -> float:
    """Return a channel's rate of measurement, Hz; 0: less than two samples.

    Args:
        t: (N,) s, increasing.
        values: (N, K); a row with NaN is no sample.
    """
    finite = Stream("", t, values).whole()
    t, values = finite.t, finite.values
    if len(t) < 2:
        return 0.0
    changes = np.flatnonzero(np.any(np.diff(values, axis=0) != 0.0, axis=1))
    step = median_step(t)
    return 1.0 / (step * max(_spacing(changes), _spacing(_corners(t, values))))


def between_samples(t: Array, values: Array, rate: float) -> Array:
    """Return by how much a channel (N, K) leaves the line between its samples (K,), one standard
    deviation: at most as much as a sample leaves the line between its neighbours.

    Args:
        t: (N,) s, increasing.
        values: (N, K), finite, of a channel measured less often.
        rate: of the measurement, Hz.
    """
    beats = np.arange(t[0], t[-1], 1.0 / rate)
    off = 0.5 * np.diff(resampled(beats, t, values), n=2, axis=0)
    return np.sqrt(np.mean(np.square(off), axis=0)) if len(off) else np.zeros(4)


def _corners(t: Array, values: Array) -> Rows:
    """Return where values (N, K) leave the straight line between their neighbours by more than
    their rounding: the first of consecutive rows, since a sample between rows bends the line in
    both.
    """
    if len(t) < 3:
        return np.empty(0, dtype=np.intp)
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    steps = np.abs(np.diff(values, axis=0))
    rounding = np.min(steps, axis=0, where=steps > 0.0, initial=np.inf)
    off = values[2:] - values[:-2]  # in place: a copy of an hour takes 23 MB a column
    off *= share
    off += values[:-2]
    np.abs(np.subtract(values[1:-1], off, out=off), out=off)
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    is_corner = (off > np.maximum(_ON_LINE * rms, _ROUNDED * rounding)).any(axis=1)
    if np.mean(is_corner) > _MOST_CORNERS:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(is_corner & ~np.append(False, is_corner[:-1]))


def _spacing(events: Rows) -> float:
    """Return the usual number of rows between regular events; else 1."""
    spacing = np.diff(events)
    if len(spacing) < _LEAST_CHANGES:
        return 1.0
    median = np.median(spacing)
    beat = np.quantile(spacing, _EARLY) >= _LEAST_SPACING * median
    usual = spacing[spacing < median / _LEAST_SPACING]  # no gap
    return float(np.mean(usual)) if beat and median >= _LEAST_ROWS else 1.0
