"""The outcomes of a fleet's logs on the disk: one JSON object a line, appended whole.

A killed run leaves at most one torn line, which counts for nothing: its log is done again.
"""

import json
import os
from pathlib import Path
from typing import Any

from ...runtime.errors import InputError

Outcome = dict[str, Any]


class Outcomes:
    """A file of outcomes, each under a key; only the keys and places are held in memory."""

    def __init__(self, path: Path) -> None:
        """Open the file, or begin it.

        Raises:
            InputError: it cannot be read or written.
        """
        self._path = path
        self._places: dict[bytes, int] = {}
        try:
            self._end = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
            self._file = open(path, "rb")  # noqa: SIM115 - closed by ``close``
            place, line = 0, b"\n"
            for line in self._file:
                outcome = _parsed(line)
                if outcome is not None:
                    self._places[bytes.fromhex(outcome["key"])] = place
                place += len(line)
            if not line.endswith(b"\n"):  # a killed run's
                self._append(b"\n")
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error

    def __contains__(self, key: str) -> bool:
        return bytes.fromhex(key) in self._places

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, key: str) -> Outcome:
        """Return an outcome; a later one under the same key counts."""
        self._file.seek(self._places[bytes.fromhex(key)])
        outcome = _parsed(self._file.readline())
        if outcome is None or outcome["key"] != key:
            raise InputError(f"{self._path}: was changed while it was in use")
        return outcome

    def add(self, outcome: Outcome) -> None:
        """Append an outcome, which has its ``key``; it is on the disk when this returns.

        Raises:
            InputError: it cannot be written.
        """
        line = json.dumps(outcome, separators=(",", ":"), allow_nan=False).encode() + b"\n"
        try:
            place = self._append(line)
        except OSError as error:
            raise InputError(
                f"{self._path}: cannot be written: {error.strerror or error}"
            ) from error
        self._places[bytes.fromhex(outcome["key"])] = place

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        os.close(self._end)

    def _append(self, line: bytes) -> int:
        """Append bytes in one write; return where they begin."""
        written = os.write(self._end, line)
        place = os.lseek(self._end, 0, os.SEEK_CUR) - written
        if written < len(line):
            raise OSError("the disk is full")
        os.fsync(self._end)
        return place


def _parsed(line: bytes) -> Outcome | None:
    """Return the outcome of a line, or None where it is torn or something else."""
    try:
        outcome = json.loads(line)
        bytes.fromhex(outcome["key"])
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    return outcome if isinstance(outcome, dict) and "status" in outcome else None
