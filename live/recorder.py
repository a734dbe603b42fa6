"""A flight log that grows while the vehicle flies, and can be read whatever ends the writing.

Rows are held back for as long as a late one may still come, sorted, and written as whole lines a
few times a second: a process that is killed loses less than the last second. The last column of a
line is always 1, so a line that was cut within is told from a whole one: it has fewer fields than
the header, and the reader of logs leaves it out.
"""

import math
import os
from bisect import bisect_left
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..dynamics.vehicle_file import preset_names
from ..identification.logs.flight_log import (
    ACCELEROMETER,
    COMMANDS,
    GYRO,
    POSE,
    ROTORS,
    TRUTH,
    VEHICLE,
)
from ..runtime.errors import InputError
from .messages import Array, Row
from .tallies import Tallies


@dataclass(frozen=True)
class RecorderSettings:
    """When rows are written."""

    settles: float = 1.0  # s of rows that are looked at to see which channels there are
    written_every: float = 0.25  # s, stream's time
    idle: float = 0.4  # s without a message after which everything is written


class Recorder:
    """Writes rows to a new flight log (``.csv``).

    Nothing is written before the stream has run for a second: one that turns out to be none leaves
    no file.

    Args:
        path: the log; it must not exist.
        vehicle: that flies.
        tallies: where rows are counted that could not be recorded.
        horizon: s that a row may be late.

    Raises:
        InputError: the name is none of a ``.csv``, or there is such a file already.
    """

    def __init__(
        self,
        path: Path,
        vehicle: Vehicle,
        tallies: Tallies,
        horizon: float,
        preset: bool = False,
        settings: RecorderSettings | None = None,
    ) -> None:
        if path.suffix.lower() != ".csv":
            raise InputError(
                f"--record {path}: expected a name that ends in .csv: a log that can be read "
                "whenever the recording ends is not packed"
            )
        if path.exists():
            raise InputError(f"--record {path}: exists already; expected the name of a new log")
        self.path, self.rows = path, 0
        self._tallies, self._horizon = tallies, horizon
        self._settings = settings or RecorderSettings()
        named = preset or vehicle.name not in preset_names()
        name = f"vehicle={vehicle.name}"
        self._last = name if named and VEHICLE.fullmatch(name) else "whole"
        self._held: list[Row] = []  # by time
        self._groups: dict[str, tuple[str, ...]] = {}
        self._file: int | None = None
        self._written = -math.inf  # s, time of the last row written
        self._due = -math.inf  # s, when to write next
        self._volts: float | None = None
        self._truth: dict[str, Array | None] = {}  # the last of each

    def add(self, row: Row) -> None:
        """Record a row; one of a time that there is already is joined with it.

        Raises:
            InputError: the log cannot be written.
        """
        if row.t <= self._written:
            self._tallies.counts["not recorded"] += 1
            return
        held = self._held
        if not held or row.t > held[-1].t:
            held.append(row)
        else:
            where = bisect_left(held, row.t, key=lambda one: one.t)
            if held[where].t == row.t:
                held[where] = _joined(held[where], row)
            else:
                held.insert(where, row)
        newest = held[-1].t
        begun = self._file is not None or newest - held[0].t > self._settings.settles
        if begun and newest >= self._due:
            self._write(newest - self._horizon)
            self._due = newest + self._settings.written_every

    def idle(self, seconds: float) -> None:
        """Write what is held, if nothing has come for a while."""
        if seconds > self._settings.idle and self._file is not None:
            self._write(math.inf)

    def close(self) -> None:
        """Write all that is left, and close the log; fewer than two rows make none."""
        if self._file is not None or len(self._held) >= 2:
            self._write(math.inf)
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _write(self, until: float) -> None:
        count = (
            sum(1 for row in self._held if row.t <= until) if until < math.inf else len(self._held)
        )
        if self._file is None:
            self._begin()
        if not count:
            return
        rows, self._held = self._held[:count], self._held[count:]
        self._put("".join(map(self._line, rows)))
        self._written = rows[-1].t
        self.rows += count

    def _put(self, text: str) -> None:
        data = text.encode()
        try:
            assert self._file is not None
            while data:
                data = data[os.write(self._file, data) :]
        except OSError as error:
            raise InputError(
                f"--record {self.path}: cannot be written: {error.strerror or error}; what was "
                "recorded before is a whole log"
            ) from error

    def _begin(self) -> None:
        """Choose the columns by what has come, and write their names."""
        held = self._held
        groups = {"t": ("t",), "pose": POSE}
        if not all(row.commanded for row in held):
            groups["rotors"] = ROTORS
        if all(row.command is not None for row in held):
            groups["commands"] = COMMANDS
        elif "rotors" not in groups:  # the first rows had none yet
            self._held = held = [row for row in held if row.command is not None]
            groups["commands"] = COMMANDS
        volts = [row.voltage for row in held if row.voltage is not None]
        if volts:
            groups["vbat"], self._volts = ("vbat",), volts[0]
        for name, columns in (
            ("force", TRUTH[:3]),
            ("torque", TRUTH[3:]),
            ("accelerometer", ACCELEROMETER),
            ("gyro", GYRO),
        ):
            there = [getattr(row, name) is not None for row in held]
            if any(there) if columns in (ACCELEROMETER, GYRO) else all(there):
                groups[name] = columns
        self._groups = groups
        names = [name for columns in groups.values() for name in columns]
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        except OSError as error:
            raise InputError(
                f"--record {self.path}: cannot be written: {error.strerror or error}"
            ) from error
        self._put(",".join([*names, self._last]) + "\n")

    def _line(self, row: Row) -> str:
        fields = []
        for name, columns in self._groups.items():
            if name == "t":
                fields.append(repr(round(row.t, 9)))
            elif name == "vbat":
                self._volts = self._volts if row.voltage is None else row.voltage
                fields.append(repr(self._volts))
            elif name == "pose":
                fields += _fields(row.position, 3) + _fields(row.quaternion, 4)
            elif name == "rotors":
                fields += _fields(row.rotor_speeds, 4)
            elif name == "commands":
                fields += _fields(row.command, 4)
            elif name in ("force", "torque"):
                self._truth[name] = row_value = _or(getattr(row, name), self._truth.get(name))
                fields += _fields(row_value, 3)
            else:
                fields += _fields(getattr(row, name), len(columns))
        return ",".join([*fields, "1"]) + "\n"


def _or(values: Array | None, before: Array | None) -> Array | None:
    return before if values is None else values


def _fields(values: Array | None, count: int) -> list[str]:
    if values is None:
        return [""] * count
    return [repr(value) for value in np.asarray(values).tolist()]


def _joined(row: Row, other: Row) -> Row:
    """Return a row with what another of the same time holds besides."""
    for name in Row.__slots__:
        if getattr(row, name) is None:
            setattr(row, name, getattr(other, name))
    return row
