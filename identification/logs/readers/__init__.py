"""Readers of flight logs of other forms. Each states what it assumed, the thrust model above all,
in the log's notes.

To add one: a file in this folder with a function ``read(path, vehicle)`` that returns a FlightLog,
and a line in ``READERS``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError, unknown_name
from ..flight_log import FlightLog
from . import crazypad, crazyswarm2, nanobench, px4_ulog, rosbag


@dataclass(frozen=True)
class Reader:
    """A reader: its name, its function, and the columns or the endings by which a log of its form
    is known.
    """

    name: str
    read: Callable[[Path, Vehicle | None], FlightLog]
    signature: tuple[str, ...] = ()  # columns of a table
    suffixes: tuple[str, ...] = ()  # of a file's name
    read_with: Callable[..., FlightLog] | None = (
        None  # takes a third argument, the option behind the name's colon
    )


READERS = {
    reader.name: reader
    for reader in (
        Reader("nanobench", nanobench.read, nanobench.SIGNATURE),
        Reader("crazyswarm2", crazyswarm2.read, crazyswarm2.SIGNATURE),
        Reader("crazypad", crazypad.read, crazypad.SIGNATURE),
        Reader("px4_ulog", px4_ulog.read, suffixes=px4_ulog.SUFFIXES),
        Reader("rosbag", rosbag.read, suffixes=rosbag.SUFFIXES, read_with=rosbag.read),
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
    if reader.read_with is None:
        raise InputError(
            f"reader {name!r} takes no option, got {option!r}; expected the name alone"
        )
    return replace(reader, read=partial(reader.read_with, option=option))
