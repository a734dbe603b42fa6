"""Datagrams of JSON: each an object of named numbers, or a list of such objects.

``udp-json://HOST:PORT`` listens there. An object is a row of this kit's columns, or of those that a
map names, or a part of one; beside them ``seq``, a count of the sender's by which lost ones are
known. With ``?reply=1`` each estimate is sent back to where the last datagram came from.
"""

import json
import socket
import time
from typing import Any

from ...dynamics.vehicle import Vehicle
from ...identification.logs.log_map import LogMap
from ...runtime.errors import InputError
from ..field_map import FieldMap, Malformed
from ..filtering import Output
from ..messages import Sample
from ..outputs import as_fields
from ..tallies import Tallies
from .base import Malformed as MalformedMessages
from .base import read_address
from .datagrams import listen, wait_for

_LARGEST = 65_536  # bytes of a datagram
_AT_ONCE = 64  # datagrams taken before their estimates are out


class UdpJson:
    """Rows of JSON objects that come by UDP.

    Args:
        text: the address.
        vehicle: that flies.
        log_map: what the fields mean; None: this kit's columns.
        tallies: where messages are counted that are lost or say nothing.

    Raises:
        InputError: the address is none.
    """

    paced = True

    def __init__(
        self, text: str, vehicle: Vehicle, log_map: LogMap | None, tallies: Tallies
    ) -> None:
        address = read_address(text, "udp-json", ("reply",))
        self.name = text
        self._host, self._port = address.host or "127.0.0.1", address.port
        self._reply = address.choice("reply", ("0", "1"), "0") == "1"
        if self._port is None:
            raise InputError(f"{text}: no port; expected udp-json://HOST:PORT")
        self._map = FieldMap(log_map, vehicle, text)
        self._tallies, self._malformed = tallies, MalformedMessages(text, tallies)
        self._socket: socket.socket | None = None
        self._peer: Any = None
        self._sequence: int | None = None

    def open(self) -> None:
        """Begin to listen."""
        assert self._port is not None
        self._socket = listen(self.name, self._host, self._port)

    def receive(self, timeout: float) -> list[Sample] | None:
        """Return what the datagrams that are there hold."""
        assert self._socket is not None
        if not wait_for(self._socket, timeout):
            return []
        samples: list[Sample] = []
        for _ in range(_AT_ONCE):
            try:
                data, self._peer = self._socket.recvfrom(_LARGEST)
            except (BlockingIOError, ConnectionError):
                break
            samples += self._samples(data, time.monotonic_ns())
        return samples

    def _samples(self, data: bytes, arrival: int) -> list[Sample]:
        try:
            value = json.loads(data)
        except (ValueError, RecursionError):
            self._malformed.take(f"{data[:60]!r}; expected a datagram of JSON")
            return []
        found = []
        for item in value if isinstance(value, list) else [value]:
            if not isinstance(item, dict):
                self._malformed.take(
                    f"{json.dumps(item)[:60]}; expected an object of named numbers"
                )
                continue
            try:
                sample = self._map.sample("json", item, arrival)
            except Malformed as error:
                self._malformed.take(str(error))
                continue
            sample.kind = _kind(sample)
            if sample.kind == "json":
                self._malformed.take(
                    f"none of the fields that are looked for; found {', '.join(item)[:200]}; "
                    "expected such as px, omega1, gx, vbat, or those of --map"
                )
                continue
            self._malformed.good = True
            self._count(item.get("seq"))
            found.append(sample)
        return found

    def _count(self, sequence: object) -> None:
        """Count what is missing in the sender's own count."""
        if not isinstance(sequence, int) or isinstance(sequence, bool):
            return
        if self._sequence is not None:
            missing = sequence - self._sequence - 1
            if 0 < missing < 1_000_000:
                self._tallies.counts["lost"] += missing
            elif -1_000 < missing < -1 and self._tallies.counts["lost"] > 0:
                self._tallies.counts["lost"] -= 1  # it was only late
                return
        self._sequence = sequence

    def send(self, output: Output) -> None:
        """Send the estimate to where the last datagram came from, if it wants to know."""
        if self._reply and self._peer is not None and self._socket is not None:
            try:
                self._socket.sendto(json.dumps(as_fields(output)).encode(), self._peer)
            except OSError:
                self._tallies.counts["not sent"] += 1

    def close(self) -> None:
        """Listen no more."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def expected(self) -> str:
        """Return what must come."""
        return "datagrams of JSON with t, px, py, pz, qw, qx, qy, qz and omega1 ... omega4"


def _kind(sample: Sample) -> str:
    """Return what an object holds, in a word."""
    if sample.whole:
        return "row"
    parts = {
        "pose": sample.has_pose,
        "motors": sample.rotor_speeds is not None or sample.command is not None,
        "imu": sample.gyro is not None or sample.accelerometer is not None,
        "battery": sample.voltage is not None,
    }
    return "+".join(name for name, there in parts.items() if there) or "json"
