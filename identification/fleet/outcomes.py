"""The outcomes of a fleet's logs on the disk: one JSON object a line, appended whole.

A killed run leaves at most one torn line, which counts for nothing: its log is done again.
"""

import json
import os
from pathlib import Path
from typing import Any

from ...runtime.errors import InputError
from ...runtime.regular_files import open_regular

Outcome = dict[str, Any]


class Outcomes(dict[str, Outcome]):
    """Outcomes by their keys, and the file that holds them; a later line of a key counts."""

    def __init__(self, path: Path) -> None:
        """Read the file, or begin it.

        Raises:
            InputError: it cannot be read or written.
        """
        super().__init__()
        self._path = path
        self._append(b"")
        with open_regular(path, "a fleet's outcomes") as file:
            *lines, torn = file.read().split(b"\n")
        if torn:  # a killed run's
            self._append(b"\n")
        self.update((found["key"], found) for x in (*lines, torn) if (found := _parsed(x)))

    def add(self, outcome: Outcome) -> None:
        """Append an outcome, which has its ``key``; it is on the disk when this returns.

        Raises:
            InputError: it cannot be written.
        """
        self._append(json.dumps(outcome, separators=(",", ":"), allow_nan=False).encode() + b"\n")
        self[outcome["key"]] = outcome

    def _append(self, data: bytes) -> None:
        try:
            with open(self._path, "ab", buffering=0) as file:
                if file.write(data) < len(data):
                    raise OSError("the disk is full")
                os.fsync(file.fileno())
        except OSError as error:
            reason = error.strerror or error
            raise InputError(f"{self._path}: cannot be written: {reason}") from error


def _parsed(line: bytes) -> Outcome | None:
    """Return the outcome of a line, or None where it is torn or something else."""
    try:
        outcome = json.loads(line)
        bytes.fromhex(outcome["key"])
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    return outcome if isinstance(outcome, dict) and "status" in outcome else None
