"""The outcomes of a fleet's logs on the disk: one JSON object a line, appended whole.

A killed run leaves at most one torn line, which counts for nothing: its log is done again.
"""

import json
import os
from pathlib import Path
from typing import Any

from ...runtime.errors import InputError

Outcome = dict[str, Any]


class Outcomes(dict[str, Outcome]):
    """Outcomes by their keys, and the file that holds them; a later line of a key counts."""

    def __init__(self, path: Path) -> None:
        """Open the file, or begin it.

        Raises:
            InputError: it cannot be read or written.
        """
        super().__init__()
        self._path = path
        try:
            self._file = open(path, "a+b", buffering=0)  # noqa: SIM115 - closed by ``close``
            self._file.seek(0)
            *lines, torn = self._file.read().split(b"\n")
            if torn:  # a killed run's
                self._append(b"\n")
        except OSError as error:
            raise self._refused(error) from error
        for line in (*lines, torn):
            outcome = _parsed(line)
            if outcome is not None:
                self[outcome["key"]] = outcome

    def add(self, outcome: Outcome) -> None:
        """Append an outcome, which has its ``key``; it is on the disk when this returns.

        Raises:
            InputError: it cannot be written.
        """
        line = json.dumps(outcome, separators=(",", ":"), allow_nan=False).encode() + b"\n"
        try:
            self._append(line)
        except OSError as error:
            raise self._refused(error) from error
        self[outcome["key"]] = outcome

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _append(self, line: bytes) -> None:
        if self._file.write(line) < len(line):
            raise OSError("the disk is full")
        os.fsync(self._file.fileno())

    def _refused(self, error: OSError) -> InputError:
        return InputError(f"{self._path}: cannot be written: {error.strerror or error}")


def _parsed(line: bytes) -> Outcome | None:
    """Return the outcome of a line, or None where it is torn or something else."""
    try:
        outcome = json.loads(line)
        bytes.fromhex(outcome["key"])
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    return outcome if isinstance(outcome, dict) and "status" in outcome else None
