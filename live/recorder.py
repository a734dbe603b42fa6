"""A flight log written during the flight, readable whatever ends the writing.

Rows are held back for as long as a late one may still come, sorted, and written as whole lines a
few times a second: a killed process loses less than the last second. The last column of a
line is always 1. A line cut anywhere has fewer fields than the header, and the reader of logs
leaves the line out.
"""

import math
import os
from bisect import bisect_left
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

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
from .messages import Row
from .outlets import Sink
from .tallies import Tallies

_SETTLES = 1.0  # s of rows for the choice of channels
_WRITTEN_EVERY = 0.25  # s, stream's time
# columns of each quantity in a row
_CHANNELS = {
    "position": POSE[:3],
    "quaternion": POSE[3:],
    "rotor_speeds": ROTORS,
    "command": COMMANDS,
    "voltage": ("vbat",),
    "force": TRUTH[:3],
    "torque": TRUTH[3:],
    "accelerometer": ACCELEROMETER,
    "gyro": GYRO,
}
_KEPT = ("voltage", "force", "torque")  # a row without one repeats the last


class Recorder(Sink[Row]):
    """Writes rows to a new flight log (``.csv``).

    Writing begins a second into the stream: a stream without rows leaves no file.

    Args:
        path: a new log.
        vehicle: name of the vehicle for the log; empty: not stated.
        tallies: counts rows too late for the recording.
        horizon: largest lateness of a row, s.

    Raises:
        InputError: the name is none of a ``.csv``, or no new file can be written there.
    """

    lost = "not recorded"
    pause = 0.4  # s without a row until all rows are written

    def __init__(self, path: Path, vehicle: str, tallies: Tallies, horizon: float) -> None:
        if path.suffix.lower() != ".csv":
            raise InputError(
                f"--record {path}: expected a name that ends in .csv: a log that can be read "
                "whenever the recording ends is not packed"
            )
        if path.exists():
            raise InputError(f"--record {path}: exists already; expected the name of a new log")
        folder = next(folder for folder in path.absolute().parents if folder.exists())
        if not folder.is_dir() or not os.access(folder, os.W_OK):
            raise InputError(f"--record {path}: {folder} is no folder that can be written to")
        self.path = path
        self.name = f"the recording {path}"
        self._tallies = tallies
        self._horizon = horizon
        name = f"vehicle={vehicle}"
        self._last = name if vehicle and VEHICLE.fullmatch(name) else "whole"
        self._held: list[Row] = []  # by time
        self._channels: dict[str, tuple[str, ...]] = {}  # written ones, with their columns
        self._latest: dict[str, Any] = {}  # values of ``_KEPT``
        self._file: int | None = None
        self._written = -math.inf  # s, time of the last row written
        self._due = -math.inf  # s, when to write next

    @property
    def held(self) -> int:  # type: ignore[override]
        """Rows not yet written."""
        return len(self._held)

    def add(self, row: Row) -> None:
        """Record a row; rows at the same time are joined.

        Raises:
            OSError: the log cannot be written.
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
                held[where] = replace(row, **(row.measured | held[where].measured))
            else:
                held.insert(where, row)
        newest = held[-1].t
        begun = self._file is not None or newest - held[0].t > _SETTLES
        if begun and newest >= self._due:
            self._write(newest - self._horizon)
            self._due = newest + _WRITTEN_EVERY

    def idle(self) -> None:
        """Write the rows held for a log already begun."""
        if self._file is not None:
            self._write(math.inf)

    def end(self) -> None:
        """Write the last rows; fewer than two rows make no log."""
        if self._file is not None or len(self._held) >= 2:
            self._write(math.inf)

    def close(self) -> None:
        """Close the log; one without a row is taken away."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
            if not self.rows:
                self.path.unlink()

    def _write(self, until: float) -> None:
        if self._file is None:
            self._begin()
        assert self._file is not None
        count = sum(row.t <= until for row in self._held)
        data = "".join(map(self._line, self._held[:count])).encode()
        while data:
            done = os.write(self._file, data)
            whole = data.count(b"\n", 0, done)
            if whole:
                self._written = self._held[whole - 1].t
            del self._held[:whole]
            self.rows += whole
            data = data[done:]

    def _begin(self) -> None:
        """Choose the columns by the rows so far, and write their names."""
        measured = not all(row.commanded for row in self._held)
        if not measured:  # the first rows had no command yet
            self._held = [row for row in self._held if row.command is not None]
        there = {
            name: [value for row in self._held if (value := getattr(row, name)) is not None]
            for name in _CHANNELS
        }
        chosen = {name: bool(values) for name, values in there.items()}
        for name in ("command", "force", "torque"):
            chosen[name] = len(there[name]) == len(self._held)
        chosen |= {"position": True, "quaternion": True, "rotor_speeds": measured}
        self._channels = {name: _CHANNELS[name] for name, taken in chosen.items() if taken}
        self._latest = {name: there[name][0] for name in _KEPT if chosen[name]}
        names = ["t", *(column for columns in self._channels.values() for column in columns)]
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        os.write(self._file, (",".join([*names, self._last]) + "\n").encode())

    def _line(self, row: Row) -> str:
        fields = [repr(round(row.t, 9))]
        for name, columns in self._channels.items():
            value = getattr(row, name)
            if name in _KEPT:
                value = self._latest[name] = self._latest[name] if value is None else value
            numbers = [] if value is None else np.atleast_1d(value).tolist()
            fields += map(repr, numbers) if numbers else [""] * len(columns)
        return ",".join([*fields, "1"]) + "\n"
