"""How this kit's inner loops are compiled."""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])

# One record of a structured array: compiled code reads its fields as attributes.
Record = Any


def compiled(function: F) -> F:
    """Compile a function at its first call and keep the machine code on disk; numbers come out the same bit for bit.

    Strict arithmetic: with reordered sums a cached process could give other bits than a fresh one.
    """
    return cast(F, njit(cache=True)(function))


def is_compiled(function: Callable[..., Any]) -> bool:
    """Return whether a compiled function's machine code is in memory already."""
    return bool(cast(Any, function).signatures)


@contextmanager
def announced(patience: float = 2.0) -> Iterator[None]:
    """Say on stderr what takes so long if the block, a first call of compiled code, lasts longer than ``patience`` s."""
    timer = threading.Timer(patience, lambda: print(
        "windwrench: compiling its inner loops, once for this installation (about 20 s) ...", file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
