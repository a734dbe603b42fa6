"""From a table of any columns and a map of what they mean to a flight log.

**Rows.** Where every channel has a value in every row, those are the log's rows. In a table of
several rates, whose fields are empty where a channel has no sample, the rows of the pose and of the
inertial sensors are kept; rotor speeds, commands and voltage are interpolated to them, and so is an
attitude that is logged in other rows than the position. Rows of one time are one row. The log
begins with the first sample of the rotors and ends with the last.

**Frames.** With W from the table's world and B from its body axes to this kit's, positions become
W p, attitudes W R B' and what a sensor measures B v.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from ...dynamics.vehicle import Vehicle
from ...dynamics.vehicle_file import load_vehicle, preset_names
from ...runtime.errors import InputError
from .commanded_speeds import with_commanded_speeds
from .flight_log import FlightLog, Mask, check_times, time_notes, unit_quaternions
from .layout_guess import FoundLayout, open_any_table, stem
from .log_map import (
    ACCELERATION_UNITS,
    ANGLE_UNITS,
    LENGTH_UNITS,
    RATE_UNITS,
    ROTOR_UNITS,
    TIME_UNITS,
    VOLTAGE_UNITS,
    Attitude,
    Columns,
    Commands,
    LogMap,
    Sensor,
)
from .rotor_orders import order_names, order_words
from .sample_gaps import GAPS, bridged
from .table import Table

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

_HALF_TURN = np.diag([1.0, -1.0, -1.0])
# from the table's world, or its body axes, to the kit's
WORLD_TURNS: dict[str, Array] = {
    "enu": np.eye(3),
    "ned": _HALF_TURN,
    "y_up": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
BODY_TURNS: dict[str, Array] = {"flu": np.eye(3), "frd": _HALF_TURN}

_SHOWN = 30  # columns that an error lists
_ATTITUDE_GAP = 0.1  # s, across which an attitude is not interpolated
_OUTSIDE = 0.5  # share of commands beyond their range from which on the range is wrong
_SPECIFIC_FORCE = 6.0, 16.0  # m/s2: a flight's median is within; outside a scale is wrong
_NO_QUATERNION = 0.5  # length; shorter stands for one that is not there


@dataclass(frozen=True, eq=False)
class _Samples:
    """What was read of a table: rows in the order of time, no two of one time."""

    table: Table
    t: Array  # (N,) s
    columns: Mapping[str, Array]  # by name (N,); NaN where there is no value
    rows: Rows  # (N,) of the table, of the last of each time

    def values(self, part: Columns) -> Array:
        """Return a section's columns (N, k), with their signs and scale."""
        found = np.column_stack([self.column(name) for name in part.columns])
        if part.signs:
            found = found * np.array(part.signs, dtype=np.float64)
        return found * part.scale

    def column(self, name: str) -> Array:
        """Return a column (N,), or the constant that ``=0`` stands for."""
        if (constant := _constant(name)) is not None:
            return np.full(len(self.t), constant)
        return self.columns[name]


def read_mapped(path: Path, log_map: LogMap, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a table of any layout by a map.

    Args:
        path: CSV or any other text table, packed or not, or Parquet.
        log_map: what its columns mean.
        vehicle: that flew, to turn commands into rotor speeds; None: the map's, where that comes
            with the kit.

    Raises:
        InputError: the table cannot be read, the map does not fit it, or a number is none that a
            flight has; the message says which column and row.
    """
    table, found = open_any_table(path)
    return map_table(table, found, log_map, vehicle)


def map_table(
    table: Table, found: FoundLayout, log_map: LogMap, vehicle: Vehicle | None = None
) -> FlightLog:
    """Return the flight log that a map makes of a table; as ``read_mapped``."""
    if vehicle is None and log_map.vehicle in preset_names():
        vehicle = load_vehicle(log_map.vehicle)
    log_map = _fitted(table, log_map, vehicle)
    notes = [f"columns: by the map {log_map.name}", *table.notes]
    if found.words and found.words != "fields separated by comma":
        notes.append(f"layout: {found.words}")
    samples, time_words = _samples(table, log_map)
    notes += time_words
    valid, position, quaternion, pose_notes = _pose(samples, log_map)
    sensors = {
        name: _sensor(samples, getattr(log_map, name), units, log_map.body)
        for name, units in (("accelerometer", ACCELERATION_UNITS), ("gyro", RATE_UNITS))
    }
    keep, row_notes = _kept_rows(samples, log_map, valid, sensors)
    speeds, command, voltage, motor_notes = _motors(samples, log_map, keep)
    notes += [*pose_notes, *row_notes, *motor_notes]
    t = samples.t[keep]
    check_times(table, t)
    if log_map.time.offset is None:
        t = t - t[0]
    truth = {
        name: _truth(samples, getattr(log_map, name), log_map, keep) for name in ("force", "torque")
    }
    log = FlightLog(
        t=t,
        position=position[keep],
        quaternion=quaternion[keep],
        rotor_speeds=speeds,
        command=command,
        voltage=voltage,
        accelerometer=_cut(sensors["accelerometer"], keep),
        gyro=_cut(sensors["gyro"], keep),
        force=truth["force"],
        torque=truth["torque"],
        name=stem(table.path),
        source=str(table.path),
        notes=(*notes, *_gap_notes(t, valid[keep], sensors)),
        valid=valid[keep],
        vehicle=log_map.vehicle,
    )
    if log.accelerometer is not None:
        size = float(np.nanmedian(np.linalg.norm(log.accelerometer, axis=1)))
        if not _SPECIFIC_FORCE[0] <= size <= _SPECIFIC_FORCE[1]:
            text = (
                f"warning: the accelerometer's median size is {size:.3g} m/s2; expected about 9.8 "
                "in flight: check its unit and scale in the map"
            )
            log = replace(log, notes=(*log.notes, text))
    factor = log_map.commands.thrust_factor if log_map.commands else 1.0
    return with_commanded_speeds(log, vehicle, factor)


def _cut(values: Array | None, keep: Mask) -> Array | None:
    if values is None or not np.isfinite(values[keep]).any():
        return None
    return values[keep]


def _gap_notes(t: Array, valid: Mask, sensors: Mapping[str, Array | None]) -> tuple[str, ...]:
    notes = time_notes(t)
    if not valid.any() or valid.all():
        return notes
    if any(values is not None for values in sensors.values()):
        return notes + tuple(f"of the pose: {text}" for text in time_notes(t[valid]))
    return (*notes, f"{int(np.sum(~valid))} of {len(t)} rows without a pose")


def _constant(name: str) -> float | None:
    """Return the constant that a column's name stands for, such as ``=0``."""
    if not name.startswith("="):
        return None
    try:
        return float(name[1:])
    except ValueError:
        return None


def _wanted(part: Columns) -> list[str]:
    return [name for name in part.columns if _constant(name) is None]


def _fitted(table: Table, log_map: LogMap, vehicle: Vehicle | None) -> LogMap:
    """Return a map without the optional sections that a table lacks, and with the range of its
    commands.

    Raises:
        InputError: it does not fit the table.
    """
    header = set(table.header)
    absent: dict[str, Any] = {
        name: None
        for name, part in log_map.sections.items()
        if part.optional and not header & set(_wanted(part))
    }
    log_map = replace(log_map, **absent)
    where = f"{table.path}: map {log_map.name}"
    missing = [
        (name, section)
        for section, part in log_map.sections.items()
        for name in _wanted(part)
        if name not in header
    ]
    if log_map.time.column and log_map.time.column not in header:
        missing.insert(0, (log_map.time.column, "time"))
    if missing:
        raise InputError(f"{where} does not fit: {_missing_words(missing, table.header)}")
    repeated = {name for name, count in Counter(table.header).items() if count > 1}
    for section, part in log_map.sections.items():
        for name in part.columns:
            if name in repeated:
                raise InputError(
                    f"{where}: {section}: column {name!r} stands in the table more than once; "
                    "expected it once"
                )
    if not (log_map.rotors or log_map.commands):
        raise InputError(f"{where} does not fit: no columns of rotors or of commands")
    has_imu = log_map.accelerometer is not None and log_map.gyro is not None
    if not (log_map.position and log_map.attitude) and not has_imu:
        raise InputError(f"{where} does not fit: no columns of a pose or of an IMU")
    commands = log_map.commands
    if commands is not None and commands.range is None:
        curve = vehicle.motor_curve if vehicle is not None else None
        if curve is None:
            raise InputError(
                f"{where}: commands: unit counts without a range; expected what stands for no and "
                "for full command, such as range: [0, 65535], or a vehicle whose motor_curve "
                "states it"
            )
        log_map = replace(log_map, commands=replace(commands, range=curve.command))
    return log_map


def _missing_words(missing: list[tuple[str, str]], header: tuple[str, ...]) -> str:
    lower = {name.lower(): name for name in header}
    parts = []
    for name, section in missing[:8]:
        near = get_close_matches(name.lower(), lower, n=2, cutoff=0.6)
        hint = f" (like {' or '.join(lower[x] for x in near)})" if near else ""
        parts.append(f"{name!r} of {section}{hint}")
    more = f" and {len(missing) - 8} more" if len(missing) > 8 else ""
    found = ", ".join(header[:_SHOWN]) + (", ..." if len(header) > _SHOWN else "")
    return f"no column {', '.join(parts)}{more}; found {found}"


def _samples(table: Table, log_map: LogMap) -> tuple[_Samples, list[str]]:
    """Return what the map's columns hold, in the order of time."""
    names = [name for part in log_map.sections.values() for name in _wanted(part)]
    clock = log_map.time
    columns = table.read(list(dict.fromkeys([*names, *([clock.column] if clock.column else [])])))
    notes = []
    repeated = [name for name, count in Counter(table.header).items() if count > 1]
    if repeated:
        notes.append(f"columns that stand there more than once were not used: {repeated[:10]}")
    if not clock.column:
        t = np.arange(table.rows) / clock.rate_hz
        notes.append(f"time: rows at {clock.rate_hz:g} Hz, as the map says")
        return _Samples(table, t + (clock.offset or 0.0), columns, np.arange(table.rows)), notes
    raw = columns[clock.column]
    rows: Rows = np.flatnonzero(np.isfinite(raw))
    if len(rows) < len(raw):
        notes.append(f"{len(raw) - len(rows)} row(s) without a time were left out")
    if len(rows) < 2:
        raise InputError(
            f"{table.path}: column {clock.column}: {len(rows)} time(s); expected at least two"
        )
    raw = raw[rows]
    back = np.flatnonzero(np.diff(raw) < 0.0)
    if back.size:
        i = int(back[0])
        raise InputError(
            f"{table.path}: column {clock.column}, {table.row(int(rows[i + 1]))}: {raw[i + 1]:.9g} "
            f"goes back from {raw[i]:.9g} of the row before; expected increasing times"
        )
    begin = raw[0] if clock.offset is None else 0.0
    t = (raw - begin) * TIME_UNITS[clock.unit] + (clock.offset or 0.0)
    columns = {name: column[rows] for name, column in columns.items()}
    if not np.all(np.isfinite(t)) or np.any((np.diff(t) <= 0.0) & (np.diff(raw) > 0.0)):
        raise InputError(
            f"{table.path}: column {clock.column}: times of {raw[0]:.6g} to {raw[-1]:.6g} "
            f"{clock.unit} cannot be told apart; expected those of one flight"
        )
    first = np.flatnonzero(np.diff(raw, prepend=np.nan) != 0.0)
    if len(first) < len(t):
        notes.append(f"{len(t) - len(first)} row(s) repeat a time and were joined to the one row")
        columns = {name: _last_of(column, first) for name, column in columns.items()}
        last = np.append(first[1:], len(t)) - 1
        t, rows = t[first], rows[last]
    return _Samples(table, t, columns, rows), notes


def _last_of(column: Array, first: Rows) -> Array:
    """Return the last value that is there of each group of rows, which begin at ``first``."""
    at = np.where(np.isnan(column), -1, np.arange(len(column)))
    last = np.maximum.reduceat(at, first)
    return np.where(last >= 0, column[last], np.nan)


def _pose(samples: _Samples, log_map: LogMap) -> tuple[Mask, Array, Array, list[str]]:
    """Return which rows have a pose (N,), positions (N, 3) in m and attitudes (N, 4) in the kit's
    frames, and notes.
    """
    count = len(samples.t)
    if log_map.position is None or log_map.attitude is None:
        nothing = np.full((count, 7), np.nan)
        return np.zeros(count, bool), nothing[:, :3], nothing[:, 3:], ["no pose in the table"]
    world, body = WORLD_TURNS[log_map.world], BODY_TURNS[log_map.body]
    position = samples.values(log_map.position) * LENGTH_UNITS[log_map.position.unit]
    placed: Mask = np.all(np.isfinite(position), axis=1)
    attitude = _attitude(samples, log_map.attitude)
    turned: Mask = np.all(np.isfinite(attitude), axis=1)
    notes = []
    table = samples.table
    for name, mask in (("position", placed), ("attitude", turned)):
        if not mask.any():
            raise InputError(
                f"{table.path}: map {log_map.name}: {name}: no row has all of "
                f"{', '.join(getattr(log_map, name).columns)}; expected some"
            )
    both = placed & turned
    if (alone := int(np.sum(placed & ~turned))) > 0:  # logged in rows of their own, or lost
        attitude = _slerp(samples.t, attitude, turned, placed)
        both = placed & np.isfinite(attitude).all(axis=1)
        notes.append(
            f"{alone} of {int(placed.sum())} positions stand in rows without an attitude, which "
            "was interpolated to their times where it has samples close by"
        )
        if not both.any():
            raise InputError(
                f"{table.path}: position and attitude do not overlap in time; expected both over "
                "the same flight"
            )
    unit = np.full((count, 4), np.nan)
    turns = Rotation.from_matrix(
        world @ Rotation.from_quat(attitude[both], scalar_first=True).as_matrix() @ body.T
    )
    unit[both] = turns.as_quat(scalar_first=True)
    position = np.where(both[:, None], position @ world.T, np.nan)
    for name in log_map.attitude.columns:
        if _constant(name) is not None:
            notes.append(
                f"warning: an angle of the attitude is not in the table and is taken as "
                f"{name[1:]}: forces along the axis that it tilts are wrong by as much"
            )
    return both, position, unit, notes


def _attitude(samples: _Samples, part: Attitude) -> Array:
    """Return attitudes (N, 4), body to world in the table's frames, scalar first; NaN where there
    is none.
    """
    values = samples.values(part)
    out = np.full((len(values), 4), np.nan)
    if part.euler:
        good = np.isfinite(values).all(axis=1)
        angles = values[good] * ANGLE_UNITS[part.unit]
        about = {"x": 0, "y": 1, "z": 2}
        order = [about[axis] for axis in part.euler]
        turn = Rotation.from_euler(part.euler.upper(), angles[:, order])
        out[good] = turn.as_quat(scalar_first=True)
    else:
        if part.order == "xyzw":
            values = values[:, [3, 0, 1, 2]]
        good = np.isfinite(values).all(axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            good &= np.linalg.norm(values, axis=1) > _NO_QUATERNION
        names = ", ".join(part.columns)
        out[good] = unit_quaternions(samples.table, values, good, names)[good]
    if part.sense == "world_to_body":
        out[:, 1:] *= -1.0
    return out


def _slerp(t: Array, attitude: Array, there: Mask, wanted: Mask) -> Array:
    """Return attitudes (N, 4) at the rows ``wanted``, between those ``there``; NaN elsewhere."""
    out = np.full(attitude.shape, np.nan)
    times = t[there]
    if len(times) < 2:
        return out
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    step = times[after] - times[after - 1]
    rows: Mask = wanted & (t >= times[0]) & (t <= times[-1])
    rows &= step <= max(_ATTITUDE_GAP, GAPS.steps * float(np.median(np.diff(times))))
    turn = Slerp(times, Rotation.from_quat(attitude[there], scalar_first=True))
    out[rows] = turn(t[rows]).as_quat(scalar_first=True)
    return out


def _sensor(
    samples: _Samples, part: Sensor | None, units: Mapping[str, float], body: str
) -> Array | None:
    """Return what an inertial sensor measured (N, 3) in SI and the kit's body axes; NaN in rows
    where it was not read whole.
    """
    if part is None:
        return None
    values = samples.values(part) * units[part.unit] @ BODY_TURNS[part.body or body].T
    values[~np.isfinite(values).all(axis=1)] = np.nan
    return np.asarray(values)


def _truth(samples: _Samples, part: Columns | None, log_map: LogMap, keep: Mask) -> Array | None:
    """Return the true force or torque (n, 3) in the kit's world, in N or Nm."""
    if part is None:
        return None
    values = samples.values(part) * (1e-3 if part.unit.startswith("m") else 1.0)
    columns = dict(zip(part.columns, values[keep].T, strict=True))
    filled, _ = bridged(samples.table, samples.t[keep], columns, samples.rows[keep])
    turned: Array = np.column_stack(list(filled.values())) @ WORLD_TURNS[log_map.world].T
    return turned


def _kept_rows(
    samples: _Samples, log_map: LogMap, valid: Mask, sensors: Mapping[str, Array | None]
) -> tuple[Mask, list[str]]:
    """Return which rows (N,) the log has, and notes on the others."""
    parts = [part for part in (log_map.rotors, log_map.commands) if part is not None]
    motors = np.ones(len(samples.t), bool)
    span = np.ones(len(samples.t), bool)
    for part in parts:
        there = np.isfinite(samples.values(part)).all(axis=1)
        motors &= there
        read = np.flatnonzero(np.isfinite(samples.values(part)).any(axis=1))
        if not len(read):
            raise InputError(
                f"{samples.table.path}: map {log_map.name}: columns {', '.join(part.columns)}: no "
                "number in any row; expected rotor speeds or commands"
            )
        span[: read[0]] = span[read[-1] + 1 :] = False
    measured = valid.copy()
    for values in sensors.values():
        if values is not None:
            measured |= np.isfinite(values[:, 0])
    # a pose that most rows have was lost where it is missing; one of fewer has rows of its own
    keep = measured | motors if np.mean(valid[span] if span.any() else valid) > 0.5 else measured
    keep = keep & span
    notes = []
    if not keep.all():
        notes.append(
            f"{int(keep.sum())} of {len(keep)} rows kept: those with a pose or an IMU's sample, "
            "from the rotors' first sample to their last"
        )
    if int(keep.sum()) < 2:
        raise InputError(
            f"{samples.table.path}: pose or IMU and rotors do not overlap in time; expected both "
            "over the same flight"
        )
    return keep, notes


def _motors(
    samples: _Samples, log_map: LogMap, keep: Mask
) -> tuple[Array, Array | None, Array | None, list[str]]:
    """Return rotor speeds (n, 4) in rad/s (NaN: not measured), commands (n, 4), voltage (n,) of the
    rows that are kept, and notes.
    """
    notes: list[str] = []
    speeds, command, voltage = np.full((int(keep.sum()), 4), np.nan), None, None
    rotors, commands, battery = log_map.rotors, log_map.commands, log_map.battery
    if rotors is not None:
        unit = ROTOR_UNITS[rotors.unit] / rotors.pole_pairs
        speeds = _filled(samples, rotors, keep, notes)[:, [m - 1 for m in rotors.order]] * unit
        notes.append(f"rotor speeds: {rotors.unit}, {_order_note(rotors.order)}")
        if np.any(speeds < 0.0):
            notes.append("negative rotor speeds (a sense of rotation) were taken as positive")
            speeds = np.abs(speeds)
    if commands is not None and commands.range is not None:
        low, high = commands.range
        raw = _filled(samples, commands, keep, notes)[:, [m - 1 for m in commands.order]]
        u = (raw - low) / (high - low)
        _check_commands(samples.table, commands, u)
        notes.append(
            f"motor commands: {commands.unit}, {low:g} to {high:g} taken as 0 to 1, "
            f"{_order_note(commands.order)}"
        )
        outside = int(np.sum((u < -1e-9) | (u > 1.0 + 1e-9)))
        if outside:
            notes.append(f"{outside} motor command(s) beyond that range were set to its end")
        command = np.clip(u, 0.0, 1.0)
    if battery is not None:
        values = samples.values(battery)[:, 0] * VOLTAGE_UNITS[battery.unit] * battery.cells
        read = np.flatnonzero(np.isfinite(values) & (values > 0.0))
        if len(read):
            voltage = np.interp(samples.t[keep], samples.t[read], values[read])
        else:
            notes.append(f"{battery.columns[0]}: no positive voltage; left out")
    return speeds, command, voltage, notes


def _order_note(order: tuple[int, int, int, int]) -> str:
    names = order_names(order)
    return f"{order_words(order)}{f' ({names[0]})' if names else ''}"


def _filled(samples: _Samples, part: Columns, keep: Mask, notes: list[str]) -> Array:
    """Return a section's columns (n, 4) at the rows that are kept, interpolated over short gaps."""
    values = samples.values(part)
    read = np.flatnonzero(np.isfinite(values).any(axis=1))
    rows = slice(read[0], read[-1] + 1)
    columns = dict(zip(part.columns, values[rows].T, strict=True))
    filled, found = bridged(samples.table, samples.t[rows], columns, samples.rows[rows])
    notes += found
    whole = np.full(values.shape, np.nan)
    whole[rows] = np.column_stack(list(filled.values()))
    return whole[keep]


def _check_commands(table: Table, part: Commands, u: Array) -> None:
    """Raise InputError where most of the commands u (N, 4) of running motors are beyond the range
    that stands for 0 to 1.
    """
    wrong = np.mean((u < -0.01) | (u > 1.01)) if u.size else 0.0
    if wrong > _OUTSIDE:
        low, high = part.range or (0.0, 1.0)
        raw = low + u * (high - low)
        raise InputError(
            f"{table.path}: columns {', '.join(part.columns)}: values from {raw.min():.6g} to "
            f"{raw.max():.6g}; expected motor commands from {low:g} to {high:g}: state the range "
            "in the map"
        )
