"""Readers of flight logs of other forms. Each states what it assumed, the thrust model above all,
in the log's notes.

A table needs no code: a file in ``identification/logs/maps/`` that says what its columns mean, and
its name in ``TABLES``. A reader of another form is a file in this folder with a function
``read(path, vehicle)`` that returns a FlightLog, and a line in ``READERS``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError, unknown_name
from ..flight_log import FlightLog
from ..log_map import load_map
from ..mapped_log import read_mapped
from . import ardupilot_bin, betaflight_bbl, betaflight_csv, crazyflie_sd, px4_ulog, rosbag


@dataclass(frozen=True)
class Reader:
    """A reader: its name, its function, and the columns or the first bytes by which a log of its
    form is known.
    """

    name: str
    what: str  # a log of its form, in words
    read: Callable[..., FlightLog]  # of a path and a vehicle, which may be None
    signature: tuple[str, ...] = ()  # columns of a table
    begins: tuple[bytes, ...] = ()  # first bytes of a file
    takes_option: bool = False  # ``read`` takes ``option``: the words behind the name's colon


# maps of tables that are known by their columns
TABLES = {
    "nanobench": "nanobench",
    "crazyswarm2": "crazyswarm2",
    "crazyflie_csv": "cflib",
    "crazypad": "crazypad",
    "racer": "racer",
}


def _read_table(path: Path, vehicle: Vehicle | None, name: str) -> FlightLog:
    return read_mapped(path, load_map(TABLES[name]), vehicle, name)


def _table(name: str) -> Reader:
    found = load_map(TABLES[name])
    return Reader(name, found.about, partial(_read_table, name=name), found.recognise)


READERS = {
    reader.name: reader
    for reader in (
        *map(_table, TABLES),
        Reader(
            "crazyflie_sd",
            "a Crazyflie's SD-card log",
            crazyflie_sd.read,
            begins=crazyflie_sd.BEGINS,
        ),
        Reader(
            "betaflight",
            "a blackbox of Betaflight or INAV",
            betaflight_bbl.read,
            begins=betaflight_bbl.BEGINS,
            takes_option=True,
        ),
        Reader(
            "betaflight_csv",
            "a blackbox_decode table",
            betaflight_csv.read,
            betaflight_csv.SIGNATURE,
            takes_option=True,
        ),
        Reader(
            "ardupilot_bin",
            "an ArduPilot log (DataFlash .BIN)",
            ardupilot_bin.read,
            begins=ardupilot_bin.BEGINS,
        ),
        Reader("px4_ulog", "a PX4 log (ULog)", px4_ulog.read, begins=px4_ulog.BEGINS),
        Reader(
            "rosbag",
            "a ROS bag (ROS 1, SQLite or MCAP)",
            rosbag.read,
            begins=rosbag.BEGINS,
            takes_option=True,
        ),
    )
}


def find_reader(name: str) -> Reader:
    """Return the reader of a name, or of ``name:option`` with that option bound.

    Raises:
        InputError: there is none, or it takes no option.
    """
    name, colon, option = name.partition(":")
    if name not in READERS:
        raise unknown_name("reader", name, READERS)
    reader = READERS[name]
    if not colon:
        return reader
    if not reader.takes_option:
        raise InputError(
            f"reader {name!r} takes no option, got {option!r}; expected the name alone"
        )
    return replace(reader, read=partial(reader.read, option=option))
