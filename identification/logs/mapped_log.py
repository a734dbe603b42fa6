"""From columns of any names and a map of what they mean to a flight log: of a table, whose channels
share its rows, and of a recording, each of whose channels has samples of its own (``streams``).

**Rows of a table.** Where every channel has a value in every row, those are the log's rows. In a
table of several rates, whose fields are empty where a channel has no sample, the rows of the pose
and of the inertial sensors are kept; rotor speeds, commands and voltage are interpolated to them,
and so is an attitude that is logged in other rows than the position. Rows of one time are one row.
The log begins with the first sample of the rotors and ends with the last.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...dynamics.vehicle_file import load_vehicle, preset_names
from ...runtime.errors import InputError
from .channels import Array, Rows, Samples, in_kit_axes, in_kit_units, quaternions
from .commanded_speeds import speeds_of_wrench, with_commanded_speeds
from .flight_log import (
    FlightLog,
    Mask,
    check_times,
    time_notes,
    unit_quaternions,
    vehicle_of_columns,
)
from .log_map import Attitude, Battery, Columns, Commands, LogMap, Position, constant
from .map_fit import NO_QUATERNION, chosen, fitted, wanted_columns, ways
from .rotor_orders import order_names, order_words
from .sample_gaps import GAPS, bridged
from .streams import Stream, flight_log, readable, slerp
from .table import Table, stem
from .table_rows import has_several_rates, rows_of
from .tables import open_table

_IMU = ("accelerometer", "gyro")
_ATTITUDE_GAP = 0.1  # s, across which an attitude is not interpolated
_OUTSIDE = 0.5  # share of commands beyond their range from which on the range is wrong
_SPECIFIC_FORCE = 6.0, 16.0  # m/s2: a flight's median is within; outside a scale is wrong


def read_mapped(
    path: Path, log_map: LogMap, vehicle: Vehicle | None = None, reader: str = ""
) -> FlightLog:
    """Read a table of any layout by a map.

    Args:
        path: CSV or any other text table, packed or not, or Parquet.
        log_map: what its columns mean.
        vehicle: that flew, to turn commands into rotor speeds; None: the map's, where that comes
            with the kit.
        reader: name of the reader that the map serves.

    Raises:
        InputError: the table cannot be read, the map does not fit it, or a number is none that a
            flight has; the message says which column and row.
    """
    return map_table(open_table(path), log_map, vehicle, reader)


def map_table(
    table: Table, log_map: LogMap, vehicle: Vehicle | None = None, reader: str = ""
) -> FlightLog:
    """Return the flight log that a map makes of a table; as ``read_mapped``."""
    vehicle_name = vehicle_of_columns(table) if log_map.is_own else log_map.vehicle
    if vehicle is None and vehicle_name in preset_names() and not log_map.has_clocks:
        vehicle = load_vehicle(vehicle_name)
    log_map = fitted(table, log_map, vehicle, reader)
    columns = table.read(wanted_columns(log_map))
    if log_map.is_own and has_several_rates(columns, log_map):
        log_map = replace(log_map, rows="mixed")
    notes = [*table.notes, *log_map.notes, *([log_map.time.note] if log_map.time.note else [])]
    if not log_map.is_own or log_map.rows == "mixed":
        notes.insert(0, f"columns: by the map {log_map.name}")
    samples, time_words = rows_of(table, columns, log_map)
    notes += time_words
    log_map, _ = chosen([samples], log_map)
    if log_map.has_clocks:
        return map_recording(table.path, [samples], log_map, vehicle, reader, tuple(notes))
    valid, position, quaternion, pose_notes = _pose(table, samples, log_map)
    sensors = {
        name: _whole_rows(in_kit_units(log_map, name, part, samples.values(part)))
        for name in ("accelerometer", "gyro")
        if (part := getattr(log_map, name)) is not None
    }
    keep, row_notes = _kept_rows(table, samples, log_map, valid, sensors)
    speeds, command, voltage, motor_notes = _motors(table, samples, log_map, keep)
    commanded = log_map.wrench is not None and log_map.rotors is None
    if commanded and vehicle is not None:
        assert log_map.wrench is not None
        speeds, words = speeds_of_wrench(samples.values(log_map.wrench)[keep], vehicle)
        motor_notes += words
    notes += [*pose_notes, *row_notes, *motor_notes, *section_notes(log_map)]
    t = samples.t[keep]
    check_times(table, t)
    if log_map.time.offset is None:
        t = t - t[0]
    truth = {
        name: in_kit_units(log_map, name, part, _bridged(table, samples, part, keep, notes))
        for name in ("force", "torque")
        if (part := getattr(log_map, name)) is not None
    }
    cut = {name: values[keep] for name, values in sensors.items()}
    measured = {name: values for name, values in cut.items() if np.isfinite(values).any()}
    log = FlightLog(
        t=t,
        position=position[keep],
        quaternion=quaternion[keep],
        rotor_speeds=speeds,
        command=command,
        voltage=voltage,
        accelerometer=measured.get("accelerometer"),
        gyro=measured.get("gyro"),
        force=truth.get("force"),
        torque=truth.get("torque"),
        name=stem(table.path),
        source=f"{table.path} (reader {reader})" if reader else str(table.path),
        notes=(*notes, *_gap_notes(t, valid[keep], bool(measured))),
        valid=valid[keep],
        extra={name: _extra(samples, part)[keep] for name, part in log_map.extra.items()},
        commanded=commanded,
        vehicle=vehicle_name,
    )
    if not (reader or log_map.is_own):
        log = replace(log, notes=(*log.notes, *_scale_doubts(log)))
    return with_commanded_speeds(log, vehicle, log_map.commands)


@dataclass(frozen=True)
class Recording:
    """The channels of a recording in the kit's units, axes and order of rotors, each with its own
    clock.
    """

    path: Path
    reader: str  # its name
    log_map: LogMap  # with the sections that are there
    streams: dict[str, Stream]  # by section; that of the position has the attitude beside it
    notes: list[str]

    def log(self, vehicle: Vehicle | None, commanded: bool = False) -> FlightLog:
        """Return the flight log.

        Args:
            vehicle: that flew, to turn commands into rotor speeds; None: they stay commands.
            commanded: the rotor speeds were computed from commands.

        Raises:
            InputError: neither a pose nor gyro and accelerometer, or channels that do not overlap.
        """
        return flight_log(
            self.path,
            self.reader,
            self.streams.get("position"),
            self.streams.get("rotors"),
            self.streams.get("battery"),
            tuple(self.notes),
            self.streams.get("accelerometer"),
            self.streams.get("gyro"),
            command=self.streams.get("commands"),
            vehicle=vehicle,
            commanded=commanded,
            vehicle_name=self.log_map.vehicle,
            model=self.log_map.commands,
        )


def map_recording(
    path: Path,
    recorded: Sequence[Samples],
    log_map: LogMap,
    vehicle: Vehicle | None,
    reader: str,
    notes: tuple[str, ...],
) -> FlightLog:
    """Return the flight log that a map makes of columns whose groups have a clock each; arguments
    and errors as of ``channels_of_recording`` and ``Recording.log``.
    """
    return channels_of_recording(path, recorded, log_map, reader, notes).log(vehicle)


def channels_of_recording(
    path: Path, recorded: Sequence[Samples], log_map: LogMap, reader: str, notes: Sequence[str]
) -> Recording:
    """Return the channels that a map makes of columns whose groups have a clock each.

    Args:
        path: the file, for errors and the log's name.
        recorded: its groups of columns.
        log_map: what the columns mean; sections without measurements are left out.
        reader: the reader's name.
        notes: what the reader assumed.

    Raises:
        InputError: no motors, or neither a pose nor gyro and accelerometer.
    """
    motors = (*ways(log_map, "rotors"), *ways(log_map, "commands"))
    poses = ways(log_map, "position")
    log_map, sources = chosen(recorded, log_map)
    if log_map.rotors is None and log_map.commands is None:
        names = [s.topic for s in recorded if s.topic] or [x for s in recorded for x in s.columns]
        raise InputError(
            f"{path}: no motors that turn; expected {' or '.join(map(_wanted, motors))}, "
            f"found {', '.join(dict.fromkeys(names[:20])) or 'nothing'}"
        )
    streams = {
        name: _stream(log_map, name, part, sources[name]) for name, part in log_map.sections.items()
    }
    said = [*notes, *section_notes(log_map)]
    for name in ("rotors", "commands"):
        if (part := getattr(log_map, name)) is not None:
            said.append(f"{name}: {streams[name].name}, {_order_note(part.order)}")
    if "position" in streams:
        position, attitude = streams["position"], streams.pop("attitude")
        together = log_map.rows == "messages" and sources["position"] is sources["attitude"]
        turns = attitude.values if together else slerp(position.t, attitude.forward()[0])
        pose = np.column_stack([position.values, turns])
        streams["position"] = Stream(position.name, position.t, pose)
    elif poses:
        absent = [name for name in _IMU if readable(streams.get(name)) is None]
        if absent:
            raise InputError(
                f"{path}: no pose, and no {' and no '.join(absent)}; expected "
                f"{' or '.join(way.label for way in poses)}, with an attitude beside it, or "
                f"{' and '.join(_IMU)}"
            )
        said.append("no pose: no position that changes, with an attitude beside it, was logged")
    return Recording(path, reader, log_map, streams, said)


def _wanted(way: Columns) -> str:
    return f"{way.topic} with {way.columns[0]} ..." if way.topic else way.label


def _stream(log_map: LogMap, section: str, part: Columns, samples: Samples) -> Stream:
    """Return a section's channel, in the kit's units and axes."""
    values, t = samples.values(part), samples.t
    if log_map.rows != "messages":
        good = np.isfinite(values).all(axis=1)
        values, t = values[good], t[good]
    if isinstance(part, Attitude):
        values = in_kit_axes(log_map, part, quaternions(part, values))
    else:
        values = in_kit_units(log_map, section, part, values)
    return Stream(part.label, t, values)


def section_notes(log_map: LogMap) -> list[str]:
    """Return the notes of the sections that a map uses."""
    return [part.note for part in log_map.sections.values() if part.note]


def _extra(samples: Samples, part: Columns) -> Array:
    values = samples.values(part)
    return values[:, 0] if len(part.columns) == 1 else values


def _gap_notes(t: Array, valid: Mask, fast_sensor: bool) -> tuple[str, ...]:
    """Return notes on gaps in time, and on rows without a pose; beside an inertial sensor, which
    may be faster than the pose, on the pose's gaps alone.
    """
    notes = time_notes(t)
    if not valid.any() or valid.all():
        return notes
    if fast_sensor:
        return notes + tuple(f"of the pose: {text}" for text in time_notes(t[valid]))
    return (
        *notes,
        f"{int(np.sum(~valid))} of {len(t)} rows without a pose, the first at t = "
        f"{t[np.flatnonzero(~valid)[0]]:.6g} s",
    )


def _scale_doubts(log: FlightLog) -> tuple[str, ...]:
    if log.accelerometer is None:
        return ()
    size = float(np.nanmedian(np.linalg.norm(log.accelerometer, axis=1)))
    if _SPECIFIC_FORCE[0] <= size <= _SPECIFIC_FORCE[1]:
        return ()
    return (
        f"warning: the accelerometer's median size is {size:.3g} m/s2; expected about 9.8 "
        "in flight: check its unit and scale in the map",
    )


def _pose(table: Table, samples: Samples, log_map: LogMap) -> tuple[Mask, Array, Array, list[str]]:
    """Return which rows have a pose (N,), positions (N, 3) in m and attitudes (N, 4) in the kit's
    frames, and notes.
    """
    count = len(samples.t)
    position, unit = np.full((count, 3), np.nan), np.full((count, 4), np.nan)
    nowhere = np.zeros(count, bool)
    if log_map.position is None:
        return nowhere, position, unit, [] if log_map.is_own else ["no pose in the table"]
    values = samples.values(log_map.position)
    position = in_kit_units(log_map, "position", log_map.position, values)
    if log_map.attitude is None:
        return nowhere, position, unit, []
    placed: Mask = np.all(np.isfinite(position), axis=1)
    notes = []
    if isinstance(log_map.position, Position) and log_map.position.held:
        new = np.append(True, np.any(np.diff(position, axis=0) != 0.0, axis=1))
        placed &= new
        notes.append(
            f"position: sampled and held; {int(np.sum(~new))} of {count} rows repeat the one "
            "before and are not valid"
        )
    attitude = _attitude(table, samples, log_map.attitude, log_map.rows == "whole")
    turned: Mask = np.all(np.isfinite(attitude), axis=1)
    for name, mask in (("position", placed), ("attitude", turned)):
        if not mask.any() and log_map.rows != "whole":
            raise InputError(
                f"{table.path}: map {log_map.name}: {name}: no row has all of "
                f"{', '.join(getattr(log_map, name).columns)}; expected some"
            )
    both = placed & turned
    if (alone := int(np.sum(placed & ~turned))) > 0:  # logged in rows of their own, or lost
        attitude = _between(samples.t, attitude, turned, placed)
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
    if both.any():
        unit[both] = in_kit_axes(log_map, log_map.attitude, attitude[both])
    position = np.where(both[:, None], position, np.nan)
    for name in log_map.attitude.columns:
        if constant(name) is not None:
            notes.append(
                f"warning: an angle of the attitude is not in the table and is taken as "
                f"{name[1:]}: forces along the axis that it tilts are wrong by as much"
            )
    return both, position, unit, notes


def _attitude(table: Table, samples: Samples, part: Attitude, whole: bool) -> Array:
    """Return attitudes (N, 4) of length 1 in the table's frames; NaN where there is none."""
    values = samples.values(part)
    out = np.full((len(values), 4), np.nan)
    good = np.isfinite(values).all(axis=1)
    if not good.any():
        return out
    out[good] = quaternions(part, values[good])
    if not part.euler:
        with np.errstate(over="ignore", invalid="ignore"):
            good &= whole | (np.linalg.norm(out, axis=1) > NO_QUATERNION)
        out[good] = unit_quaternions(table, out, good, ", ".join(part.columns))[good]
        out[~good] = np.nan
    return out


def _between(t: Array, attitude: Array, there: Mask, wanted: Mask) -> Array:
    """Return attitudes (N, 4) at the rows ``wanted``, between those ``there``; NaN elsewhere."""
    out = np.full(attitude.shape, np.nan)
    times = t[there]
    if len(times) < 2:
        return out
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    step = times[after] - times[after - 1]
    rows: Mask = wanted & (
        step <= max(_ATTITUDE_GAP, GAPS.steps * float(np.median(np.diff(times))))
    )
    out[rows] = slerp(t[rows], Stream("", times, attitude[there]))
    return out


def _whole_rows(values: Array) -> Array:
    """Return what a sensor measured (N, 3), NaN in rows where it was not read whole."""
    values[~np.isfinite(values).all(axis=1)] = np.nan
    return values


def _kept_rows(
    table: Table,
    samples: Samples,
    log_map: LogMap,
    valid: Mask,
    sensors: Mapping[str, Array],
) -> tuple[Mask, list[str]]:
    """Return which rows (N,) the log has, and notes on the others."""
    if log_map.rows == "whole":
        return np.ones(len(samples.t), bool), []
    parts = [part for part in (log_map.rotors, log_map.commands) if part is not None]
    motors = np.ones(len(samples.t), bool)
    span = np.ones(len(samples.t), bool)
    for part in parts:
        there = np.isfinite(samples.values(part)).all(axis=1)
        motors &= there
        read = _read_rows(table, samples, log_map, part)
        span[: read[0]] = span[read[-1] + 1 :] = False
    measured = valid.copy()
    for values in sensors.values():
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
            f"{table.path}: pose or IMU and rotors do not overlap in time; expected both "
            "over the same flight"
        )
    return keep, notes


def _read_rows(table: Table, samples: Samples, log_map: LogMap, part: Columns) -> Rows:
    """Return the rows in which a section has any number."""
    read = np.flatnonzero(np.isfinite(samples.values(part)).any(axis=1))
    if not len(read):
        raise InputError(
            f"{table.path}: map {log_map.name}: columns {', '.join(part.columns)}: no "
            "number in any row; expected rotor speeds or commands"
        )
    return read


def _motors(
    table: Table, samples: Samples, log_map: LogMap, keep: Mask
) -> tuple[Array, Array | None, Array | None, list[str]]:
    """Return rotor speeds (n, 4) in rad/s (NaN: not measured), commands (n, 4), voltage (n,) of the
    rows that are kept, and notes.
    """
    notes: list[str] = []
    speeds, command, voltage = np.full((int(keep.sum()), 4), np.nan), None, None
    rotors, commands, battery = log_map.rotors, log_map.commands, log_map.battery
    if rotors is not None:
        speeds = in_kit_units(
            log_map, "rotors", rotors, _bridged(table, samples, rotors, keep, notes)
        )
        if log_map.is_own:
            _check_not_negative(table, rotors, speeds)
        else:
            notes.append(f"rotor speeds: {rotors.unit}, {_order_note(rotors.order)}")
        if np.any(speeds < 0.0):
            notes.append("negative rotor speeds (a sense of rotation) were taken as positive")
            speeds = np.abs(speeds)
    if commands is not None and commands.range is not None:
        low, high = commands.range
        raw = _bridged(table, samples, commands, keep, notes)
        u = in_kit_units(log_map, "commands", commands, raw)
        _check_commands(table, commands, raw, u, log_map.rows == "whole" and not commands.clip)
        if not log_map.is_own:
            notes.append(
                f"motor commands: {commands.unit}, {low:g} to {high:g} taken as 0 to 1, "
                f"{_order_note(commands.order)}"
            )
        outside = int(np.sum((u < -1e-9) | (u > 1.0 + 1e-9)))
        if outside:
            notes.append(f"{outside} motor command(s) beyond that range were set to its end")
        command = np.clip(u, 0.0, 1.0)
    if battery is not None:
        voltage = _voltage(table, samples, log_map, battery, keep, notes)
    return speeds, command, voltage, notes


def _voltage(
    table: Table,
    samples: Samples,
    log_map: LogMap,
    battery: Battery,
    keep: Mask,
    notes: list[str],
) -> Array | None:
    """Return the battery's voltage (n,) at the rows that are kept; None where there is none."""
    if log_map.rows == "whole":
        volts = in_kit_units(
            log_map, "battery", battery, _bridged(table, samples, battery, keep, notes)
        )
        _check_not_negative(table, battery, volts)
        t, values, read = samples.t[keep], volts[:, 0], np.arange(len(volts))
    else:
        t, values = (
            samples.t,
            in_kit_units(log_map, "battery", battery, samples.values(battery))[:, 0],
        )
        read = np.flatnonzero(np.isfinite(values) & (values > 0.0))
    if not len(read):
        notes.append(f"{battery.columns[0]}: no positive voltage; left out")
        return None
    if battery.late:
        notes.append(f"battery voltage put {battery.late:g} s sooner, by which it is logged late")
    return np.interp(samples.t[keep] + battery.late, t[read], values[read])


def _order_note(order: tuple[int, int, int, int]) -> str:
    names = order_names(order)
    return f"{order_words(order)}{f' ({names[0]})' if names else ''}"


def _bridged(table: Table, samples: Samples, part: Columns, keep: Mask, notes: list[str]) -> Array:
    """Return a section's columns (n, k) at the rows that are kept, interpolated over short gaps."""
    values = samples.values(part)
    read = np.flatnonzero(np.isfinite(values).any(axis=1))
    rows = slice(read[0], read[-1] + 1) if len(read) else slice(0, None)
    columns = dict(zip(part.columns, values[rows].T, strict=True))
    filled, found = bridged(table, samples.t[rows], columns, samples.rows[rows])
    notes += found
    whole = np.full(values.shape, np.nan)
    whole[rows] = np.column_stack(list(filled.values()))
    return whole[keep]


def _check_not_negative(table: Table, part: Columns, values: Array) -> None:
    """Raise InputError at the first rotor speed or voltage below 0, of a table whose rows are all
    kept.
    """
    what = "a rotor speed (its direction is the vehicle's spin)"
    if isinstance(part, Battery):
        what = "a voltage"
    for name, column in zip(part.columns, values.T, strict=True):
        low = np.flatnonzero(column < 0.0)
        if low.size:
            raise InputError(
                f"{table.path}: column {name}, {table.row(int(low[0]))}: {column[low[0]]:g} is "
                f"negative; expected {what} of at least 0"
            )


def _check_commands(table: Table, part: Commands, raw: Array, u: Array, strict: bool) -> None:
    """Raise InputError where most of the commands u (N, 4) are beyond the range that stands for 0
    to 1; or, ``strict``, at the first that is.
    """
    low, high = part.range or (0.0, 1.0)
    if strict:
        for name, column in zip(part.columns, raw.T, strict=True):
            outside = np.flatnonzero((column < min(low, high)) | (column > max(low, high)))
            if outside.size:
                raise InputError(
                    f"{table.path}: column {name}, {table.row(int(outside[0]))}: "
                    f"{column[outside[0]]:g}; expected a motor command from {low:g} to {high:g}"
                )
    wrong = np.mean((u < -0.01) | (u > 1.01)) if u.size else 0.0
    if wrong > _OUTSIDE:
        raise InputError(
            f"{table.path}: columns {', '.join(part.columns)}: values from {raw.min():.6g} to "
            f"{raw.max():.6g}; expected motor commands from {low:g} to {high:g}: state the range "
            "in the map"
        )
