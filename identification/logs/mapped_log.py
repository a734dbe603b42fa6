"""From columns of any names, by a map, to a flight log: of a table with channels in shared rows, or
of a recording with groups of channels on separate clocks.

A section is filled in the first way with columns and measurements in the log. Each section of the
map becomes a stream. Rows of the log are the pose's samples; for an inertial sensor much faster
than the pose, or without a pose, the sensor's: the kit's form has room for rows without a pose. For
channels in rows of their own, the log has the pose's rows, and the others are interpolated to them.
Else a table's rows without a pose and an inertial sensor's sample are left out. Such rows stay
where most rows have a pose (the pose was lost), and in a map of whole rows. An attitude in other
rows is interpolated to the position's rows.
"""

import re
from dataclasses import replace
from difflib import get_close_matches
from math import nan
from pathlib import Path

import numpy as np

from ...runtime.errors import InputError
from ..motion.smoothing import resampled
from .channels import (
    LONGEST_STEPS,
    ChannelGroup,
    Groups,
    Stream,
    check_rows,
    in_kit_axes,
    in_kit_units,
    on_one_clock,
    quaternions,
    readable,
    rows_apart,
    rows_of,
    slerp,
)
from .column_names import WORDS, groups_of, take_apart
from .commanded_speeds import speeds_of_wrench, with_commanded_speeds
from .flight_log import (
    NORM_TOLERANCE,
    VEHICLE,
    FlightLog,
    SomeVehicle,
    flown_vehicle,
    source_rate,
    time_notes,
)
from .log_map import (
    Attitude,
    Battery,
    Columns,
    Commands,
    LogMap,
    Position,
    Rotors,
    check_whole,
)
from .table import (
    ArrayPair,
    Lines,
    Mask,
    Piece,
    Table,
    Texts,
    Wanted,
    finite_rows,
    lengths,
    median_step,
    stem,
)
from .what_flew import UNSTATED, Order, WhatFlew, more_rotors, order_names, order_words

_SHOWN = 30  # columns in an error
_MOTORS = {"rotors": "rotor speeds", "commands": "commands", "wrench": "commanded wrenches"}
NO_QUATERNION = 0.5  # length; shorter stands for a missing quaternion
MOTOR_NAMES = re.compile("|".join((WORDS["motor_words"], *WORDS["command_words"])), re.IGNORECASE)
_IMU = ("accelerometer", "gyro")
# V: no multirotor's pack of 14 cells of 4.35 V has more
MOST_VOLTS = 61.0
# times faster than the pose: an inertial sensor has rows of its own. A pose is put to the nearest
# row, so the pose moves by a tenth of its step at most, with its own noise
_OWN_ROWS = 5.0
Streams = dict[str, Stream]
Sections = tuple[LogMap, Streams, Streams, Lines]


def map_table(
    table: Table,
    log_map: LogMap,
    vehicle: SomeVehicle = None,
    reader: str = "",
    piece: Piece = None,
) -> FlightLog:
    """Return the flight log of a table by a map.

    Args:
        table: a table of any columns and any layout.
        log_map: the meaning of its columns.
        vehicle: the vehicle, to turn commands into rotor speeds; None: the map's, if a preset.
        reader: name of the map's reader.
        piece: as of ``sections_of``.

    Raises:
        InputError: the map does not fit the table, or a number is beyond any flight's; the message
            names column and row.
    """
    if log_map.is_own:
        named = [match[1] for match in map(VEHICLE.fullmatch, table.header) if match]
        if len(named) > 1:
            raise InputError(
                f"{table.path}: the columns name the vehicles {' and '.join(named)}; expected one"
            )
        log_map = replace(log_map, vehicle="".join(named))
    vehicle = flown_vehicle(vehicle, log_map.vehicle)
    log_map = _fitted(table.header, table.path, log_map, vehicle, reader)
    columns = table.read(log_map.wanted)
    if log_map.is_own and rows_apart(ChannelGroup(np.arange(float(table.rows)), columns), log_map):
        log_map = replace(log_map, rows="mixed")
    by = f"columns: by the map {log_map.name}"
    by = "" if log_map.is_own and log_map.rows != "mixed" else by
    notes = [*filter(None, (by, *table.notes, *log_map.notes, log_map.time.note))]
    samples = rows_of(table, columns, log_map, notes)
    sections = sections_of(table.path, [samples], log_map, reader, notes, piece)
    del columns, samples
    table.forget()  # the streams are copies
    return flight_log(table.path, reader, sections, vehicle)


def sections_of(
    path: Path,
    recorded: Groups,
    log_map: LogMap,
    reader: str,
    notes: Texts,
    piece: Piece = None,
    flown: WhatFlew = UNSTATED,
) -> Sections:
    """Return the map with the sections that are there; their streams and those of further channels,
    in the kit's units, axes and order of rotors, by name; and notes. Each group has a clock.

    Streams: position (N, 7) m, with its scalar-first quaternion; rotors (N, 4) rad/s, commands
    (N, 4) 0 to 1, or wrench (N, 4) N and Nm, commanded; battery (N, 1) V; accelerometer (N, 3) m/s2
    and gyro (N, 3) rad/s; force and torque (N, 3), truth.

    Args:
        path: the file, for errors and the log's name.
        recorded: its groups of columns.
        log_map: the columns' meaning; sections without measurements are left out.
        reader: the reader's name.
        notes: the reader's assumptions.
        piece: part to read where the clock starts anew, from 1; default: the longest.
        flown: the log's statements on its vehicle.

    Raises:
        InputError: more than four rotors, no such piece, no motors, neither a pose nor gyro and
            accelerometer, or numbers beyond any flight's.
    """
    recorded, of_clock = on_one_clock(path, recorded, piece)
    for s in recorded:
        of_clock += motors_left_out(s.table.header if s.table else [*s.columns], log_map.wanted)
    motors = (*log_map.ways("rotors"), *log_map.ways("commands"))
    poses = log_map.ways("position")
    log_map, sources = chosen(recorded, log_map)
    of_clock += [note for s in recorded if s.table for note in check_rows(s, log_map)]
    if _MOTORS.keys().isdisjoint(log_map.sections):
        names = [s.topic for s in recorded if s.topic] or [x for s in recorded for x in s.columns]
        wanted = " or ".join(
            f"{w.topic + ' with ' if w.topic else ''}{w.columns[0]} ..." for w in motors
        )
        raise InputError(
            f"{path}: no motors that turn; expected {wanted or 'rotor speeds or motor commands'}, "
            f"found {', '.join(dict.fromkeys(names[:20])) or 'nothing'}"
        )
    said = [*notes, *of_clock, *(part.note for part in log_map.sections.values() if part.note)]
    streams = {}
    for name, part in log_map.sections.items():
        samples = sources[name]
        if name == "attitude":
            continue
        if name == "position":
            streams[name] = _pose(path, log_map, samples, sources.get("attitude"), said)
            continue
        if isinstance(part, Rotors | Commands) and not flown.airframe:
            are_speeds = isinstance(part, Rotors) and samples.table is None
            if more := more_rotors(part.columns, samples.table or samples.columns, are_speeds):
                more = f"{part.topic}: {more}" if part.topic else more
                if reader or log_map.is_own:
                    raise InputError(f"{path}: {more}")
                said.append(f"warning: {more}. The map's four were taken")
        if name in _IMU:
            samples = samples.cut(_kept_rows(samples, log_map, part))
        values = in_kit_units(log_map, name, part, samples.values(part))
        streams[name] = stream = Stream(part.label, samples.t, values)
        if isinstance(part, Rotors) and not log_map.is_own:
            said.append(f"rotors: {stream.name}, {part.unit}, {_order_note(part.order)}")
        elif isinstance(part, Commands):
            said += _command_notes(path, log_map, part, stream)
        elif isinstance(part, Battery) and part.late:
            streams[name] = replace(stream, t=stream.t - part.late)
            said.append(f"battery voltage moved {part.late:g} s earlier: the log delays it")
    if log_map.position is None:
        absent = [name for name in _IMU if readable(streams.get(name)) is None]
        if absent and (log_map.rows != "whole" or (poses and not log_map.is_own)):
            expected = " or ".join(way.label for way in poses)
            expected = f"{expected}, with an attitude beside it" if poses else "a pose"
            raise InputError(
                f"{path}: no pose, and no {' and no '.join(absent)}; expected {expected}, or "
                f"{' and '.join(_IMU)}"
            )
        if not log_map.is_own:
            said.append(
                "no pose: no position that changes, with an attitude beside it, was logged"
                if poses
                else "no pose in the log"
            )
        if log_map.rows == "whole":  # all rows are the log's
            t = recorded[0].t
            streams["position"] = Stream("pose", t, np.full((len(t), 7), nan))
    extra = {
        name: Stream(name, samples.t, samples.values(part))
        for name, part in log_map.extra.items()
        for samples in recorded
        if samples.has(part)
    }
    return log_map, streams, extra, said


def motors_left_out(names: Texts, used: Wanted) -> Lines:
    """Return a note on columns named as four motors', none of them used."""
    taken_apart = take_apart(names)
    left = {
        f"{group.columns[0]} ...": None
        for way in WORDS["parts"]["motors"]
        for endings in way["endings"]
        for group in groups_of(taken_apart, endings)
        if MOTOR_NAMES.search(group.key) and not re.search(WORDS["sticks"], group.key)
        if not {*group.columns} & {*used}
    }
    return [f"columns named as motors' were left out: {', '.join([*left][:_SHOWN])}"] * bool(left)


def _pose(
    path: Path, log_map: LogMap, samples: ChannelGroup, turned: ChannelGroup | None, notes: Lines
) -> Stream:
    """Return positions in m and attitudes (N, 7) in the kit's frames, NaN where there is none.

    Args:
        path: the file, for errors.
        log_map: with a position.
        samples: the position's group.
        turned: the attitude's group; None: there is none.
        notes: gets further ones.

    Raises:
        InputError: a quaternion's length is not 1, or no position has an attitude.
    """
    place, turn = log_map.position, log_map.attitude
    assert place is not None
    keep = _kept_rows(samples, log_map, place)
    t = samples.t[keep]
    position = in_kit_units(log_map, "position", place, samples.values(place)[keep])
    placed = finite_rows(position)
    if not placed.any() and log_map.rows != "whole":
        raise InputError(
            f"{path}: map {log_map.name}: position: no row has all of {', '.join(place.columns)}; "
            "expected some"
        )
    if len(t) < len(keep):
        notes.append(f"{len(t)} of {len(keep)} rows kept: those with a pose or an IMU's sample")
    if isinstance(place, Position) and place.held:
        new = np.append(True, (np.diff(position, axis=0) != 0.0).any(axis=1))
        placed &= new
        if not new.all():
            notes.append(
                f"position: sampled and held; {(~new).sum()} of {len(t)} rows repeat the "
                "one before and are not valid"
            )
    pose = np.full((len(t), 7), nan)
    poses = Stream(place.label, t, pose)
    if turn is None or turned is None:
        pose[:, :3] = position
        return poses
    measured = turned.cut(turned.there(turn))
    turns = quaternions(turn, measured.values(turn))
    with np.errstate(over="ignore"):
        length = lengths(turns)
    there = length > (-1.0 if log_map.rows == "whole" else NO_QUATERNION)
    off = np.flatnonzero(there & ~(abs(length - 1.0) <= NORM_TOLERANCE))
    if off.size:
        what = turn.topic or f"columns {', '.join(turn.columns)}"
        raise InputError(
            f"{path}: {what}, {measured.place(off[0])}: a quaternion of length "
            f"{length[off[0]]:.4g}; expected 1 within {NORM_TOLERANCE:g}"
        )
    if there.any():
        turns = in_kit_axes(log_map, turn, turns[there])
    attitude = Stream(turn.label, measured.t[there], turns)
    steps = np.diff(attitude.t)
    longest = max(0.1, LONGEST_STEPS * np.median(steps)) if len(steps) else 0.0
    pose[placed] = np.column_stack([position[placed], slerp(t[placed], attitude, longest)])
    if placed.any() and not finite_rows(pose).any():
        raise InputError(
            f"{path}: position and attitude do not overlap in time; expected both over the same "
            "flight"
        )
    alone = (~np.isin(t[placed], attitude.t)).sum()
    if turned is samples and alone:
        notes.append(
            f"{alone} of {placed.sum()} positions stand in rows without an attitude, which "
            "was interpolated to their times where it has samples close by"
        )
    notes += [
        "warning: an angle of the attitude is not in the table and is taken as "
        f"{name[1:]}: forces along the axis that it tilts are wrong by as much"
        for name in turn.columns
        if name not in turn.named
    ]
    return poses


def _kept_rows(samples: ChannelGroup, log_map: LogMap, part: Columns) -> Mask:
    """Return the rows (N,) of a group for a section's stream: all messages. In a table with
    channels in rows of their own, the section's rows; else the rows with a position or an inertial
    sensor's sample. All rows stay where most have a position: the others lost the position.
    """
    everything = np.ones(len(samples.t), bool)
    if log_map.rows == "whole" or samples.table is None:
        return everything
    if rows_apart(samples, log_map):
        return samples.there(part)
    place = log_map.position
    parts = filter(None, (place, log_map.accelerometer, log_map.gyro))
    there = {one: samples.there(one) for one in parts if samples.has(one)}
    if place in there and there[place].mean() > 0.5:
        return everything
    return np.asarray(np.any([*there.values()], axis=0))


def _command_notes(path: Path, log_map: LogMap, part: Commands, commands: Stream) -> Lines:
    """Return notes on commands (N, 4).

    Raises:
        InputError: most commands are beyond the range of 0 to 1.
    """
    low, high = part.range or (0.0, 1.0)
    u = commands.values[np.isfinite(commands.values)]
    if ((u < -0.01) | (u > 1.01)).sum() > 0.5 * len(u):
        raw = low + (high - low) * u
        what, hint = "", ": state the range in the map"
        if u.max() < 0.0 and part.topic:  # an autopilot knows its range
            what, hint = "no motors that turn: ", ""
        raise InputError(
            f"{path}: {what}columns {', '.join(part.columns)}: values from {raw.min():.6g} to "
            f"{raw.max():.6g}; expected motor commands from {low:g} to {high:g}{hint}"
        )
    notes = []
    if not log_map.is_own:
        is_said = part.note or (low, high) == (0.0, 1.0)
        taken = "" if is_said else f"{low:g} to {high:g} taken as 0 to 1, "
        notes.append(f"commands: {commands.name}, {part.unit}, {taken}{_order_note(part.order)}")
    if outside := ((u < -1e-9) | (u > 1.0 + 1e-9)).sum():
        notes.append(f"{outside} motor command(s) beyond that range were set to its end")
    return notes


def _order_note(order: Order) -> str:
    names = order_names(order)
    return f"{order_words(order)}{f' ({names[0]})' if names else ''}"


def _fitted(
    names: Texts, source: object, log_map: LogMap, vehicle: SomeVehicle, reader: str
) -> LogMap:
    """Return a map with the ways to fill a section from a table's columns, and with the range of
    its commands. Optional sections without columns are left out.

    Raises:
        InputError: the map does not fit the table.
    """
    header = set(names)
    where = f"{source}: map {log_map.name}"
    fitting, missing = {}, []
    for section in ("time", *log_map.sections):
        ways = log_map.ways(section)
        fitting[section] = [way for way in ways if header.issuperset(way.named)]
        named, is_optional = ways[0].named, ways[0].optional
        absent = [name for name in named if name not in header]
        left_out = is_optional and (len(absent) == len(named) or reader)
        if not fitting[section] and not left_out:
            whose = f"{section} (all or none)" if is_optional else section
            missing += [(name, whose) for name in absent]
    if missing:
        lower, words = {name.lower(): name for name in names}, []
        for name, section in missing[:8]:
            near = get_close_matches(name.lower(), lower, n=2, cutoff=0.6)
            hint = f" (like {' or '.join(lower[x] for x in near)})" if near else ""
            words.append(f"{name!r} of {section}{hint}")
        more = f" and {len(missing) - 8} more" if len(missing) > 8 else ""
        listed = ", ".join(names[:_SHOWN]) + (", ..." if names[_SHOWN:] else "")
        raise InputError(
            f"{where} does not fit: no column {', '.join(words)}{more}; found {listed}"
        )
    extra = {name: part for name, part in log_map.extra.items() if header.issuperset(part.named)}
    log_map = log_map.with_ways(fitting)
    check_whole(log_map, f"{where} does not fit")
    return with_range(replace(log_map, extra=extra), vehicle, where)


def with_range(log_map: LogMap, vehicle: SomeVehicle, where: str) -> LogMap:
    """Return a map with the range of its commands: its own, or the vehicle's.

    Raises:
        InputError: neither states one.
    """
    commands = log_map.commands
    if commands is None or commands.range is not None:
        return log_map
    if vehicle is None or vehicle.motor_curve is None:
        raise InputError(
            f"{where}: commands: unit counts without a range; expected what stands for no and "
            "for full command, such as range: [0, 65535], or a vehicle whose motor_curve "
            "states it"
        )
    return replace(log_map, commands=replace(commands, range=vehicle.motor_curve.command))


def chosen(recorded: Groups, log_map: LogMap) -> tuple[LogMap, dict[str, ChannelGroup]]:
    """Return a map with one way to fill each section, and the columns' groups. The first way with
    columns and measurements is taken; a position together with its attitude. Optional sections
    without columns are left out.
    """
    usable = {}
    for section in log_map.sections:
        ways = [(way, s) for way in log_map.ways(section) for s in recorded if s.has(way)]
        # the only way fills a required section
        is_stated = log_map.rows == "whole" or log_map.is_own
        if len(ways) != 1 or (ways[0][0].optional and not is_stated):
            ways = [one for one in ways if _is_measured(section, *one, log_map.rows)]
        usable[section] = ways
    places, turns = usable.get("position", []), usable.get("attitude", [])
    pairs = [
        ([place], [turn])
        for place in places
        for turn in turns
        if not turn[0].of or place[0].topic in turn[0].of
    ]
    if pairs or not (log_map.is_own and places):
        usable["position"], usable["attitude"] = pairs[0] if pairs else ([], [])
    return (
        log_map.with_ways({n: [way for way, _ in ways[:1]] for n, ways in usable.items()}),
        {section: ways[0][1] for section, ways in usable.items() if ways},
    )


def _is_measured(section: str, way: Columns, samples: ChannelGroup, rows: str) -> bool:
    """Return whether a section's columns hold measurements: turning rotors, a voltage, a changing
    position (of any but ``messages``), or two samples of others.
    """
    values = samples.values(way)
    values = values[finite_rows(values)]
    told = values != 0.0
    if isinstance(way, Attitude) and not way.euler:
        told = lengths(values) > NO_QUATERNION
    elif section == "battery":
        told = values > 0.0
    elif section == "position" and rows != "messages" and len(values):
        told = np.ptp(values, axis=0) > 0.0
    elif section != "rotors":
        return len(values) > 1
    return bool(told.any())


def flight_log(
    path: Path,
    reader: str,
    sections: Sections,
    vehicle: SomeVehicle,
    flown: WhatFlew = UNSTATED,
) -> FlightLog:
    """Return the flight log of streams.

    Rows are the pose's samples within the span of the motors' stream. For a sensor 5 times faster
    than the pose, or without a pose, rows are the sensor's. A pose then stands in the nearest row,
    moved there along the line to its neighbour. Everything else is interpolated to the rows. A pose
    with NaN or an infinite number is not valid.

    Args:
        path: the file, for errors and the log's name.
        reader: its name; nothing: the file is a table of the kit's own or of a map.
        sections: as of ``sections_of``.
        vehicle: the vehicle, to turn commands into rotor speeds by its motor curve or by an
            assumption in the notes; None: the map's, if a preset.
        flown: the log's statements on its vehicle.

    Raises:
        InputError: too few samples, an infinite rotor speed, neither a pose nor gyro and
            accelerometer, no motors, or streams without overlap.
    """
    log_map, streams, extra, said = sections
    vehicle = flown_vehicle(vehicle, log_map.vehicle)
    notes = [*said]
    made = _cleaned(path, streams, notes)
    kind = next(name for name in _MOTORS if name in made)
    motors = made[kind].whole()
    t, pose = _rows(
        path, made.get("position"), motors, made.get("gyro", made.get("accelerometer")), notes
    )
    after = np.searchsorted(motors.t, t)  # rows lie within the motors' span
    steps = np.diff(motors.t)[after[motors.t[after] != t] - 1]
    if (longest := steps.max(initial=0.0)) > 0.5:
        notes.append(
            f"{motors.name}: up to {longest:.2g} s between messages; the {_MOTORS[kind]} there "
            "are interpolated"
        )
    valid = finite_rows(pose)
    if np.isfinite(pose[:, 3:]).any():  # else positions without an attitude, which are kept
        pose[~valid] = nan
    pose[valid, 3:] /= lengths(pose[valid, 3:])[:, None]
    there = {
        name: stream.between(t) if name in _IMU else stream.at(t)
        for name, stream in made.items()
        if name != "position"
    }
    measured = {name: x for name, x in there.items() if name in _IMU and np.isfinite(x).any()}
    speeds = there.get("rotors", np.full((len(t), 4), nan))
    if kind == "wrench" and vehicle is not None:
        speeds = speeds_of_wrench(there["wrench"], vehicle, notes)
    times = t - t[0] if log_map.time.offset is None else t
    notes += time_notes(times)
    without = (~valid).sum() if valid.any() else 0
    if without and measured:  # the sensor may be faster than the pose
        notes += [f"of the pose: {text}" for text in time_notes(times[valid])]
    elif without:
        notes.append(
            f"{without} of {len(t)} rows without a pose, the first at t = "
            f"{times[valid.argmin()]:.6g} s"
        )
    log = FlightLog(
        times,
        pose[:, :3],
        pose[:, 3:],
        speeds,
        voltage=there["battery"][:, 0] if "battery" in there else None,
        force=there.get("force"),
        torque=there.get("torque"),
        name=stem(path) if path.is_file() else path.name,
        source=f"{path} (reader {reader})" if reader else str(path),
        notes=tuple(notes),
        valid=valid,
        extra={name: stream.between(t).squeeze() for name, stream in extra.items()},
        commanded=kind == "wrench",
        command=there.get("commands"),
        vehicle=log_map.vehicle,
        flown=flown,
        rates={name: source_rate(s.t, s.values) for name, s in made.items()},
        **measured,
    )
    return with_commanded_speeds(log, vehicle, log_map.commands)


def _cleaned(path: Path, streams: Streams, notes: Lines) -> Streams:
    """Return the streams with values, within a flight's limits; ``notes`` get further ones.

    Raises:
        InputError: too few samples, or an infinite rotor speed.
    """
    made = {}
    for section, stream in streams.items():
        name, values, count = stream.name, stream.values, len(stream.t)
        if section in ("position", *_MOTORS) and count < 2:
            raise InputError(f"{path}: {name}: {count} message(s); expected at least two")
        if section == "rotors" and np.isinf(values).any():
            row, rotor = np.argwhere(np.isinf(values))[0]
            raise InputError(
                f"{path}: {name}, message {row + 1}: the rotor speed of rotor "
                f"{rotor + 1} is {values[row, rotor]}; expected a finite number"
            )
        if section in _MOTORS and readable(stream) is None:
            raise InputError(
                f"{path}: {name}: no two samples have four finite {_MOTORS[section]}; expected some"
            )
        if section == "rotors":
            if (values < 0.0).any():
                notes.append(f"{name}: negative rotor speeds were taken as positive")
            values = abs(values)
        elif section == "commands":
            values = values.clip(0.0, 1.0)
        elif section == "battery":
            # below, a lithium cell is empty
            plausible = (values >= 2.5) & (values <= MOST_VOLTS)
            wrong = values[~plausible & (values > 0.0)]
            if len(wrong):
                notes.append(
                    f"{name}: {len(wrong)} of {count} voltages, {wrong.min():.3g} to "
                    f"{wrong.max():.3g} V, are none of a vehicle's battery; left out"
                )
            values = np.where(plausible, values, nan)
        elif section in _IMU:
            values = np.where(finite_rows(values)[:, None], values, nan)
        if section == "position" or (np.isfinite(values).any() and count > 1):
            made[section] = Stream(name, stream.t, values)
        elif section == "battery" and not (stream.values > 0.0).any():
            notes.append(f"{name}: no positive voltage; left out")
    return made


def _rows(
    path: Path, pose: Stream | None, motors: Stream, sensor: Stream | None, notes: Lines
) -> ArrayPair:
    """Return the rows' times (M,) in s, and the poses (M, 7) in them, NaN where there is none;
    ``notes`` get further ones.

    Raises:
        InputError: fewer than two rows lie within the span of the motors' stream.
    """
    if pose and sensor and not median_step(pose.t) > _OWN_ROWS * median_step(sensor.t) > 0.0:
        sensor = None
    begin, end = motors.t[0], motors.t[-1]
    for stream in filter(None, (pose, sensor)):  # both must meet the motors
        inside = (stream.t >= begin) & (stream.t <= end)
        if inside.sum() < 2:
            raise InputError(
                f"{path}: {stream.name} (from {stream.t[0]:.6g} to {stream.t[-1]:.6g} s) and "
                f"{motors.name} (from {begin:.6g} to {end:.6g} s) do not overlap; expected both "
                "over the same flight"
            )
        t = stream.t[inside]
    if sensor is None:
        assert pose is not None
        return t, pose.values[inside]
    rows = f"rows are those of {sensor.name}, {1.0 / median_step(sensor.t):.4g} Hz"
    placed = np.full((len(t), 7), nan)
    if pose is not None:
        rate = f"{1.0 / median_step(pose.t):.4g} Hz"
        rows += f"; the pose of {pose.name}, {rate}, stands in the nearest of them"
    notes.append(rows)
    if (seen := readable(pose)) is not None:
        own, values = seen.t, seen.values
        near = np.searchsorted(t, own).clip(1, len(t) - 1)
        near -= own - t[near - 1] < t[near] - own
        reach = max(0.6 * median_step(t), 0.5 * median_step(own) / _OWN_ROWS)
        near = np.unique(near[abs(t[near] - own) <= reach])
        placed[near, :3] = resampled(t[near], own, values[:, :3])
        placed[near, 3:] = slerp(t[near], replace(seen, values=values[:, 3:]))
    return t, placed
