"""A flight log: what was measured on a flight, in SI units and this kit's conventions.

One row a sample, time strictly increasing. Columns of the file:

=============================  =======  ==========================================================================
``t``                          s        time
``px, py, pz``                 m        position of the geometric centre, world, z up
``qw, qx, qy, qz``             1        attitude, body to world, scalar first; its sign means nothing
``omega1 ... omega4``          rad/s    turn rates: 1 front-left, 2 rear-left, 3 rear-right, 4 front-right
``vbat`` (optional)            V        battery voltage
``fx, fy, fz`` (optional)      N        true external force, world
``tx, ty, tz`` (optional)      Nm       true external torque, world; force and torque come together or not at all
=============================  =======  ==========================================================================

A row whose seven pose fields are all empty is one in which motion capture lost the vehicle. Other columns are ignored.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..dynamics.errors import InputError
from ..dynamics.vehicle import Vehicle
from .files import Table, file_kind, open_table, write_table

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

POSE = ("px", "py", "pz", "qw", "qx", "qy", "qz")
ROTORS = ("omega1", "omega2", "omega3", "omega4")
TRUTH = ("fx", "fy", "fz", "tx", "ty", "tz")
REQUIRED = ("t", *POSE, *ROTORS)

_NORM_TOLERANCE = 0.02  # of a quaternion's length
_GAP = 3.0  # median time steps


@dataclass(frozen=True, eq=False)
class FlightLog:
    """One flight, checked: times increase, numbers are finite, quaternions have length 1."""

    t: Array  # (N,) s
    position: Array  # (N, 3) m, world; NaN where the pose is missing
    quaternion: Array  # (N, 4) body to world, scalar first; NaN where the pose is missing
    rotor_speeds: Array  # (N, 4) rad/s
    voltage: Array | None = None  # (N,) V
    force: Array | None = None  # (N, 3) N, world, truth
    torque: Array | None = None  # (N, 3) Nm, world, truth
    name: str = ""
    source: str = ""  # the file and the reader
    notes: tuple[str, ...] = ()  # gaps, doubts about units, and the thrust model where turn rates were not measured
    valid: Mask = field(default_factory=lambda: np.empty(0, dtype=np.bool_))  # (N,) the pose is there
    extra: Mapping[str, Array] = field(default_factory=dict)  # (N,) or (N, ...) SI; what a reader found besides
    commanded: bool = False  # turn rates are worked out from commands: scale of thrust unknown, moments not to be trusted

    def __post_init__(self) -> None:
        if len(self.valid) != len(self.t):
            object.__setattr__(self, "valid", np.isfinite(self.position).all(axis=1))

    @property
    def period(self) -> float:
        """Median time step, s."""
        return float(np.median(np.diff(self.t)))


def read_log(path: str | Path, reader: str | None = None, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a flight log.

    Args:
        path: ``.csv``, ``.csv.gz`` or ``.parquet``.
        reader: name of a reader in ``identification/readers/`` for a log of another form, with that reader's option
            behind a colon where it takes one (``rosbag:topics.yaml``); None for the kit's own.
        vehicle: the vehicle that flew, for checking units and, in a reader, for turning thrust into turn rates.

    Raises:
        InputError: the file cannot be read or breaks a rule of the form; the message says where and what was expected.

    Warns:
        UserWarning: numbers look as if they were in other units. The same text is in the log's notes.
    """
    from .readers import READERS, find_reader  # readers build flight logs, so they import this file

    path = Path(path)
    if reader is not None:
        with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are refused for what they are
            log = find_reader(reader).read(path, vehicle)
    else:
        for other in READERS.values():
            if path.name.lower().endswith(other.suffixes):
                raise InputError(f"{path}: expected --reader {other.name} (reader={other.name!r}) with a file of this kind")
        if path.is_dir():
            raise InputError(f"{path}: is a folder; expected a file, or --reader rosbag with the folder of a ROS 2 bag")
        table = open_table(path)
        missing = [name for name in REQUIRED if name not in table.header]
        if missing:
            for other in READERS.values():
                if other.signature and set(other.signature) <= set(table.header):
                    raise InputError(f"{path}: this is a {other.name} log; expected --reader {other.name} "
                                     f"(reader={other.name!r}) with it")
            raise InputError(f"{path}: missing column(s) {', '.join(missing)}; expected {', '.join(REQUIRED)}, "
                             f"found {', '.join(table.header[:20])}")
        with np.errstate(over="ignore", invalid="ignore"):
            log = _canonical(table)
    return _with_doubts(log, vehicle)


def _canonical(table: Table) -> FlightLog:
    path = table.path
    truth = [name for name in TRUTH if name in table.header]
    if truth and len(truth) < len(TRUTH):
        absent = [name for name in TRUTH if name not in truth]
        raise InputError(f"{path}: missing column(s) {', '.join(absent)}; expected all of {', '.join(TRUTH)} or none")
    names = [*REQUIRED, *(["vbat"] if "vbat" in table.header else []), *truth]
    columns = table.read(names)

    pose = np.column_stack([columns[name] for name in POSE])
    lost: Mask = np.all(np.isnan(pose), axis=1)
    for name in names:
        check_finite(table, name, columns[name], ~lost if name in POSE else None)
    check_times(table, columns["t"])
    quaternion = unit_quaternions(table, pose[:, 3:], ~lost, "qw, qx, qy, qz")
    rotor_speeds = np.column_stack([columns[name] for name in ROTORS])
    for name in (*ROTORS, *(["vbat"] if "vbat" in names else [])):
        low = np.flatnonzero(columns[name] < 0)
        if low.size:
            expected = "a voltage of" if name == "vbat" else "a turn rate (its sense is the vehicle's spin) of"
            raise InputError(f"{path}: column {name}, {table.row(low[0])}: {columns[name][low[0]]:g} is negative; "
                             f"expected {expected} at least 0")
    return FlightLog(
        t=columns["t"],
        position=pose[:, :3].copy(),
        quaternion=quaternion,
        rotor_speeds=rotor_speeds,
        voltage=columns.get("vbat"),
        force=np.column_stack([columns[name] for name in TRUTH[:3]]) if truth else None,
        torque=np.column_stack([columns[name] for name in TRUTH[3:]]) if truth else None,
        name=log_name(path),
        source=str(path),
        notes=(*time_notes(columns["t"]), *_pose_notes(columns["t"], lost)),
        valid=~lost,
    )


def log_name(path: Path) -> str:
    """Return the file's name without its ending."""
    return path.name[: -len(file_kind(path))]


def check_finite(table: Table, name: str, column: Array, where: Mask | None = None) -> None:
    """Raise InputError at the first number of a column (N,) that is not finite; ``where`` limits the rows."""
    bad = ~np.isfinite(column) if where is None else ~np.isfinite(column) & where
    if bad.any():
        i = int(np.flatnonzero(bad)[0])
        found = "empty or NaN" if np.isnan(column[i]) else "infinite"
        more = "; only all seven pose columns together may be empty (pose lost)" if name in POSE else ""
        raise InputError(f"{table.path}: column {name}, {table.row(i)} is {found}; expected a finite number{more}")


def check_times(table: Table, t: Array) -> None:
    """Raise InputError where times (N,) in s do not strictly increase, or are fewer than two."""
    if len(t) < 2:
        raise InputError(f"{table.path}: only one row; expected at least two")
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        i = int(back[0]) + 1
        what = "repeats the time" if t[i] == t[i - 1] else "goes back from"
        raise InputError(f"{table.path}: column t, {table.row(i)}: {t[i]:.9g} s {what} {t[i - 1]:.9g} s of the row "
                         "before; expected strictly increasing times")


def unit_quaternions(table: Table, quaternions: Array, where: Mask, columns: str) -> Array:
    """Return quaternions (N, 4) at length 1, after checking that they nearly were in the rows ``where`` (N,).

    Raises:
        InputError: a length differs from 1 by more than 0.02.
    """
    length = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(where & ~(np.abs(length - 1.0) <= _NORM_TOLERANCE))
    if bad.size:
        raise InputError(f"{table.path}: columns {columns}, {table.row(bad[0])}: a quaternion of length "
                         f"{length[bad[0]]:.4g}; expected 1 within {_NORM_TOLERANCE:g}")
    unit: Array = quaternions / length[:, None]
    return unit


def time_notes(t: Array) -> tuple[str, ...]:
    """Return a note on the gaps in times (N,) in s: steps of more than 3 median ones."""
    step = np.diff(t)
    gaps = np.flatnonzero(step > _GAP * np.median(step))
    if not gaps.size:
        return ()
    longest = gaps[np.argmax(step[gaps])]
    return (f"{gaps.size} gap(s) in time; the longest is {step[longest]:.3g} s, at t = {t[longest]:.6g} s "
            f"(median step {np.median(step):.4g} s)",)


def _pose_notes(t: Array, lost: Mask) -> tuple[str, ...]:
    if not lost.any():
        return ()
    return (f"{int(lost.sum())} of {len(t)} rows without a pose (motion capture lost the vehicle), the first at "
            f"t = {t[np.flatnonzero(lost)[0]]:.6g} s",)


def _with_doubts(log: FlightLog, vehicle: Vehicle | None) -> FlightLog:
    """Warn where numbers look as if they were in other units, and add the warnings to the notes."""
    doubts = []
    if log.period > 0.5:
        doubts.append(f"the median time step is {log.period:g} s: is t in milliseconds? Expected seconds")
    if log.valid.any():
        spread = float(np.max(np.ptp(log.position[log.valid], axis=0)))
        if spread > 300.0:
            doubts.append(f"positions spread over {spread:.0f} m: are px, py, pz in millimetres? Expected metres")
    if vehicle is not None:
        with np.errstate(over="ignore"):
            thrust = np.square(log.rotor_speeds) @ vehicle.k / vehicle.weight
        turning = thrust[log.rotor_speeds.max(axis=1) > 0.0]
        ratio = float(np.median(turning)) if turning.size else 1.0
        if ratio > 10.0:
            doubts.append(f"the turn rates make a median thrust of {ratio:.0f} times the weight of {vehicle.name}: "
                          "are omega1..omega4 in rpm? Expected rad/s")
        elif ratio < 0.1:
            doubts.append(f"the turn rates make a median thrust of {ratio:.2g} times the weight of {vehicle.name}: "
                          "are omega1..omega4 in revolutions per second? Expected rad/s")
    if not doubts:
        return log
    for doubt in doubts:
        warnings.warn(f"{log.source}: {doubt}", UserWarning, stacklevel=3)
    return replace(log, notes=(*log.notes, *(f"warning: {doubt}" for doubt in doubts)))


def with_rows(log: FlightLog, keep: Mask) -> FlightLog:
    """Return a log with the rows (N,) that are to be kept alone; the log itself where that is all of them."""
    if keep.all():
        return log

    def cut(x: Array | None) -> Array | None:
        return None if x is None else x[keep]

    return replace(log, t=log.t[keep], position=log.position[keep], quaternion=log.quaternion[keep],
                   rotor_speeds=log.rotor_speeds[keep], voltage=cut(log.voltage), force=cut(log.force), torque=cut(log.torque),
                   valid=log.valid[keep], extra={name: x[keep] for name, x in log.extra.items()})


def write_log(log: FlightLog, path: str | Path) -> None:
    """Write a log in the kit's own form to a ``.csv``, ``.csv.gz`` or ``.parquet`` file, whole or not at all.

    Raises:
        InputError: the name's ending is unknown or the file cannot be written.
    """
    columns = {"t": log.t}
    pose = np.where(log.valid[:, None], np.column_stack([log.position, log.quaternion]), np.nan)
    columns |= {name: pose[:, i] for i, name in enumerate(POSE)}
    columns |= {name: log.rotor_speeds[:, i] for i, name in enumerate(ROTORS)}
    if log.voltage is not None:
        columns["vbat"] = log.voltage
    if log.force is not None and log.torque is not None:
        truth = np.column_stack([log.force, log.torque])
        columns |= {name: truth[:, i] for i, name in enumerate(TRUTH)}
    write_table(columns, Path(path))
