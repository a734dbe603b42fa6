"""A table of text on standard input, a line at a time: a header, then rows of numbers.

Fields are separated by commas, semicolons, tabs or white space, whichever the header has.
"""

import os
import select
import stat
import sys
import time
from typing import Any

from ...identification.logs.text_table import TextLayout
from ...runtime.errors import InputError
from ..field_map import FieldMap
from ..messages import Malformed, Sample
from .base import WAITS, Source

_PIECE = 65_536  # bytes
_LONGEST = 65_536  # bytes of one line
_PIPE_WAITS = 1.0  # s: what fills a pipe may fly, and less than the pipe holds at 200 Hz


class TextStream(Source):
    """Rows of a table that comes on standard input."""

    kind, paced, patience, strict = "csv", False, _PIPE_WAITS, True
    expected = "rows of a table with a header"

    def _prepare(self) -> None:
        if self.address.path != "-":
            raise InputError(
                f"{self.name}: expected csv:- or -, a table on standard input; windwrench estimate "
                "reads files"
            )
        self.name = "standard input"
        self._map = FieldMap(self.log_map, self.vehicle, self.name)
        self.descriptor: int | None = None  # None: that of standard input
        self._rest = b""
        self._ended = False
        self._layout = TextLayout()
        self._header: list[str] = []

    def open(self) -> None:
        """Take standard input.

        Raises:
            InputError: a person sits there, or nothing does.
        """
        if self.descriptor is not None:
            return
        if sys.stdin is None or sys.stdin.closed or sys.stdin.isatty():
            raise InputError(
                "-: standard input is a terminal; expected a table, such as: windwrench live - "
                "--vehicle V < flight.csv"
            )
        self.descriptor = sys.stdin.fileno()
        if stat.S_ISREG(os.fstat(self.descriptor).st_mode):
            self.patience = WAITS

    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return the lines that are there."""
        assert self.descriptor is not None
        if self._ended:
            return None
        if not select.select([self.descriptor], [], [], timeout)[0]:
            return []
        piece = os.read(self.descriptor, _PIECE)
        arrival = time.monotonic_ns()
        *lines, self._rest = (self._rest + piece).split(b"\n")
        if not piece:
            self._ended = True
            lines, self._rest = [self._rest] if self._rest else [], b""
        elif len(self._rest) > _LONGEST:
            if not self._header:
                raise InputError(
                    f"{self.name}: a line of more than {_LONGEST} bytes; expected a table of text"
                )
            self._rest = self._rest[:_LONGEST]  # no row, once it ends
        return [(line, arrival) for line in lines]

    def decode(self, message: Any, arrival: int) -> Sample | None:
        """Return the row of a line."""
        text = message.decode("utf-8-sig" if not self._header else "utf-8", "replace").strip()
        if not text:
            return None
        if not self._header:
            mark = next((mark for mark in (",", ";", "\t") if mark in text), " ")
            self._layout = TextLayout(mark)
            self._header = self._layout.names(text)
            self.expected = f"rows of a table with {', '.join(self._header)}"
            self._map.check(self._header)
            return None
        fields = self._layout.fields(text)
        if len(fields) == len(self._header) + 1 and not fields[-1]:
            fields.pop()
        if len(fields) != len(self._header):
            raise Malformed(
                f"a row of {len(fields)} field(s); expected {len(self._header)}, as many as the "
                "header"
            )
        values: dict[str, float] = {}
        for name, field in zip(self._header, fields, strict=True):
            value = self._layout.number(field) if name else None
            if value is not None:
                values[name] = value
            elif name:
                raise Malformed(f"field {name}: {field[:60]!r} is not a number")
        sample = self._map.sample("row", values, arrival)
        sample.whole = True
        return sample
