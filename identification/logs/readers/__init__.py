"""Readers of flight logs of other forms. Each states what it assumed, the thrust model above all,
in the log's notes.

To add one: a file in this folder with a function ``read(path, vehicle)`` that returns a FlightLog,
and a line in ``READERS``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from ....runtime.errors import InputError, unknown_name
from ..flight_log import FlightLog
from . import (
    ardupilot_bin,
    betaflight_bbl,
    betaflight_csv,
    crazyflie_csv,
    crazyflie_sd,
    crazypad,
    crazyswarm2,
    nanobench,
    px4_ulog,
    racer,
    rosbag,
)


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


READERS = {
    reader.name: reader
    for reader in (
        Reader("nanobench", "a NanoBench table", nanobench.read, nanobench.SIGNATURE),
        Reader("crazyswarm2", "a crazyswarm2 table", crazyswarm2.read, crazyswarm2.SIGNATURE),
        Reader(
            "crazyflie_sd",
            "a Crazyflie's SD-card log",
            crazyflie_sd.read,
            begins=crazyflie_sd.BEGINS,
        ),
        Reader(
            "crazyflie_csv",
            "a table of a Crazyflie's log variables",
            crazyflie_csv.read,
            crazyflie_csv.SIGNATURE,
        ),
        Reader("crazypad", "a CrazyPAD table", crazypad.read, crazypad.SIGNATURE),
        Reader("racer", "a table of the racer", racer.read, racer.SIGNATURE),
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
