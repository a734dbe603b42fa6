"""Beyond one machine: a Ray cluster, and work spread over it."""

import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from .errors import InputError
from .extras import need

T = TypeVar("T")
R = TypeVar("R")
RETRIES = 3  # of a run or task whose process is lost


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
                address=None if address == "local" else address,
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
    """Check that someone listens at ``HOST:PORT``: Ray itself would try for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=10).close()
    except (OSError, ValueError) as error:
        raise InputError(
            f"--cluster {address}: no Ray cluster there: {error}; expected HOST:PORT or local"
        ) from error


def spread(work: Callable[[T], R], tasks: Sequence[T], address: str) -> Iterator[R]:
    """Yield ``work`` of each task, in order, done on a Ray cluster; what is lost with a process is
    done again.

    Raises:
        InputError: as ``connected``, or a task failed for good.
    """
    with connected(address) as ray:
        remote = ray.remote(num_cpus=1, max_retries=RETRIES)(work)
        for reference in [remote.remote(task) for task in tasks]:
            try:
                yield ray.get(reference)
            except ray.exceptions.RayError as error:
                reason = str(getattr(error, "cause", error)).partition("\n")[0]
                raise InputError(f"--cluster {address}: a task failed: {reason}") from error
