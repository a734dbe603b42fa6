"""What MAVLink comes by: datagrams, or a serial port."""

import importlib
import os
import select
import socket
from typing import Any

from ...runtime.errors import InputError
from ...runtime.extras import need
from .base import Address
from .datagrams import listen


class Datagrams:
    """A link by UDP: listens, and answers whoever spoke last; or calls an address."""

    def __init__(self, text: str, host: str, port: int, calls: bool) -> None:
        self._text, self._host, self._port, self._calls = text, host, port, calls
        self._socket: socket.socket | None = None
        self._peer: Any = None

    @property
    def connected(self) -> bool:
        """Whether there is someone to send to."""
        return self._peer is not None

    def open(self) -> None:
        """Open it.

        Raises:
            InputError: it cannot be opened.
        """
        if not self._calls:
            self._socket = listen(self._text, self._host, self._port)
            return
        try:
            family, kind, protocol, _, self._peer = socket.getaddrinfo(
                self._host, self._port, type=socket.SOCK_DGRAM
            )[0]
        except OSError as error:
            raise InputError(f"{self._text}: {error.strerror or error}") from error
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)

    def read(self, timeout: float) -> bytes:
        """Return what there is, waiting up to ``timeout`` s for it."""
        assert self._socket is not None
        if not select.select([self._socket], [], [], timeout)[0]:
            return b""
        try:
            data, peer = self._socket.recvfrom(65_536)
        except (BlockingIOError, ConnectionError):
            return b""
        self._peer = self._peer if self._calls else peer
        return data

    def write(self, data: bytes) -> None:
        """Send, and do not wait.

        Raises:
            OSError: it does not take more now.
        """
        if self._socket is not None and self._peer is not None:
            self._socket.sendto(data, self._peer)

    def close(self) -> None:
        """Close it."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class SerialPort:
    """A link by a serial port, opened with pyserial."""

    def __init__(self, text: str, path: str, baud: int) -> None:
        self._text, self._path, self._baud = text, path, baud
        self._port: Any = None

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port is not None

    def open(self) -> None:
        """Open it.

        Raises:
            InputError: it cannot be opened.
        """
        need("serial", "mavlink")
        serial: Any = importlib.import_module("serial")
        try:
            self._port = serial.Serial(self._path, self._baud, timeout=0, write_timeout=0)
        except (OSError, ValueError) as error:
            raise InputError(f"{self._text}: cannot be opened: {error}") from error

    def read(self, timeout: float) -> bytes:
        """Return what there is, waiting up to ``timeout`` s for it."""
        if not select.select([self._port], [], [], timeout)[0]:
            return b""
        try:
            return bytes(self._port.read(65_536))
        except OSError as error:
            raise InputError(f"{self._text}: the port went away: {error}") from error

    def write(self, data: bytes) -> None:
        """Send, and do not wait.

        Raises:
            OSError: it does not take more now.
        """
        try:
            self._port.write(data)
        except OSError:
            raise
        except Exception as error:  # pyserial's own: it does not take more now
            raise OSError(str(error)) from error

    def close(self) -> None:
        """Close it."""
        if self._port is not None:
            self._port.close()
            self._port = None


def make_link(address: Address, baud: int) -> Datagrams | SerialPort:
    """Return the link of an address, not yet open; ``baud`` of a serial port that states none.

    Raises:
        InputError: the address is none, or there is no such port.
    """
    if address.scheme in ("udp", "udpin", "udpout"):
        if address.port is None:
            raise InputError(f"{address.text}: no port; expected mavlink:udp://HOST:PORT")
        calls = address.scheme == "udpout"
        host = address.host or ("127.0.0.1" if calls else "0.0.0.0")
        return Datagrams(address.text, host, address.port, calls)
    if address.scheme or not address.path:
        raise InputError(
            f"{address.text}: expected mavlink:udp://HOST:PORT, mavlink:udpout://HOST:PORT or a "
            "serial port such as mavlink:/dev/ttyUSB0"
        )
    if not os.path.exists(address.path):
        raise InputError(f"{address.text}: no such port {address.path}")
    return SerialPort(address.text, address.path, int(address.number("baud", baud, least=1.0)))
