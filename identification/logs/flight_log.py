"""A flight log: the measurements of a flight, in SI units and this kit's conventions.

One row a sample, time strictly increasing. Columns of the file:

| column                       | unit  | meaning                                                                   | |
---------------------------- | ----- | ------------------------------------------------------------------------- | | ``t``
| s     | time                                                                      | | ``px, py, pz``               | m     |
position of the geometric centre, world, z up                             | | ``qw, qx, qy, qz``           | 1     | attitude,
body to world, scalar first; its sign means nothing             | | ``omega1 ... omega4``        | rad/s | rotor speeds: 1
front-left, 2 rear-left, 3 rear-right, 4 front-right      | | ``vbat`` (optional)          | V     | battery voltage
| | ``fx, fy, fz`` (optional)    | N     | true external force, world                                                | | ``tx, ty,
tz`` (optional)    | Nm    | true external torque, world; force and torque come together or not at all | | ``ax, ay, az``
(optional)    | m/s2  | accelerometer at the centre: specific force, body; +g along z in a hover  | | ``gx, gy, gz`` (optional)
| rad/s | gyro: angular velocity, body                                              | | ``cmd1 ... cmd4`` (optional) | 1     |
motor commands, 0 to 1, in the rotors' order                              | | ``vehicle=NAME`` (optional)  | 1     | 1 in every
row: vehicle's name, in the column's own name     |

A row with all seven pose fields empty lies between two poses, or motion capture lost the vehicle in that row. With accelerometer
and gyro, the pose's columns may be left out, or the quaternion's alone. With motor commands, the rotor speeds may be left out. In
a row with an inertial sensor's three fields empty, the sensor was not read: a sensor faster than the pose has rows of its own.
Other columns are ignored. The vehicle's name stands in a header, so the table holds numbers alone.
"""  # noqa: E501

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from math import inf, nan
from pathlib import Path

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...dynamics.vehicle_file import load_vehicle, preset_names
from ..motion.smoothing import mean_square, resampled
from .table import (
    Array,
    ArrayMap,
    Data,
    Mask,
    NamedArrays,
    Names,
    Rows,
    SomeArray,
    Values,
    finite_rows,
    median_step,
)
from .tables import write_table
from .what_flew import UNSTATED, WhatFlew

POSE = ("px", "py", "pz", "qw", "qx", "qy", "qz")
ROTORS = ("omega1", "omega2", "omega3", "omega4")
TRUTH = ("fx", "fy", "fz", "tx", "ty", "tz")
ACCELEROMETER = ("ax", "ay", "az")
GYRO = ("gx", "gy", "gz")
IMU = (*ACCELEROMETER, *GYRO)
COMMANDS = ("cmd1", "cmd2", "cmd3", "cmd4")

VEHICLE = re.compile(r"vehicle=([A-Za-z0-9][A-Za-z0-9_.+ -]{0,63})")  # a column's name

NORM_TOLERANCE = 0.02  # tolerance of a quaternion's length


@dataclass(frozen=True, eq=False)
class FlightLog:
    """One flight, checked: times increase, numbers are finite, quaternions have length 1.

    An inertial sensor's row with some axes missing counts as not read.

    Attributes:
        t: (N,) s.
        position: (N, 3) m, world; NaN where the pose is missing.
        quaternion: (N, 4) body to world, scalar first; NaN where the pose is missing.
        rotor_speeds: (N, 4) rad/s; NaN in every row of a log with commands and without a thrust
            model.
        voltage: (N,) V.
        force: (N, 3) N, world, truth.
        torque: (N, 3) Nm, world, truth.
        accelerometer: (N, 3) m/s2, body: specific force, +g along z in a hover; NaN rows: not
            measured.
        gyro: (N, 3) rad/s, body; NaN rows: not measured.
        name: the log's name in messages.
        source: the file and the reader.
        notes: gaps, doubts about units, and the thrust model where rotor speeds were not measured.
        valid: (N,) the pose is there.
        extra: (N,) or (N, ...) SI; further channels of a reader.
        commanded: rotor speeds are computed from commands: scale of thrust unknown, moments not to
            be trusted.
        command: (N, 4) motor commands, 0 to 1, in the rotors' order.
        vehicle: the vehicle's name, where the log or its reader knows one.
        rates: Hz, the rate of measurement of each channel (``source_rate``), by its section of a
            log map: position, rotors, commands, wrench, battery, accelerometer, gyro. Channels
            without a rate were measured in every row.
        flown: the log's statements on its vehicle.
    """

    t: Array
    position: Array
    quaternion: Array
    rotor_speeds: Array
    voltage: SomeArray = None
    force: SomeArray = None
    torque: SomeArray = None
    accelerometer: SomeArray = None
    gyro: SomeArray = None
    name: str = ""
    source: str = ""
    notes: Names = ()
    valid: Mask = field(default_factory=lambda: np.empty(0, bool))
    extra: ArrayMap = field(default_factory=dict)
    commanded: bool = False
    command: SomeArray = None
    vehicle: str = ""
    rates: Values = field(default_factory=dict)
    flown: WhatFlew = UNSTATED

    def __post_init__(self) -> None:
        if len(self.valid) != len(self.t):
            there = finite_rows(self.position) & finite_rows(self.quaternion)
            object.__setattr__(self, "valid", there)
        for name in ("accelerometer", "gyro"):
            x = getattr(self, name)
            if x is not None and not (read := finite_rows(x)).all():
                object.__setattr__(self, name, np.where(read[:, None], x, nan))

    def __repr__(self) -> str:
        t = self.t
        times = f", {t[0]:.3g} to {t[-1]:.3g} s" if len(t) else ""
        whose = f", of {self.vehicle}" if self.vehicle else ""
        return f"<FlightLog {self.name or 'without a name'}: {len(t)} samples{times}{whose}>"

    @property
    def has_pose(self) -> bool:
        """Has the log any pose?"""
        return bool(self.valid.any())

    @property
    def has_rotor_speeds(self) -> bool:
        """Are rotor speeds known, measured or computed from commands?"""
        return bool(np.isfinite(self.rotor_speeds).all())

    @property
    def motor_rate(self) -> float:
        """Rate of measured rotor speeds, else of commands, Hz."""
        names = ("rotors", "commands", "wrench")[self.commanded :]
        return next((self.rates[name] for name in names if name in self.rates), inf)

    @property
    def period(self) -> float:
        """Median time step, s."""
        return median_step(self.t)


Logs = Sequence[FlightLog]
SomeVehicle = Vehicle | None  # None: unknown
NotedLog = tuple[FlightLog, Names]  # with doubts


def flown_vehicle(vehicle: SomeVehicle, name: str) -> SomeVehicle:
    """Return the vehicle, or else the preset of a log's vehicle name; None: there is none."""
    return _preset(name) if vehicle is None and name in preset_names() else vehicle


_preset = cache(load_vehicle)  # asked three times a log


def time_notes(t: Array) -> Names:
    """Return a note on the gaps in times (N,) in s: steps of more than 3 median ones."""
    step = np.diff(t)
    usual = np.median(step) if step.size else inf
    gaps = (step > 3.0 * usual).sum()
    if not gaps:
        return ()
    longest = step.argmax()
    return (
        f"{gaps} gap(s) in time; the longest is {step[longest]:.3g} s, at t = {t[longest]:.6g} s "
        f"(median step {usual:.4g} s)",
    )


# How often rotor speeds or commands must be measured, Hz. Between samples they are taken along a
# straight line: 0.9 of an oscillation's amplitude passes up to 0.18 of their rate. Forces are
# judged up to 3.5 Hz. Torques turn a vehicle within a tenth of a second: they need the rate of a
# pose and a gyro.
FORCE_HZ, TORQUE_HZ = 20.0, 45.0


def serves(rate: float, least: float) -> bool:
    """Return whether a rate is high enough, Hz."""
    return 1.1 * rate >= least  # a rate jitters


# When values repeat because nothing was measured, and not because they were rounded.
# share of the median spacing of changes: rounded values change at any spacing, held ones at
# their own
_LEAST_SPACING = 0.6
_MOST_ROWS = 100_000  # from the middle of a long flight


def source_rate(t: Array, values: Array) -> float:
    """Return a channel's rate of measurement, Hz; 0: less than two samples. The middle tells for a
    long flight.

    Args:
        t: (N,) s, increasing.
        values: (N, K); a row with NaN is no sample.
    """
    middle = slice(max(0, len(t) - _MOST_ROWS) // 2, (len(t) + _MOST_ROWS) // 2)
    finite = finite_rows(values[middle])
    t, values = t[middle][finite], values[middle][finite]
    if len(t) < 2:
        return 0.0
    changes = np.flatnonzero(np.diff(values, axis=0).any(axis=1))
    return 1.0 / (median_step(t) * max(_spacing(changes), _spacing(_corners(t, values))))


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
    return np.sqrt(mean_square(off)) if len(off) else np.zeros(4)


def _corners(t: Array, values: Array) -> Rows:
    """Return where values (N, K) leave the straight line between their neighbours by more than
    their rounding: the first of consecutive rows, since a sample between rows bends the line in
    both.
    """
    if len(t) < 3:
        return np.empty(0, np.intp)
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    steps = abs(np.diff(values, axis=0))
    rounding = steps.min(axis=0, where=steps > 0.0, initial=inf)
    line = values[:-2] + share * (values[2:] - values[:-2])
    off = abs(values[1:-1] - line)
    # three rounded values leave a line by at most one rounding step
    least = np.maximum(1e-3 * np.sqrt(mean_square(off)), 1.001 * rounding)
    is_corner = (off > least).any(axis=1)
    if is_corner.mean() > 2 / 3:  # no two corners can be told apart
        return np.empty(0, np.intp)
    return np.flatnonzero(is_corner & ~np.append(False, is_corner[:-1]))


def _spacing(events: Rows) -> float:
    """Return the usual number of rows between regular events; else 1."""
    spacing = np.diff(events)
    if len(spacing) < 8:
        return 1.0
    median = np.median(spacing)
    beat = np.quantile(spacing, 0.05) >= _LEAST_SPACING * median
    usual = spacing[spacing < median / _LEAST_SPACING]  # no gap
    # with a spacing of less than two rows each row is a sample
    return float(usual.mean()) if beat and median >= 2.0 else 1.0


def with_rows(log: FlightLog, keep: Mask) -> FlightLog:
    """Return a log with the rows ``keep`` (N,); the log itself where all are kept."""
    if keep.all():
        return log
    parts: Data = {name: x[keep] for name, x in vars(log).items() if isinstance(x, np.ndarray)}
    return replace(log, **parts, extra={name: x[keep] for name, x in log.extra.items()})


LONGEST = 480.0  # s of flight, all logs together, used whole
_WINDOW = 60.0  # s, a window of longer flights


def excerpt(log: FlightLog, seconds: float = 0.0) -> FlightLog:
    """Return a log, or windows of a minute spread evenly over a flight of more than ``LONGEST``.
    They give the same diagnosis as a whole hour, in a tenth of the memory. A note says so.

    Args:
        log: the flight; the rest becomes a gap.
        seconds: s, of all logs used together.
    """
    length = log.t[-1] - log.t[0]
    share = LONGEST / max(seconds, length, LONGEST)
    if share == 1.0 or length <= _WINDOW:
        return log
    count, spare = max(1, round(share * length / _WINDOW)), length - _WINDOW
    begins = log.t[0] + np.linspace(0.0 if count > 1 else 0.5 * spare, spare, count)
    keep = np.any([(log.t >= at) & (log.t <= at + _WINDOW) for at in begins], axis=0)
    note = (
        f"of {length:.0f} s, {count} windows of {_WINDOW:.0f} s, evenly spaced, were used; the "
        "rest was left out"
    )
    return replace(with_rows(log, keep), notes=(*log.notes, note))


def parts_of(log: FlightLog) -> list[tuple[Names, Array]]:
    """Return a log's channels (N, k), with their columns' names in a file."""
    command, force, torque, pose = log.command, log.force, log.torque, log.position
    is_whole = log.has_pose or log.accelerometer is None or log.gyro is None
    if is_whole:
        pose = np.column_stack([pose, log.quaternion])
        pose[~log.valid] = nan
    parts: list[tuple[Names, SomeArray]] = [
        (("t",), log.t),
        (POSE[: pose.shape[1]], pose if is_whole or np.isfinite(pose).any() else None),
        (ROTORS, log.rotor_speeds if log.has_rotor_speeds or command is None else None),
        (COMMANDS, command),
        (("vbat",), log.voltage),
        (TRUTH, None if force is None or torque is None else np.column_stack([force, torque])),
        (ACCELEROMETER, log.accelerometer),
        (GYRO, log.gyro),
    ]
    return [(names, values) for names, values in parts if values is not None]


def write_log(log: FlightLog, path: str | Path) -> None:
    """Write a log in the kit's own form to a ``.csv``, ``.csv.gz`` or ``.parquet`` file, whole or
    not at all.

    Raises:
        InputError: the name's ending is unknown or the file cannot be written.
    """
    columns: NamedArrays = {}
    for names, values in parts_of(log):
        columns |= zip(names, values.reshape(len(log.t), -1).T, strict=True)
    if VEHICLE.fullmatch(named := f"vehicle={log.vehicle}"):
        columns[named] = np.ones(len(log.t))
    write_table(columns, Path(path))
