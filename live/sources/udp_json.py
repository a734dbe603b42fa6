"""Datagrams of JSON: each an object of named numbers, or a list of such objects.

``udp-json://HOST:PORT`` listens there. An object is a row of this kit's columns, or of those that a
map names, or a part of one; beside them ``seq``, a count of the sender's by which lost ones are
known. With ``?reply=1`` each estimate is sent back to where the last datagram came from.
"""

import json
import time

from ...runtime.errors import InputError
from ..field_map import FieldMap, Malformed
from ..filtering import Output
from ..messages import Sample
from ..outputs import as_fields
from .base import Source
from .links import Datagrams

_AT_ONCE = 64  # datagrams taken before their estimates are out


class UdpJson(Source):
    """Rows of JSON objects that come by UDP."""

    kind, options = "udp-json", ("reply",)

    def _prepare(self) -> None:
        self._reply = self.address.choice("reply", ("0", "1")) == "1"
        if self.address.port is None:
            raise InputError(f"{self.name}: no port; expected udp-json://HOST:PORT")
        self._map = FieldMap(self.log_map, self.vehicle, self.name)
        self.link = Datagrams(self.address, "127.0.0.1")

    def receive(self, timeout: float) -> list[Sample] | None:
        """Return what the datagrams that are there hold."""
        samples: list[Sample] = []
        for i in range(_AT_ONCE):
            data = self.link.read(0.0 if i else timeout)
            if data is None:
                break
            samples += self._samples(data, time.monotonic_ns())
        return samples

    def _samples(self, data: bytes, arrival: int) -> list[Sample]:
        try:
            value = json.loads(data)
        except (ValueError, RecursionError):
            self.malformed(f"{data[:60]!r}; expected a datagram of JSON")
            return []
        found = []
        for item in value if isinstance(value, list) else [value]:
            if not isinstance(item, dict):
                self.malformed(f"{json.dumps(item)[:60]}; expected an object of named numbers")
                continue
            try:
                sample = self._map.sample("json", item, arrival)
            except Malformed as error:
                self.malformed(str(error))
                continue
            sample.kind = _kind(sample)
            if sample.kind == "json":
                self.malformed(
                    f"none of the fields that are looked for; found {', '.join(item)[:200]}; "
                    "expected such as px, omega1, gx, vbat, or those of --map"
                )
                continue
            if type(number := item.get("seq")) is int:
                self.count_lost("", number)
            found.append(self.take_sound(sample))
        return found

    def send(self, output: Output) -> None:
        """Send the estimate to where the last datagram came from, if it wants to know."""
        if self._reply:
            self.link.write(json.dumps(as_fields(output)).encode())

    def expected(self) -> str:
        """Return what must come."""
        return "datagrams of JSON with t, px, py, pz, qw, qx, qy, qz and omega1 ... omega4"


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
