"""Flight logs of one vehicle, as several commands take them."""

import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..runtime.errors import InputError
from .terminal import note

if TYPE_CHECKING:
    from ..dynamics.vehicle import Vehicle
    from ..identification.logs.flight_log import FlightLog


@dataclass(frozen=True)
class LogOptions:
    """How logs are read: the options of every command that reads some."""

    reader: str | None = None
    map: str | None = None
    piece: int | None = None
    vehicle: str | None = None


AS_THEY_ARE = LogOptions()


def read_flights(
    paths: Sequence[Path], reading: LogOptions = AS_THEY_ARE
) -> "tuple[list[FlightLog], Vehicle]":
    """Read flights of one vehicle, given or named by the logs.

    Raises:
        InputError: an unreadable log; or no given vehicle, and the logs name none, an unknown one,
            or several.
    """
    from ..dynamics.vehicle_file import load_vehicle, named_vehicle

    model = None if reading.vehicle is None else load_vehicle(reading.vehicle)
    flights = read_logs(paths, reading, model)
    if model is not None:
        return flights, model
    named = [named_vehicle(x.vehicle, path) for path, x in zip(paths, flights, strict=True)]
    for path, other in zip(paths, named, strict=True):
        if other.name != named[0].name:
            raise InputError(
                f"{path}: names the vehicle {other.name}, {paths[0]} names {named[0].name}; "
                "expected logs of one vehicle, or --vehicle"
            )
    return flights, named[0]


def read_logs(
    paths: Iterable[Path], reading: LogOptions, vehicle: "Vehicle | None" = None
) -> "list[FlightLog]":
    """Read flight logs. A reader's warnings stand in the notes of its log.

    Raises:
        InputError: a log cannot be read.
    """
    from ..identification.logs.reading import read_log

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        how = reading.reader, vehicle, reading.map, reading.piece
        return [read_log(path, *how) for path in paths]


def log_notes(texts: Iterable[str]) -> None:
    """Print each note once on standard error, with its count where repeated."""
    for text, count in Counter(texts).items():
        note(text if count == 1 else f"{text} ({count} times)")
