"""Readers of flight logs of other forms. Each states what it assumed, the thrust model above all, in the log's notes.

To add one: a file in this folder with a function ``read(path, vehicle)`` that returns a FlightLog, and a line in
``READERS``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...dynamics.errors import unknown_name
from ...dynamics.vehicle import Vehicle
from ..flight_log import FlightLog
from . import nanobench


@dataclass(frozen=True)
class Reader:
    """A reader: its name, its function, and the columns by which a log of its form is known."""

    name: str
    read: Callable[[Path, Vehicle | None], FlightLog]
    signature: tuple[str, ...]


READERS = {reader.name: reader for reader in (Reader("nanobench", nanobench.read, nanobench.SIGNATURE),)}


def find_reader(name: str) -> Reader:
    """Return the reader of a name.

    Raises:
        InputError: there is none.
    """
    if name not in READERS:
        raise unknown_name("reader", name, READERS)
    return READERS[name]
