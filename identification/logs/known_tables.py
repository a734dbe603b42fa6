"""Tables that are not in the kit's own form: known by their columns, or refused with what to do."""

from collections.abc import Sequence
from pathlib import Path

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .flight_log import FlightLog
from .layout_guess import open_any_table
from .log_map import LogMap, load_map, map_names
from .mapped_log import map_table

_SHOWN = 20  # columns that an error lists


def known_map(header: Sequence[str]) -> LogMap | None:
    """Return the map that ships with the kit for a table of these columns, or None: the one that
    asks for the most of them.
    """
    fitting = [
        found
        for found in map(load_map, map_names())
        if found.recognise and set(found.recognise) <= set(header)
    ]
    return max(fitting, key=lambda found: len(found.recognise), default=None)


def read_known_table(path: Path, vehicle: Vehicle | None, missing: str) -> FlightLog:
    """Read a table that the kit knows by its columns.

    Args:
        path: the table.
        vehicle: that flew, or None.
        missing: what to say where the kit does not know it.

    Raises:
        InputError: it does not, or the table is no flight log.
    """
    table, found = open_any_table(path)
    known = known_map(table.header)
    if known is None:
        raise InputError(
            f"{path}: {missing}, found {', '.join(table.header[:_SHOWN])}. A table of other "
            f"columns is read with a map: windwrench check {path.name} --write-map map.yaml "
            "proposes one"
        )
    return map_table(table, found, known, vehicle)
