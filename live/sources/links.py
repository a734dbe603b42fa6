"""Links for messages of bytes: datagrams, or a serial port."""

import importlib
import os
import select
import socket
from abc import ABC, abstractmethod
from contextlib import ExitStack
from typing import Any

from ...runtime.errors import InputError
from ...runtime.extras import need
from ..messages import Malformed
from .base import Address

_AT_ONCE = 65_536  # bytes of one read from a port
# bytes of a MAVLink datagram: 14 of the longest messages, far more than a network takes
_LARGEST = 4096
_BAUD = 57_600  # baud rate of telemetry radios
_BUFFER = 4 * 2**20  # bytes waiting for us, if the system allows as many


class Link(ABC):
    """A link, not yet open.

    Args:
        text: its address, for errors.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self.opened: Any = None  # a socket or a port, once open
        self.peer: Any = None  # receiver of our messages, once known
        self.sender: Any = None  # the last message's

    @abstractmethod
    def open(self) -> str:
        """Open the link; return its place, in words.

        Raises:
            InputError: opening fails.
        """

    @abstractmethod
    def write(self, data: bytes) -> None:
        """Send to the peer, and do not wait.

        Raises:
            OSError: the link takes no more now.
        """

    @abstractmethod
    def _receive(self) -> bytes | None: ...

    def read(self, timeout: float) -> bytes | None:
        """Return the bytes so far, after at most ``timeout`` s; None: there are none.

        Raises:
            Malformed: there are more than in any message.
        """
        return self._receive() if select.select([self.opened], [], [], timeout)[0] else None

    def answer(self, sender: Any) -> None:
        """Send to a sender from now on."""
        self.peer = sender

    def close(self) -> None:
        """Close the link."""
        if self.opened is not None:
            self.opened.close()
            self.opened = self.peer = None


class Datagrams(Link):
    """A link by UDP: calls an address; or listens, on this machine alone unless the address names
    another host, and answers the last sender.

    Args:
        address: host and port.
        largest: most bytes of a datagram; a larger one is left unread.
    """

    def __init__(self, address: Address, largest: int) -> None:
        super().__init__(address.text)
        self._host = address.host or "127.0.0.1"
        self._port = address.port
        self._calls = address.scheme == "udpout"
        self._largest = largest

    def open(self) -> str:
        """Listen, or call."""
        flags = 0 if self._calls else socket.AI_PASSIVE
        where = f"{self._host}:{self._port}"
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(
                self._host, self._port, type=socket.SOCK_DGRAM, flags=flags
            )[0]
            with ExitStack() as unless_open:
                opened = unless_open.enter_context(socket.socket(family, kind, protocol))
                opened.setblocking(False)
                if self._calls:
                    self.peer = address
                else:
                    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
                    opened.bind(address)
                unless_open.pop_all()
            self.opened = opened
        except (OSError, OverflowError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            does = "call" if self._calls else "listen at"
            raise InputError(f"{self._text}: cannot {does} {where}: {reason}") from error
        return f"{'calling' if self._calls else 'listening at'} {where}, UDP"

    def _receive(self) -> bytes | None:
        try:
            data, peer = self.opened.recvfrom(self._largest + 1)
        except (BlockingIOError, ConnectionError):
            return None
        if len(data) > self._largest:
            raise Malformed(f"a datagram of more than {self._largest} bytes")
        self.sender = peer
        self.peer = self.peer or peer
        return bytes(data)

    def answer(self, sender: Any) -> None:
        """Send to a sender from now on, unless an address was called."""
        if not self._calls:
            super().answer(sender)

    def write(self, data: bytes) -> None:
        """Send to the peer, if any."""
        if self.peer is not None:
            self.opened.sendto(data, self.peer)


class _SerialPort(Link):
    """A link by a serial port, opened with pyserial."""

    def __init__(self, address: Address) -> None:
        super().__init__(address.text)
        self._path = address.path
        self._baud = int(address.number("baud", _BAUD, least=1.0))

    def open(self) -> str:
        """Open the port."""
        need("serial", "mavlink")
        serial: Any = importlib.import_module("serial")
        try:
            self.opened = serial.Serial(self._path, self._baud, timeout=0, write_timeout=0)
            self.peer = self.sender = self._path
        except (OSError, ValueError) as error:
            raise InputError(f"{self._text}: cannot be opened: {error}") from error
        return f"reading {self._path} at {self._baud} baud"

    def _receive(self) -> bytes:
        try:
            return bytes(self.opened.read(_AT_ONCE))
        except OSError as error:
            raise InputError(f"{self._text}: the port went away: {error}") from error

    def write(self, data: bytes) -> None:
        """Send by the port."""
        self.opened.write(data)


def sender_name(sender: Any) -> str:
    """Return the name of a link's sender."""
    return sender if isinstance(sender, str) else "{}:{}".format(*sender)


def make_link(address: Address) -> Link:
    """Return the link of an address.

    Raises:
        InputError: the address is wrong, or there is no such port.
    """
    if address.scheme in ("udp", "udpin", "udpout"):
        if address.port is None:
            raise InputError(f"{address.text}: no port; expected mavlink:udp://HOST:PORT")
        return Datagrams(address, _LARGEST)
    if address.scheme or not address.path:
        raise InputError(
            f"{address.text}: expected mavlink:udp://HOST:PORT, mavlink:udpout://HOST:PORT or a "
            "serial port such as mavlink:/dev/ttyUSB0"
        )
    if not os.path.exists(address.path):
        raise InputError(f"{address.text}: no such port {address.path}")
    return _SerialPort(address)
