"""How this kit's inner loops are compiled: one decorator for each purpose."""

import multiprocessing
import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import NumbaExperimentalFeatureWarning, cfunc, njit, typeof
from numba.core import event

from .compile_notice import notice
from .machine_code import code_folder

F = TypeVar("F", bound=Callable[..., Any])

# a record with the same first fields may stand for another: the plant's for the model's
warnings.filterwarnings(
    "ignore", category=NumbaExperimentalFeatureWarning, message=r"(\x1b\[\d+m)*Record"
)


class _Listener(event.Listener):  # type: ignore[misc]  # numba states no types
    """Hears of each function that Numba compiles, and of none loaded from the disk."""

    def on_start(self, event: Any) -> None:
        notice.begin()

    def on_end(self, event: Any) -> None:
        notice.end()


if multiprocessing.parent_process() is None:  # workers leave the telling to their parent
    event.register("numba:compile", _Listener())

# One record of a structured array: compiled code reads its fields as attributes.
Record = Any


def _kept(function: F, **options: Any) -> F:
    with code_folder(function) as is_kept:
        return cast(F, njit(cache=is_kept, **options)(function))


def compiled(function: F) -> F:
    """Compile a function at its first call and keep the machine code on disk; numbers come out the
    same bit for bit.

    Strict arithmetic: with reordered sums a cached process could give other bits than a fresh one.
    """
    return _kept(function)


def compiled_without_gil(function: F) -> F:
    """Compile like ``compiled``; other threads run Python while a call from Python lasts."""
    return _kept(function, nogil=True)


def compiled_for_vectors(function: F) -> F:
    """Compile like ``compiled``, without the checks of each division for zero: with them loops over
    many numbers use no vector unit.
    """
    return _kept(function, error_model="numpy")


def compiled_inline(function: F) -> F:
    """Compile a part of a ``compiled_for_vectors`` function, anew in each place for the arrays
    there.
    """
    return _kept(function, error_model="numpy", inline="always")


def compiled_callback(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator for a C function of a signature, compiled at once and called through its
    ``address``.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        with code_folder(function) as is_kept:
            return cfunc(signature, cache=is_kept)(function)

    return decorate


def specialised(function: Callable[..., Any], *arguments: object) -> Callable[..., Any]:
    """Return the machine code of a compiled function for arguments of these types, compiled now at
    the latest.

    A call takes 0.1 us; a call of the function itself first finds out about types and takes 0.4 us.
    Arrays must be of just these types, without a check.
    """
    entry: Callable[..., Any] = function.compile(tuple(typeof(argument) for argument in arguments))  # type: ignore[attr-defined]
    return entry
