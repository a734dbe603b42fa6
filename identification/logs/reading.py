"""Reading a flight log from a file, by a reader or by a map of a table's columns."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from . import readers
from .commanded_speeds import flown_vehicle
from .flight_log import ACCELEROMETER, COMMANDS, GYRO, POSE, REQUIRED, ROTORS, FlightLog
from .inertial import check_inertial, on_one_clock
from .log_map import OWN_MAP, load_map
from .magnitudes import unit_doubts, without_broken_speeds
from .mapped_log import map_table
from .table import Table
from .tables import is_table, open_table

_SHOWN = 20  # columns in an error


def read_log(
    path: str | Path,
    reader: str | None = None,
    vehicle: Vehicle | None = None,
    map: str | Path | None = None,
    piece: int | None = None,
) -> FlightLog:
    """Read a flight log.

    Args:
        path: the log, in the kit's own form (``.csv``, ``.csv.gz`` or ``.parquet``) or in the form
            of a reader in ``identification/logs/readers/``.
        reader: name of a reader, with an option behind a colon (``rosbag:topics.yaml``); None:
            chosen by the file's content.
        vehicle: the vehicle, for checking units and for converting commands into rotor speeds;
            None: the log's or the map's, if a preset.
        map: for a table of other columns or another layout: the name of one of the kit's maps, or
            the path of a map file (``log_map``).
        piece: part to read, from 1, of a file with several logs or with restarts of the clock
            (``channels``); None: the longest.

    Raises:
        InputError: the file cannot be read or breaks a rule of the form; the message says where,
            and the expected value.

    Warns:
        UserWarning: numbers look as if they were in other units. The same text is in the log's
            notes.
    """
    path = Path(path)
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are refused for themselves
        log = _read(path, reader, vehicle, map, piece)
    return finished(log, vehicle)


def finished(log: FlightLog, vehicle: Vehicle | None) -> FlightLog:
    """Return a reader's log as from ``read_log``: with doubts about its units, and without the
    inertial sensors contradicting its pose.

    Raises:
        InputError: a number is beyond any flight's.
    """
    vehicle = flown_vehicle(vehicle, log.vehicle)
    log, broken = without_broken_speeds(log)
    of_units = unit_doubts(log, vehicle)
    log, moved = on_one_clock(log, vehicle)
    log, wrong = check_inertial(log, 9.81 if vehicle is None else vehicle.gravity)
    doubts = [*broken, *moved, *wrong, *of_units]
    for doubt in doubts:
        warnings.warn(f"{log.source}: {doubt}", UserWarning, stacklevel=3)
    return replace(log, notes=(*log.notes, *(f"warning: {doubt}" for doubt in doubts)))


def is_own(header: Sequence[str]) -> bool:
    """Return whether a table has this kit's own columns: a time; a pose, or an inertial sensor; and
    rotor speeds or motor commands. Further rules are in the map.
    """
    there = set(header)
    moves = set(POSE) <= there or {*ACCELEROMETER, *GYRO} <= there
    return "t" in there and moves and (set(ROTORS) <= there or set(COMMANDS) <= there)


def unknown_table(path: Path) -> Table | None:
    """Return a file's table of unknown columns, neither the kit's nor a reader's; None: any other
    file.

    Raises:
        InputError: the file is a table by its name, but unreadable.
    """
    if not is_table(path) or readers.reader_by_content(path) is not None:
        return None
    table = open_table(path)
    known = is_own(table.header) or readers.reader_by_columns(path, table.header) is not None
    return None if known else table


def _read(
    path: Path,
    reader: str | None,
    vehicle: Vehicle | None,
    map: str | Path | None,
    piece: int | None,
) -> FlightLog:
    """Read a log by the given map or reader, else by its content."""
    if map is not None:
        if reader is not None:
            raise InputError(f"{path}: both a reader and a map; expected one of them")
        if readers.reader_by_content(path) is readers.READERS["rosbag"]:
            return readers.rosbag.read(path, vehicle, str(map), piece)
        return map_table(open_table(path), load_map(map), vehicle, piece=piece)
    chosen = readers.reader_by_content(path) if reader is None else readers.find_reader(reader)
    if chosen is not None and not chosen.signature:
        return chosen.read(path, vehicle, piece=piece)
    if chosen is None and not is_table(path):
        raise readers.unknown_content(path)
    table = open_table(path)
    if chosen is None and is_own(table.header):
        return map_table(table, load_map(OWN_MAP), vehicle, piece=piece)
    chosen = chosen or readers.reader_by_columns(path, table.header)
    if chosen is not None:
        if missing := [name for name in chosen.signature if name not in table.header]:
            raise InputError(
                f"{path}: missing column(s) {', '.join(missing)}; expected those of {chosen.what}"
            )
        return chosen.read(table, vehicle=vehicle, piece=piece)
    from .map_guess import guess_map  # the guess is slow to import, and few logs need a guess

    guess = guess_map(table, vehicle)
    if not guess.missing and not guess.doubts:
        log = map_table(table, guess.log_map, vehicle, piece=piece)
        said = "columns: by a map that was guessed without a doubt; windwrench check shows it"
        return replace(log, notes=(said, *log.notes))
    known = ", ".join(f"{r.name} ({r.signature[0]} ...)" for r in readers.table_readers())
    has_imu = {*ACCELEROMETER, *GYRO} <= set(table.header)
    needed = ("t", *ROTORS) if has_imu else REQUIRED
    missing = [name for name in needed if name not in table.header]
    raise InputError(
        f"{path}: missing column(s) {', '.join(missing)}; expected {', '.join(REQUIRED)}, or the "
        f"columns of {known}, found {', '.join(table.header[:_SHOWN])}. A table of "
        f"other columns is read with a map: windwrench check {path.name} --write-map map.yaml "
        "proposes one"
    )
