"""Readers of flight logs of other forms. Each states its assumptions, the thrust model above all,
in the log's notes.

A table needs no code: a map in ``identification/logs/maps/``, and its name in ``TABLES``. A reader
of another form is a file in this folder and a line in ``READERS``. Its function ``read(path,
vehicle, piece)`` returns a FlightLog; a reader of tables takes the open table. The function decodes
the file into named columns, each group with its clock; a map in ``maps/recordings/`` states their
meaning. The vehicle (or None) turns commands into rotor speeds where none were measured. ``piece``
is the part to read, from 1, of a file with several logs or with restarts of the clock; default: the
longest.

A reader is chosen by the log's content: the first bytes of a file, or the columns of a table. A
file's name decides nothing but how a table is packed.
"""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from pathlib import Path

from ....runtime.errors import InputError, unknown_name
from ....runtime.regular_files import open_regular
from ..flight_log import FlightLog
from ..log_map import load_map
from ..mapped_log import map_table
from ..table import SUFFIXES, Names
from . import ardupilot_bin, betaflight, crazyflie_sd, px4_ulog, rosbag

_HEAD = 4096  # bytes at a file's start
_LISTED = 8  # entries of a folder in a message
_GZIP = b"\x1f\x8b"
_MAVLINK = b"\xfe\xfd"  # one of these follows the eight bytes of a telemetry log's first time
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


def find_reader(name: str) -> Reader:
    """Return the reader of a name, or of ``name:option`` with that option bound.

    Raises:
        InputError: the name is unknown, or the reader takes no option.
    """
    name, colon, option = name.partition(":")
    if name in TABLES:
        log_map = load_map(TABLES[name])
        read = partial(map_table, log_map=log_map, reader=name)
        reader = Reader(name, log_map.about, read, log_map.recognise)
    elif name in READERS:
        reader = READERS[name]
    else:
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
        try:
            head = _head(path)
        except InputError:
            return None  # reading the file states the error
        return next((r for r in READERS.values() if r.begins and re.match(r.begins, head)), None)
    try:
        names = sorted(entry.name for entry in path.iterdir())
    except OSError as error:
        raise InputError(f"{path}: cannot be read as a folder: {error.strerror}") from error
    if any(name.lower().endswith(_BAG_FOLDER) for name in names):
        return READERS["rosbag"]
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    raise InputError(
        f"{path}: is a folder; expected a file, or the folder of a ROS 2 bag, which has one of "
        f"{', '.join(_BAG_FOLDER)}; found {', '.join(names[:_LISTED]) or 'nothing in it'}{more}"
    )


def _head(path: Path) -> bytes:
    with open_regular(path, "a flight log") as file:
        return file.read(_HEAD)


def unknown_content(path: Path) -> InputError:
    """Return the error for an unknown file without a table's name.

    Raises:
        InputError: the file is unreadable.
    """
    head = _head(path)
    if head.startswith(_GZIP):
        return InputError(
            f"{path}: is packed (gzip); expected a table, .csv.gz by name, or the log unpacked"
        )
    if len(head) > 8 and head[8] in _MAVLINK and path.suffix.lower() in (".tlog", ".rlog"):
        return InputError(
            f"{path}: is telemetry (MAVLink), which has the motors a few times a second; expected "
            "the log that the vehicle wrote itself (.BIN, .ulg)"
        )
    start = head[:16]
    is_text = all(32 <= byte < 127 or byte in b"\t\r\n" for byte in start)
    shown = repr(start.decode("ascii")) if is_text else " ".join(f"{x:02x}" for x in start[:8])
    shown = shown if head else "nothing (it is empty)"
    known = ", ".join(reader.what for reader in READERS.values() if reader.begins)
    return InputError(
        f"{path}: unknown kind of file: it begins with {shown}; expected {known}, "
        f"or a table, with a name that ends in {', '.join(SUFFIXES)}"
    )


def reader_by_columns(path: Path, header: Sequence[str]) -> Reader | None:
    """Return the reader by a table's columns; None: no reader's.

    Raises:
        InputError: the columns fit several readers.
    """
    readers = [reader for reader in table_readers() if set(header).issuperset(reader.signature)]
    if len(readers) > 1:
        raise InputError(
            f"{path}: its columns are those of {' and of '.join(r.what for r in readers)}; "
            f"expected one: choose by --reader {' or --reader '.join(r.name for r in readers)}"
        )
    return readers[0] if readers else None


def table_readers() -> list[Reader]:
    """Return the readers of tables known by their columns."""
    return [*map(find_reader, TABLES), READERS["betaflight_csv"]]
