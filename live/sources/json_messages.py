"""Messages of JSON: each is an object of named numbers, or a list of such objects.

An object holds a row of this kit's columns or of a map's, or a part of a row. The field ``seq``
counts the sender's messages: gaps in the count are lost messages. A message beyond 16,384 bytes,
1,024 values or 64 objects is malformed: 0.3 s at 200 Hz fit, and larger ones delay estimates.
"""

import json
import os
import select
import stat
import sys
import time
from typing import Any

from ...runtime.errors import InputError
from ..field_map import FieldMap
from ..filtering import Output
from ..messages import Malformed, Measurement
from ..outputs import as_fields
from .base import WAITS, Source
from .links import Datagrams, sender_name
from .senders import Senders

_AT_ONCE = 64  # datagrams, and objects of one message, taken before their estimates are out
_LARGEST = 16_384  # bytes in a message
_VALUES = 1_024  # in a message
_COLUMNS = "t, px, py, pz, qw, qx, qy, qz and omega1 ... omega4"
_PIECE = 65_536  # bytes read at once
_PIPE_WAITS = 1.0  # s: the writer of a pipe may fly; a pipe holds more than 1 s at 200 Hz


class _JsonSource(Source):
    """Rows from JSON objects."""

    strict = True
    form = ""  # one message

    def _prepare(self) -> None:
        self.expected = f"{self.form}s of JSON with {_COLUMNS}"
        self._map = FieldMap(self.log_map, self.vehicle, self.name)

    def _objects(self, data: bytes, sender: Any = "") -> list[tuple[Any, int]]:
        """Return the objects of a message with their sender, and the time, ns."""
        arrival = time.monotonic_ns()
        objects = self.unless_malformed(self._parse, data) or ()
        return [((item, sender), arrival) for item in objects]

    def _parse(self, data: bytes) -> list[dict[str, Any]]:
        """Return the objects of a message.

        Raises:
            Malformed: there are none, or decoding so many values would delay the stream.
        """
        if len(data) > _LARGEST:
            raise Malformed(f"a {self.form} of more than {_LARGEST} bytes")
        if data.count(b",") >= _VALUES or data.count(b"{") > _AT_ONCE:
            raise Malformed(f"a {self.form} of more than {_VALUES} values or {_AT_ONCE} objects")
        try:
            value = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise Malformed(f"{data[:60]!r}; expected a {self.form} of JSON") from error
        items = value if isinstance(value, list) else [value]
        others = [item for item in items if not isinstance(item, dict)]
        if others or not items:
            shown = json.dumps(others[0] if others else items)[:60]
            raise Malformed(f"{shown}; expected an object of named numbers")
        return items

    def decode(self, message: Any, arrival: int) -> Measurement | None:
        """Return an object's measurement; None: its sender is left out."""
        fields, sender = message
        sample = self._map.sample(fields, arrival)
        if not self._takes(sender, sample):
            return None
        if type(number := fields.get("seq")) is int:
            self.count_lost("", number)
        return sample

    def _takes(self, sender: Any, sample: Measurement) -> bool:
        """Return whether a sender is listened to."""
        return True


class UdpJson(_JsonSource):
    """Datagrams.

    ``udp-json://HOST:PORT`` listens there. ``?reply=1`` sends each estimate back to the sender of
    the last datagram taken. Among two senders of the same quantities the first one is listened to
    (``senders``).
    """

    kind = "udp-json"
    options = ("reply",)
    form = "datagram"

    def _prepare(self) -> None:
        super()._prepare()
        self.answers = self.address.choice("reply", ("0", "1")) == "1"
        if self.address.port is None:
            raise InputError(f"{self.name}: no port; expected udp-json://HOST:PORT")
        self.link = Datagrams(self.address, _LARGEST)
        self._senders = Senders(self.name, self.tallies)

    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return the objects in the datagrams so far."""
        items: list[tuple[Any, int]] = []
        for i in range(_AT_ONCE):
            data = self.unless_malformed(self.link.read, 0.0 if i else timeout)
            if data is None:
                break
            items += self._objects(data, self.link.sender)
        return items

    def _takes(self, sender: Any, sample: Measurement) -> bool:
        if not self._senders.take(sender_name(sender), sample.measured, sample.arrival):
            return False
        sample.anew = self._senders.changed()
        self.link.answer(sender)
        return True

    def send(self, output: Output) -> None:
        """Send the estimate to the last sender, if wanted."""
        if self.answers:
            self.link.write(json.dumps(as_fields(output)).encode())


class JsonLines(_JsonSource):
    """Lines of text on standard input, ``-``: the stream ends with the input."""

    kind = "-"
    form = "line"

    def _prepare(self) -> None:
        if sys.stdin is None or sys.stdin.closed or sys.stdin.isatty():
            raise InputError(
                "-: standard input is a terminal; expected lines of JSON, such as: python "
                "sender.py | windwrench live - --vehicle V"
            )
        self.name = "standard input"
        super()._prepare()
        self._descriptor = sys.stdin.fileno()
        self.paced = not stat.S_ISREG(os.fstat(self._descriptor).st_mode)
        self.patience = _PIPE_WAITS if self.paced else WAITS
        self._rest = b""  # a line so far
        self._ended = False

    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return the objects in the lines so far."""
        if self._ended:
            return None
        if not select.select([self._descriptor], [], [], timeout)[0]:
            return []
        piece = os.read(self._descriptor, _PIECE)
        self._ended = not piece
        *lines, self._rest = (self._rest + (piece or b"\n")).split(b"\n")
        self._rest = self._rest[: _LARGEST + 1]
        return [item for line in lines if line.strip() for item in self._objects(line)]
