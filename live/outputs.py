"""Estimates as text: the columns of ``wrench.csv``."""

from typing import Any, TextIO

from ..identification.wrench_series import COLUMNS
from .filtering import Output
from .outlets import Sink


def _values(output: Output) -> list[float]:
    """Return an estimate by ``COLUMNS``, but the status."""
    return [round(output.t, 9), *output.wrench.tolist(), *output.std.tolist(), output.estimate.nis]


def as_fields(output: Output) -> dict[str, Any]:
    """Return an estimate by the names of ``COLUMNS``, JSON's numbers; the status in a word."""
    values = [x if x == x else None for x in _values(output)]
    return dict(zip(COLUMNS, [*values, output.estimate.status], strict=True))


class Lines(Sink[Output]):
    """Estimates as lines of text in a file."""

    name = "standard output"
    lost = "not told"

    def __init__(self, file: TextIO) -> None:
        self._file = file
        file.write(",".join(COLUMNS) + "\n")

    def add(self, output: Output) -> None:
        """Write an estimate."""
        self.held += 1
        t, *values = _values(output)
        numbers = (f"{x:.9g}" for x in [*values, output.estimate.status_code])
        self._file.write(",".join([repr(t), *numbers]) + "\n")

    def idle(self) -> None:
        """Flush the lines so far."""
        self._file.flush()
        self.rows = self.rows + self.held
        self.held = 0
