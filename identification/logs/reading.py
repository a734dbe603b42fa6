"""Reading a flight log from a file, by a reader or by a map of a table's columns."""

import os
import re
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from pathlib import Path

import numpy as np

from ...runtime.errors import InputError, unknown_name
from ...runtime.regular_files import open_regular
from .clocks import on_one_clock
from .flight_log import (
    COMMANDS,
    IMU,
    POSE,
    ROTORS,
    FlightLog,
    SomeVehicle,
    flown_vehicle,
)
from .inertial import check_inertial
from .log_map import OWN_MAP, load_map
from .magnitudes import unit_doubts, without_broken_speeds
from .mapped_log import map_table
from .readers import ardupilot_bin, betaflight, crazyflie_sd, px4_ulog, rosbag
from .table import SUFFIXES, Names, Piece, Table, Texts, one_line
from .text_table import is_table, open_table

_LISTED = 8  # entries of a folder in a message
_BAG_FOLDER = ("metadata.yaml", ".db3", ".mcap")  # one of these is in a ROS 2 bag's folder


@dataclass(frozen=True)
class Reader:
    """A reader: name, function, and the columns or first bytes of its logs."""

    name: str
    what: str  # a log of its form, in words
    # function of a path (with a signature: of a table), of a vehicle or None, and, for some, of the
    # option behind the name's colon
    read: Callable[..., FlightLog]
    signature: Names = ()  # columns of a table
    begins: bytes = b""  # regular expression of a file's first bytes; empty: of a table


# maps of tables known by their columns
TABLES = {
    "nanobench": "nanobench",
    "crazyswarm2": "crazyswarm2",
    "crazyflie_csv": "cflib",
    "crazypad": "crazypad",
    "racer": "racer",
}
READERS = {
    (name := module.__name__.rpartition(".")[2]): Reader(
        name, module.WHAT, module.read, begins=module.BEGINS
    )
    for module in (crazyflie_sd, betaflight, ardupilot_bin, px4_ulog, rosbag)
}
READERS["betaflight_csv"] = Reader(
    "betaflight_csv", "a blackbox_decode table", betaflight.read_table, betaflight.SIGNATURE
)


def read_log(
    path: str | Path | Table,
    reader: str | None = None,
    vehicle: SomeVehicle = None,
    map: str | Path | None = None,
    piece: Piece = None,
) -> FlightLog:
    """Read a flight log.

    Args:
        path: the log, in the kit's own form (``.csv``, ``.csv.gz`` or ``.parquet``) or in the form
            of a reader in ``identification/logs/readers/``; or its open table.
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
    path = Path(path) if isinstance(path, str) else path
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are refused for themselves
        return finished(_read(path, reader, vehicle, map, piece), vehicle)


def finished(log: FlightLog, vehicle: SomeVehicle) -> FlightLog:
    """Return a reader's log as from ``read_log``: with doubts about its units, and without the
    inertial sensors contradicting its pose.

    Raises:
        InputError: a number is beyond any flight's.
    """
    vehicle = flown_vehicle(vehicle, log.vehicle)
    log, broken = without_broken_speeds(log)
    of_units = unit_doubts(log, vehicle)
    log, moved = on_one_clock(log, vehicle)
    log, wrong = check_inertial(log, vehicle)
    doubts = (*broken, *moved, *wrong, *of_units)
    for doubt in doubts:
        warnings.warn(f"{log.source}: {doubt}", UserWarning, stacklevel=3)
    return replace(log, notes=(*log.notes, *(f"warning: {doubt}" for doubt in doubts)))


def opened(path: Path) -> Table | None:
    """Return a file's table; None: the file is another one, or a reader knows its first bytes.

    Raises:
        InputError: the file is a table by its name, but unreadable.
    """
    return open_table(path) if is_table(path) and reader_by_content(path) is None else None


def _read(
    source: Path | Table,
    reader: str | None,
    vehicle: SomeVehicle,
    map: str | Path | None,
    piece: Piece,
) -> FlightLog:
    """Read a log by the given map or reader, else by its content."""
    path = source.path if isinstance(source, Table) else source
    if map is not None:
        if reader is not None:
            raise InputError(f"{path}: both a reader and a map; expected one of them")
        if reader_by_content(path) is READERS["rosbag"]:
            return rosbag.read(path, vehicle, str(map), piece)
        return map_table(open_table(path), load_map(map), vehicle, piece=piece)
    if isinstance(source, Table):
        chosen, table = None, source
    else:
        chosen = reader_by_content(path) if reader is None else find_reader(reader)
        if chosen is not None and not chosen.signature:
            return chosen.read(path, vehicle, piece=piece)
        if chosen is None and not is_table(path):
            raise _unknown_content(path)
        table = open_table(path)
    header = set(table.header)
    chosen = chosen or reader_by_columns(path, table.header)
    if chosen is not None:
        if missing := [name for name in chosen.signature if name not in header]:
            raise InputError(
                f"{path}: missing column(s) {', '.join(missing)}; expected those of {chosen.what}"
            )
        return chosen.read(table, vehicle=vehicle, piece=piece)
    from .map_guess import guess_map  # the guess is slow to import, and few logs need a guess

    guess = guess_map(table, vehicle)
    if not (guess.missing or guess.doubts):
        log = map_table(table, guess.log_map, vehicle, piece=piece)
        said = "columns: by a map that was guessed without a doubt; windwrench check shows it"
        return replace(log, notes=(said, *log.notes))
    known = ", ".join(f"{r.name} ({r.signature[0]} ...)" for r in _table_readers())
    motion = () if header.issuperset(IMU) else POSE
    needed = ("t", *motion, *(COMMANDS if header.issuperset(COMMANDS) else ROTORS))
    missing = [name for name in needed if name not in header]
    raise InputError(
        f"{path}: missing column(s) {', '.join(missing)}; expected {', '.join(needed)}, or the "
        f"columns of {known}, found {', '.join(table.header[:20])}. A table of "
        f"other columns is read with a map: windwrench check {path.name} --write-map map.yaml "
        "proposes one"
    )


def find_reader(name: str) -> Reader:
    """Return the reader of a name, or of ``name:option`` with that option bound.

    Raises:
        InputError: the name is unknown, or the reader takes no option.
    """
    name, colon, option = name.partition(":")
    reader = READERS.get(name)
    if name in TABLES:
        log_map = load_map(TABLES[name])
        read = partial(map_table, log_map=log_map, reader=name)
        reader = Reader(name, log_map.about, read, log_map.recognise)
    if reader is None:
        raise unknown_name("reader", name, [*TABLES, *READERS])
    if not colon:
        return reader
    if "option" not in signature(reader.read).parameters:
        raise InputError(
            f"reader {name!r} takes no option, got {option!r}; expected the name alone"
        )
    return replace(reader, read=partial(reader.read, option=option))


def reader_by_content(path: Path) -> Reader | None:
    """Return the reader of a file or folder by its first bytes; None where no reader knows them.

    Raises:
        InputError: the path is a folder, but no ROS 2 bag's.
    """
    if not os.path.isdir(path):  # False for an overlong name
        with suppress(InputError, StopIteration):  # reading the file states the error
            head = _head(path)
            return next(x for x in READERS.values() if x.begins and re.match(x.begins, head))
        return None
    with one_line(f"{path}: cannot be read as a folder"):
        names = sorted(os.listdir(path))
    if any(name.lower().endswith(_BAG_FOLDER) for name in names):
        return READERS["rosbag"]
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    raise InputError(
        f"{path}: is a folder; expected a file, or the folder of a ROS 2 bag, which has one of "
        f"{', '.join(_BAG_FOLDER)}; found {', '.join(names[:_LISTED]) or 'nothing in it'}{more}"
    )


def _head(path: Path) -> bytes:
    with open_regular(path, "a flight log") as file:
        return file.read(4096)


def _unknown_content(path: Path) -> InputError:
    """Return the error for an unknown file without a table's name.

    Raises:
        InputError: the file is unreadable.
    """
    head = _head(path)
    if head.startswith(b"\x1f\x8b"):
        return InputError(
            f"{path}: is packed (gzip); expected a table, .csv.gz by name, or the log unpacked"
        )
    # a telemetry log begins with the eight bytes of a time
    if head[8:9] in (b"\xfe", b"\xfd") and path.suffix.lower() in (".tlog", ".rlog"):
        return InputError(
            f"{path}: is telemetry (MAVLink), which has the motors a few times a second; expected "
            "the log that the vehicle wrote itself (.BIN, .ulg)"
        )
    start = head[:16]
    is_text = all(32 <= byte < 127 or byte in b"\t\r\n" for byte in start)
    shown = repr(start.decode()) if is_text else start[:8].hex(" ")
    shown = shown if head else "nothing (it is empty)"
    known = ", ".join(reader.what for reader in READERS.values() if reader.begins)
    return InputError(
        f"{path}: unknown kind of file: it begins with {shown}; expected {known}, "
        f"or a table, with a name that ends in {', '.join(SUFFIXES)}"
    )


def reader_by_columns(path: Path, header: Texts) -> Reader | None:
    """Return the reader by a table's columns; None: no reader's. This kit's own are a time; a pose,
    or an inertial sensor; and rotor speeds or motor commands; further rules are in the map.

    Raises:
        InputError: the columns fit several readers.
    """
    has = set(header).issuperset
    if has(("t",)) and (has(POSE) or has(IMU)) and (has(ROTORS) or has(COMMANDS)):
        return Reader(OWN_MAP, "", partial(map_table, log_map=load_map(OWN_MAP)))
    readers = [reader for reader in _table_readers() if has(reader.signature)]
    if len(readers) > 1:
        raise InputError(
            f"{path}: its columns are those of {' and of '.join(r.what for r in readers)}; "
            f"expected one: choose by --reader {' or --reader '.join(r.name for r in readers)}"
        )
    return readers[0] if readers else None


def _table_readers() -> list[Reader]:
    """Return the readers of tables known by their columns."""
    return [*map(find_reader, TABLES), READERS["betaflight_csv"]]
