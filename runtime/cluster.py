"""Beyond one machine: a Ray cluster."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .errors import InputError
from .extras import need


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """Give Ray, connected to a cluster's address, or to one of its own on this machine for
    ``local``.

    Raises:
        InputError: Ray is not installed, or there is no cluster at the address.
    """
    need("ray", "cluster")
    import ray

    ours = not ray.is_initialized()
    if ours:
        if address != "local":
            _reach(address)
        try:
            ray.init(
                address=address,  # Ray's own word for a new cluster is "local", too
                include_dashboard=False,
                log_to_driver=False,
                logging_level="error",
            )
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise InputError(f"--cluster {address}: no Ray cluster there: {error}") from error
    try:
        yield ray
    finally:
        if ours:
            ray.shutdown()


def _reach(address: str) -> None:
    """Check for a listener at ``HOST:PORT``: Ray itself would try for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=10).close()
    except (OSError, ValueError) as error:
        raise InputError(
            f"--cluster {address}: no Ray cluster there: {error}; expected HOST:PORT or local"
        ) from error
