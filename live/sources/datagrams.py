"""Listening for datagrams."""

import select
import socket

from ...runtime.errors import InputError

_BUFFER = 4 * 2**20  # bytes that wait for us, of which the system gives what it allows


def listen(text: str, host: str, port: int) -> socket.socket:
    """Return a socket that listens at an address; ``text`` names it in errors.

    Raises:
        InputError: there is no such address here, or another listens at it.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
        )[0]
        found = socket.socket(family, kind, protocol)
        try:
            found.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            found.setblocking(False)
            found.bind(address)
        except OSError:
            found.close()
            raise
    except (OSError, OverflowError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{text}: cannot listen at {host}:{port}: {reason}") from error
    return found


def wait_for(opened: socket.socket, timeout: float) -> bool:
    """Return whether something comes within ``timeout``, s."""
    return bool(select.select([opened], [], [], timeout)[0])
