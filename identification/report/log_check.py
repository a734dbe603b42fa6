"""The check of a flight log: reader and map with reasons, channels with rates and gaps, doubts."""

import re
import warnings
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError, UnreadLogError
from ..diagnosis.settings import DIAGNOSIS
from ..logs.flight_log import FlightLog, excerpt, flown_vehicle
from ..logs.flight_phases import flew
from ..logs.log_map import MAPS, map_names
from ..logs.map_guess import Guess, guess_map
from ..logs.map_text import map_yaml
from ..logs.mapped_log import map_table
from ..logs.reading import finished, opened, read_log, reader_by_columns
from ..logs.screening import LEAST_SECONDS, check_conventions, screen_log
from ..logs.table import Data, Names, Table
from ..motion.noise_spectrum import noise_spectra
from .log_channels import Channel, log_channels
from .words import first_doubt, warnings_in, without_warning

_SAID = ("unit", "samples", "rate_hz", "gaps", "longest_gap_s")  # attributes of each channel


@dataclass(frozen=True)
class _LogCheck:
    """The result of a check."""

    log: FlightLog
    read_by: str
    channels: list[Channel]
    doubts: Names  # of the reading; the gravest first
    limits: Names  # not shown by the log
    flew: tuple[str, str]  # and the reason
    guess: Guess | None
    map_text: str  # the log's map as a YAML file; empty without one

    def headline(self) -> str:
        """Return the gravest doubt, and what flew how long and how far."""
        answer, by = self.flew
        what = self.log.vehicle or self.log.flown.airframe
        told = first_doubt(self.doubts)
        if answer.startswith("yes"):
            told.append(f"Flight of {answer[5:]}{f' by {what}' if what else ''}: {by}.")
        elif answer == "unknown":
            told.append(f"Nothing shows a flight: {by}.")
        return " ".join(told)

    def what_flew(self) -> list[Names]:
        """Return facts of the vehicle and its flight: name, value, source."""
        return [*self.log.flown.rows(), ("flew", *self.flew)]

    def as_dict(self) -> Data:
        """Return the check as plain values."""
        log = self.log
        return {
            "headline": self.headline(),
            "log": log.name,
            "read_by": self.read_by,
            "samples": len(log.t),
            "seconds": float(log.t[-1] - log.t[0]),
            "channels": {
                c.name: {key: getattr(c, key) for key in _SAID} | {"range": [c.low, c.high]}
                for c in self.channels
            },
            "vehicle": log.vehicle or None,
            "flown": asdict(log.flown) | dict(zip(("flew", "flew_by"), self.flew, strict=True)),
            "notes": list(log.notes),
            "doubts": [*self.doubts, *self.limits],
            "map": self.map_text or None,
            "fields": [
                {"field": f"{r.section}.{r.field}".rstrip("."), "certain": r.certain, "why": r.why}
                for r in (self.guess.reasons if self.guess else ())
            ],
        }


def check_log(
    path: Path,
    reader: str | None = None,
    vehicle: Vehicle | None = None,
    log_map: str | None = None,
    piece: int | None = None,
) -> _LogCheck:
    """Return the check of a log; a table of unknown columns is read by a guessed map.

    Args:
        path: a log of any readable kind.
        reader: the log's reader, or None.
        vehicle: the vehicle of the flight; None: the shipped one that the log names.
        log_map: the log's map, or None.
        piece: as of ``read_log``.

    Raises:
        InputError: the log cannot be read.
        UnreadLogError: the guessed map, in the error, cannot read the log yet.
    """
    guess, text = None, ""
    table = None if reader or log_map else opened(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the notes say the same
        if log_map is not None:
            log = read_log(path, reader, vehicle, log_map, piece)
            shipped = MAPS / f"{log_map}.yaml" if log_map in map_names() else Path(log_map)
            read_by, text = f"the map {log_map}", shipped.read_text(encoding="utf-8-sig")
        elif table is not None and reader_by_columns(path, table.header) is None:
            log, guess = _guessed(table, vehicle, piece)
            read_by, text = "a map that was guessed", map_yaml(guess)
        else:
            log = read_log(table or path, reader, vehicle, piece=piece)
            named = re.search(r"\(reader ([^()]+)\)$", log.source)
            read_by = f"the reader {named[1]}" if named else "this kit's own format"
    guessed = [
        f"{f'{r.section} {r.field}'.rstrip()} guessed: {r.why}"
        for r in (guess.doubts if guess else ())
    ]
    vehicle = flown_vehicle(vehicle, log.vehicle)
    told = flew(log)
    if told[0] in ("no", "not shown"):
        guessed.insert(0, f"the log does not show a flight: {told[1]}")
    doubts = _doubts(log, guessed, vehicle)
    limits = [
        f"the noise of the {c.channel} falls by f^-{c.slope:.1f} between {c.band_hz[0]:.3g} and "
        f"{c.band_hz[1]:.3g} Hz: it was filtered before it was written, and the log does not show "
        "how large it was"
        for c in noise_spectra(excerpt(log))
        if c.filtered
    ]
    if vehicle is None:
        limits.append("no vehicle is given: the rotor speeds were not checked against its weight")
    return _LogCheck(log, read_by, log_channels(log), doubts, tuple(limits), told, guess, text)


def _guessed(table: Table, vehicle: Vehicle | None, piece: int | None) -> tuple[FlightLog, Guess]:
    guess = guess_map(table, vehicle)
    if vehicle is not None:
        guess = replace(guess, log_map=replace(guess.log_map, vehicle=vehicle.name))
    if guess.missing:
        raise UnreadLogError(f"{table.path}: {guess.lacks}", map_yaml(guess))
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            log = map_table(table, guess.log_map, vehicle, piece=piece)
        return finished(log, vehicle), guess
    except InputError as refused:
        raise UnreadLogError(str(refused), map_yaml(guess)) from refused


def _doubts(log: FlightLog, doubts: list[str], vehicle: Vehicle | None) -> Names:
    """Return the doubts of a log's reading, the gravest first: the given ones, a refusal by a
    diagnosis, warnings.
    """
    told = warnings_in(log.notes)
    least = DIAGNOSIS.least_seconds_each if log.commanded else LEAST_SECONDS
    try:
        if vehicle is None:
            told += check_conventions(log, None)
        else:
            told += map(without_warning, screen_log(log, vehicle, least)[1])
    except InputError as error:
        refusal = str(error).removeprefix(f"{log.source}: ")
        doubts.append(f"diagnose refuses this log: {refusal}")
        told = [text for text in told if text != refusal]
    return tuple(dict.fromkeys([*doubts, *told]))
