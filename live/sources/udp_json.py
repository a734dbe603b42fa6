"""Datagrams of JSON: each an object of named numbers, or a list of such objects.

``udp-json://HOST:PORT`` listens there. An object is a row of this kit's columns, or of those that a
map names, or a part of one; beside them ``seq``, a count of the sender's by which lost ones are
known. With ``?reply=1`` each estimate is sent back to where the last one that was taken came from.
Of two senders of the same quantities the first is listened to (``senders``). Datagrams
beyond 16,384 bytes, 1,024 values or 64 objects are malformed: a batch of 0.3 s at 200 Hz is within
them, and what others cost would delay estimates.
"""

import json
import time
from typing import Any

from ...runtime.errors import InputError
from ..field_map import FieldMap
from ..filtering import Output
from ..messages import Malformed, Sample
from ..outputs import as_fields
from .base import Source
from .links import Datagrams, sender_name
from .senders import Senders

_AT_ONCE = 64  # datagrams, and objects of one, taken before their estimates are out
_LARGEST, _VALUES = 16_384, 1_024  # bytes and values of a datagram


class UdpJson(Source):
    """Rows of JSON objects that come by UDP."""

    kind, options, strict = "udp-json", ("reply",), True
    expected = "datagrams of JSON with t, px, py, pz, qw, qx, qy, qz and omega1 ... omega4"

    def _prepare(self) -> None:
        self.answers = self.address.choice("reply", ("0", "1")) == "1"
        if self.address.port is None:
            raise InputError(f"{self.name}: no port; expected udp-json://HOST:PORT")
        self._map = FieldMap(self.log_map, self.vehicle, self.name)
        self.link = Datagrams(self.address, _LARGEST)
        self._senders = Senders(self.name, self.tallies)

    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return the objects of the datagrams that are there."""
        items: list[tuple[Any, int]] = []
        for i in range(_AT_ONCE):
            data = self.unless_malformed(self.link.read, 0.0 if i else timeout)
            if data is None:
                break
            arrival = time.monotonic_ns()
            objects = self.unless_malformed(_objects, data) or ()
            items += [((item, self.link.sender), arrival) for item in objects]
        return items

    def decode(self, message: Any, arrival: int) -> Sample | None:
        """Return what an object holds, if its sender is listened to."""
        fields, sender = message
        sample = self._map.sample("json", fields, arrival)
        sample.kind = _kind(sample)
        if sample.kind == "json":
            raise Malformed(
                f"none of the fields that are looked for; found {', '.join(fields)[:200]}; "
                "expected such as px, omega1, gx, vbat, or those of --map"
            )
        if not self._senders.take(sender_name(sender), sample.measured, arrival):
            return None
        sample.anew = self._senders.changed()
        self.link.answer(sender)
        if type(number := fields.get("seq")) is int:
            self.count_lost("", number)
        return sample

    def send(self, output: Output) -> None:
        """Send the estimate to the sender that is listened to, if it wants to know."""
        if self.answers:
            self.link.write(json.dumps(as_fields(output)).encode())


def _objects(data: bytes) -> list[dict[str, Any]]:
    """Return the objects of a datagram.

    Raises:
        Malformed: it holds none, or so many values that decoding them would delay the stream.
    """
    if data.count(b",") >= _VALUES or data.count(b"{") > _AT_ONCE:
        raise Malformed(f"a datagram of more than {_VALUES} values or {_AT_ONCE} objects")
    try:
        value = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"{data[:60]!r}; expected a datagram of JSON") from error
    items = value if isinstance(value, list) else [value]
    others = [item for item in items if not isinstance(item, dict)]
    if others or not items:
        shown = json.dumps(others[0] if others else items)[:60]
        raise Malformed(f"{shown}; expected an object of named numbers")
    return items


def _kind(sample: Sample) -> str:
    """Return what an object holds, in a word."""
    if sample.whole:
        return "row"
    parts = {
        "pose": sample.has_pose,
        "motors": sample.has_motors,
        "imu": sample.has_imu,
        "battery": sample.voltage is not None,
    }
    return "+".join(name for name, there in parts.items() if there) or "json"
