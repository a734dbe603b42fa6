"""How this kit's inner loops are compiled."""

from collections.abc import Callable
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
