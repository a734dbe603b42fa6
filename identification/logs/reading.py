"""Reading a flight log from a file: this kit's own format here, any other through its reader."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...dynamics.vehicle_file import load_vehicle, preset_names
from ...runtime.errors import InputError
from .commanded_speeds import with_commanded_speeds
from .flight_log import (
    ACCELEROMETER,
    COMMANDS,
    GYRO,
    POSE,
    REQUIRED,
    ROTORS,
    TRUTH,
    VEHICLE,
    Array,
    FlightLog,
    Mask,
    check_finite,
    check_times,
    log_name,
    sensor_columns,
    time_notes,
    unit_quaternions,
)
from .inertial import check_inertial
from .known_tables import read_known_table
from .layout_guess import is_text_table
from .log_map import load_map
from .magnitudes import check_magnitudes
from .mapped_log import read_mapped
from .readers import find_reader
from .readers.recognise import (
    looked_for_columns,
    reader_by_columns,
    reader_by_content,
    unknown_content,
)
from .sample_gaps import GAPS, bridged
from .tables import SUFFIXES, Table, open_table

OWN_MAP = "windwrench"  # of this kit's own columns in a table of several rates


def read_log(
    path: str | Path,
    reader: str | None = None,
    vehicle: Vehicle | None = None,
    map: str | Path | None = None,
) -> FlightLog:
    """Read a flight log.

    Args:
        path: the log, of the kit's own form (``.csv``, ``.csv.gz`` or ``.parquet``) or of any that
            a reader in ``identification/logs/readers/`` knows.
        reader: name of a reader, with that reader's option behind a colon where it takes one
            (``rosbag:topics.yaml``); None: chosen by what is in the file.
        vehicle: the vehicle that flew, for checking units and, in a reader, for converting thrust
            into rotor speeds; None: the one that the log or its reader names, where it is a preset.
        map: for a table of other columns or another layout: the name of a map that ships with the
            kit, or the path of a map file (``log_map``).

    Raises:
        InputError: the file cannot be read or breaks a rule of the form; the message says where and
            what was expected.

    Warns:
        UserWarning: numbers look as if they were in other units. The same text is in the log's
            notes.
    """
    path = Path(path)
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are refused for themselves
        log = _read(path, reader, vehicle, map)
    return finished(log, vehicle)


def finished(log: FlightLog, vehicle: Vehicle | None) -> FlightLog:
    """Return a log as ``read_log`` gives it, of what a reader made of its file: with doubts about
    its units, and without inertial sensors that contradict its pose.

    Raises:
        InputError: a number is none that a flight has.
    """
    check_magnitudes(log)
    if vehicle is None and log.vehicle in preset_names():
        vehicle = load_vehicle(log.vehicle)
    return _with_doubts(log, vehicle)


def missing_columns(table: Table) -> list[str]:
    """Return the columns that a table of the kit's format lacks."""
    return [name for name in _needed(table) if name not in table.header]


def _read(
    path: Path, reader: str | None, vehicle: Vehicle | None, map: str | Path | None
) -> FlightLog:
    """Read a log by the map or the reader that is given, else as what is in it says."""
    if map is not None:
        if reader is not None:
            raise InputError(f"{path}: both a reader and a map; expected one of them")
        return read_mapped(path, load_map(map), vehicle)
    if reader is not None:
        return find_reader(reader).read(path, vehicle)
    chosen = reader_by_content(path)
    if chosen is not None:
        return chosen.read(path, vehicle)
    expected = f"{', '.join(REQUIRED)}, or the columns of {looked_for_columns()}"
    if not path.name.lower().endswith(SUFFIXES):
        if not is_text_table(path):
            raise unknown_content(path)
        return read_known_table(path, vehicle, f"expected columns {expected}")
    table = open_table(path)
    missing = missing_columns(table)
    if not missing:
        return _canonical(table, vehicle)
    chosen = reader_by_columns(path, table.header)
    if chosen is not None:
        return chosen.read(path, vehicle)
    words = f"missing column(s) {', '.join(missing)}; expected {expected}"
    return read_known_table(path, vehicle, words)


def _needed(table: Table) -> tuple[str, ...]:
    """Return the columns that a table of the kit's format must have: pose and rotor speeds, unless
    it has none of the one (or a position without an attitude) but an inertial sensor, or none of
    the other but motor commands.
    """
    there = set(table.header)
    pose: tuple[str, ...] = POSE
    if {*ACCELEROMETER, *GYRO} <= there:
        if not there & set(POSE):
            pose = ()
        elif not there & set(POSE[3:]):
            pose = POSE[:3]
    no_rotors = not there & set(ROTORS) and set(COMMANDS) <= there
    return ("t", *pose, *(() if no_rotors else ROTORS))


def _canonical(table: Table, vehicle: Vehicle | None) -> FlightLog:
    path = table.path
    truth, commands, *sensors = (
        _all_or_none(table, group) for group in (TRUTH, COMMANDS, ACCELEROMETER, GYRO)
    )
    needed = _needed(table)
    names = [*needed, *(["vbat"] if "vbat" in table.header else []), *truth, *commands]
    columns = table.read([*names, *(name for sensor in sensors for name in sensor)])
    check_finite(table, "t", columns["t"])
    check_times(table, columns["t"])
    motors = {name: columns[name] for name in (*ROTORS, *COMMANDS, "vbat") if name in names}
    filled, gap_notes = bridged(table, columns["t"], motors)
    columns |= filled

    nothing = np.full(table.rows, np.nan)
    pose = np.column_stack([columns.get(name, nothing) for name in POSE])
    if POSE[3] in columns and _has_several_rates(pose):
        return read_mapped(path, load_map(OWN_MAP), vehicle)
    lost: Mask = np.all(np.isnan(pose), axis=1)
    for name in names:
        check_finite(table, name, columns[name], ~lost if name in POSE else None)
    attitude: Mask = ~lost if POSE[3] in columns else np.zeros(table.rows, dtype=np.bool_)
    accelerometer, gyro = (sensor_columns(table, columns, sensor) for sensor in sensors)
    quaternion = unit_quaternions(table, pose[:, 3:], attitude, "qw, qx, qy, qz")
    rotor_speeds = np.column_stack([columns.get(name, nothing) for name in ROTORS])
    command = np.column_stack([columns[name] for name in COMMANDS]) if commands else None
    _check_commands(table, columns, commands)
    for name in (name for name in (*ROTORS, "vbat") if name in names):
        low = np.flatnonzero(columns[name] < 0)
        if low.size:
            expected = (
                "a voltage of"
                if name == "vbat"
                else "a rotor speed (its direction is the vehicle's spin) of"
            )
            raise InputError(
                f"{path}: column {name}, {table.row(low[0])}: {columns[name][low[0]]:g} is "
                f"negative; "
                f"expected {expected} at least 0"
            )
    log = FlightLog(
        t=columns["t"],
        position=pose[:, :3].copy(),
        quaternion=quaternion,
        rotor_speeds=rotor_speeds,
        command=command,
        voltage=columns.get("vbat"),
        force=np.column_stack([columns[name] for name in TRUTH[:3]]) if truth else None,
        torque=np.column_stack([columns[name] for name in TRUTH[3:]]) if truth else None,
        accelerometer=accelerometer,
        gyro=gyro,
        name=log_name(path),
        source=str(path),
        notes=(
            *table.notes,
            *gap_notes,
            *time_notes(columns["t"]),
            *_pose_notes(columns["t"], lost, accelerometer is not None or gyro is not None),
        ),
        valid=attitude,
        vehicle=_vehicle_name(table),
    )
    return with_commanded_speeds(log, vehicle)


def _has_several_rates(pose: Array) -> bool:
    """Return whether the positions or the attitudes of a pose (N, 7) are slower than the table, and
    not in the same rows: where a pose is lost, both are.
    """
    placed, turned = (np.isfinite(part).all(axis=1) for part in (pose[:, :3], pose[:, 3:]))
    share = min(placed.mean(), turned.mean())
    return bool(0.0 < share < GAPS.dense and np.any(placed != turned))


def _check_commands(table: Table, columns: Mapping[str, Array], names: Sequence[str]) -> None:
    """Raise InputError at the first motor command outside 0 to 1."""
    for name in names:
        outside = np.flatnonzero((columns[name] < 0.0) | (columns[name] > 1.0))
        if outside.size:
            raise InputError(
                f"{table.path}: column {name}, {table.row(outside[0])}: "
                f"{columns[name][outside[0]]:g}; expected a motor command from 0 to 1"
            )


def _vehicle_name(table: Table) -> str:
    """Return the name of the vehicle that a column's name gives, or nothing.

    Raises:
        InputError: two columns name one each.
    """
    found = [match[1] for name in table.header if (match := VEHICLE.fullmatch(name))]
    if len(found) > 1:
        raise InputError(
            f"{table.path}: the columns name the vehicles {' and '.join(found)}; expected one"
        )
    return found[0] if found else ""


def _all_or_none(table: Table, group: tuple[str, ...]) -> tuple[str, ...]:
    """Return a group of optional columns, or nothing where the table has none of them.

    Raises:
        InputError: it has some of them only.
    """
    absent = [name for name in group if name not in table.header]
    if absent and len(absent) < len(group):
        raise InputError(
            f"{table.path}: missing column(s) {', '.join(absent)}; expected all of "
            f"{', '.join(group)} or none"
        )
    return () if absent else group


def _pose_notes(t: Array, lost: Mask, fast_sensor: bool) -> tuple[str, ...]:
    """Return a note on rows without a pose; beside a faster inertial sensor, on its gaps alone."""
    if not lost.any() or lost.all():
        return ()
    if fast_sensor:
        return tuple(f"of the pose: {text}" for text in time_notes(t[~lost]))
    return (
        f"{int(lost.sum())} of {len(t)} rows without a pose (motion capture lost the vehicle), the "
        f"first at "
        f"t = {t[np.flatnonzero(lost)[0]]:.6g} s",
    )


def _with_doubts(log: FlightLog, vehicle: Vehicle | None) -> FlightLog:
    """Warn where numbers look as if they were in other units, and add the warnings to the notes."""
    doubts = []
    if log.period > 0.5:
        doubts.append(
            f"the median time step is {log.period:g} s: is t in milliseconds? Expected seconds"
        )
    if log.valid.any():
        spread = float(np.max(np.ptp(log.position[log.valid], axis=0)))
        if spread > 300.0:
            doubts.append(
                f"positions spread over {spread:.0f} m: are px, py, pz in millimetres? Expected "
                f"metres"
            )
    if vehicle is not None and log.has_rotor_speeds:
        with np.errstate(over="ignore"):
            thrust = np.square(log.rotor_speeds) @ vehicle.k / vehicle.weight
        turning = thrust[log.rotor_speeds.max(axis=1) > 0.0]
        ratio = float(np.median(turning)) if turning.size else 1.0
        if ratio > 10.0:
            doubts.append(
                f"the rotor speeds make a median thrust of {ratio:.0f} times the weight of "
                f"{vehicle.name}: "
                "are omega1..omega4 in rpm? Expected rad/s"
            )
        elif ratio < 0.1:
            doubts.append(
                f"the rotor speeds make a median thrust of {ratio:.2g} times the weight of "
                f"{vehicle.name}: "
                "are omega1..omega4 in revolutions per second? Expected rad/s"
            )
    log, wrong = check_inertial(log, 9.81 if vehicle is None else vehicle.gravity)
    doubts += wrong
    if not doubts:
        return log
    for doubt in doubts:
        warnings.warn(f"{log.source}: {doubt}", UserWarning, stacklevel=4)
    return replace(log, notes=(*log.notes, *(f"warning: {doubt}" for doubt in doubts)))
