"""A table of text on standard input, a line at a time: a header, then rows of numbers.

Fields are separated by commas, semicolons, tabs or white space, whichever the header has.
"""

import math
import os
import select
import sys
import time
from typing import Any

from ...dynamics.vehicle import Vehicle
from ...identification.logs.log_map import LogMap
from ...identification.logs.text_layout import MISSING_WORDS, TextLayout, without_mark
from ...runtime.errors import InputError
from ..field_map import FieldMap, Malformed
from ..filtering import Output
from ..messages import Sample
from ..tallies import Tallies
from .base import Malformed as MalformedMessages

_PIECE = 65_536  # bytes
_LONGEST = 65_536  # bytes of one line


class TextStream:
    """Rows of a table that comes on a file descriptor.

    Args:
        vehicle: that flies.
        log_map: what the columns mean; None: this kit's.
        tallies: where lines are counted that are none.
        descriptor: of the stream; None: standard input.
    """

    name, paced = "standard input", False

    def __init__(
        self,
        vehicle: Vehicle,
        log_map: LogMap | None,
        tallies: Tallies,
        descriptor: int | None = None,
    ) -> None:
        self._map = FieldMap(log_map, vehicle, "standard input")
        self._malformed = MalformedMessages(self.name, tallies)
        self._descriptor = descriptor
        self._rest = b""
        self._ended = False
        self._layout = TextLayout()
        self._header: list[str] = []

    def open(self) -> None:
        """Take standard input.

        Raises:
            InputError: a person sits there, or nothing does.
        """
        if self._descriptor is not None:
            return
        if sys.stdin is None or sys.stdin.closed or sys.stdin.isatty():
            raise InputError(
                "-: standard input is a terminal; expected a table, such as: windwrench live - "
                "--vehicle V < flight.csv"
            )
        self._descriptor = sys.stdin.fileno()

    def receive(self, timeout: float) -> list[Sample] | None:
        """Return the rows of the lines that are there."""
        assert self._descriptor is not None
        if self._ended:
            return None
        if not select.select([self._descriptor], [], [], timeout)[0]:
            return []
        piece = os.read(self._descriptor, _PIECE)
        arrival = time.monotonic_ns()
        *lines, self._rest = (self._rest + piece).split(b"\n")
        if not piece:
            self._ended = True
            lines, self._rest = [self._rest] if self._rest else [], b""
        elif len(self._rest) > _LONGEST:
            raise InputError(
                f"{self.name}: a line of more than {_LONGEST} bytes; expected a table of text"
            )
        samples = []
        for line in lines:
            sample = self._line(line, arrival)
            if sample is not None:
                samples.append(sample)
        return samples

    def _line(self, line: bytes, arrival: int) -> Sample | None:
        text = line.decode("utf-8-sig" if not self._header else "utf-8", "replace").strip()
        if not text:
            return None
        if not self._header:
            self._begin(text)
            return None
        fields = self._layout.fields(text)
        if len(fields) == len(self._header) + 1 and not fields[-1]:
            fields.pop()
        if len(fields) != len(self._header):
            self._malformed.take(
                f"a row of {len(fields)} field(s); expected {len(self._header)}, as many as the "
                "header"
            )
            return None
        try:
            values = {
                name: _number(name, field)
                for name, field in zip(self._header, fields, strict=True)
                if name
            }
            sample = self._map.sample("row", values, arrival)
        except Malformed as error:
            self._malformed.take(str(error))
            return None
        self._malformed.good = True
        sample.whole = True
        return sample

    def _begin(self, text: str) -> None:
        """Take the header."""
        text = without_mark(text)
        separator = next((mark for mark in (",", ";", "\t") if mark in text), " ")
        self._layout = TextLayout(separator)
        self._header = self._layout.names(self._layout.fields(text))
        self._map.check(self._header)

    def send(self, output: Output) -> None:
        """Say nothing: a table cannot be told."""

    def close(self) -> None:
        """Leave standard input as it is."""

    def expected(self) -> str:
        """Return what must come."""
        return "rows of a table with " + ", ".join(self._header or ["a header"])


def _number(name: str, field: str) -> Any:
    if not field or field.lower() in MISSING_WORDS:
        return math.nan
    try:
        return float(field)
    except ValueError:
        raise Malformed(f"field {name}: {field[:60]!r} is not a number") from None
