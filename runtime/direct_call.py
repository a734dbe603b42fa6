"""Calling compiled code from Python without the look at its arguments' types, and beside other
threads.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit, typeof

F = TypeVar("F", bound=Callable[..., Any])


def released(function: F) -> F:
    """Compile like ``compiled``; other threads run Python while a call from Python lasts."""
    return cast(F, njit(cache=True, nogil=True)(function))


def direct(function: Callable[..., Any], *arguments: object) -> Callable[..., Any]:
    """Return what a compiled function runs for arguments of these types, compiled now if it was not
    before.

    A call of it takes 0.1 us, one of the function itself, which first finds out about types, four
    times that. Arrays must be of just these types: they are not checked.
    """
    entry: Callable[..., Any] = function.compile(tuple(typeof(argument) for argument in arguments))  # type: ignore[attr-defined]
    return entry
