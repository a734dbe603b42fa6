"""Work that threads share out among themselves in compiled code: whoever is free takes the next
piece.

The turns of a piece of work are an array (3,) of whole numbers: pieces that were taken in hand,
pieces that are done, and threads that no longer look whether there is more to do. A thread that
sleeps takes 0.15 ms to wake, the work of one or two environments; so a helper looks for a while
before it sleeps. Turns that open in the very moment in which it gives up do without it, and it is
called back for the next.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .compiled import compiled
from .direct_call import released

_LOOKS = 100_000  # at a number, some 0.2 ms: about as long as the last piece takes
PATIENCE = (
    5 * _LOOKS
)  # of a helper, until the next work: a step's Python takes 0.1 ms, a small policy some tenths


def _pointer(builder: Any, address: Any) -> Any:
    return builder.inttoptr(address, ir.IntType(64).as_pointer())


@intrinsic  # type: ignore[untyped-decorator]
def _add_one(_typing_context: Any, address: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        return builder.atomic_rmw(
            "add", _pointer(builder, given[0]), ir.Constant(ir.IntType(64), 1), "acq_rel"
        )

    return types.int64(types.int64), generate


@intrinsic  # type: ignore[untyped-decorator]
def _read(_typing_context: Any, address: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        return builder.load_atomic(_pointer(builder, given[0]), "acquire", 8)

    return types.int64(types.int64), generate


@intrinsic  # type: ignore[untyped-decorator]
def _take(_typing_context: Any, address: Any) -> Any:
    """Return a number and leave zero."""

    def generate(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        return builder.atomic_rmw(
            "xchg", _pointer(builder, given[0]), ir.Constant(ir.IntType(64), 0), "acq_rel"
        )

    return types.int64(types.int64), generate


@compiled
def take_turn(turns: np.ndarray) -> int:
    """Return the number of the next piece of work, which nobody else has; beyond the last there is
    none.
    """
    return _add_one(turns.ctypes.data)  # type: ignore[no-any-return]


@compiled
def turn_done(turns: np.ndarray) -> None:
    """Say that a piece is done, and with it all that was written for it."""
    _add_one(turns.ctypes.data + 8)


@compiled
def more_turns(turns: np.ndarray, count: int, patience: int) -> bool:
    """Return whether turns for ``count`` pieces open, and are not all taken, within ``patience``
    looks.
    """
    for _ in range(patience):  # noqa: SIM110  # slower as a generator
        if _read(turns.ctypes.data) < count:
            return True
    return False


@compiled
def leave(turns: np.ndarray) -> None:
    """Say that this thread no longer looks for turns."""
    _add_one(turns.ctypes.data + 16)


@released
def open_turns(turns: np.ndarray) -> int:
    """Let turns be taken from the first on; return how many threads had left, which are called back
    now.

    Who takes a turn sees all that was written before this.
    """
    _take(turns.ctypes.data + 8)
    _take(turns.ctypes.data)
    return _take(turns.ctypes.data + 16)  # type: ignore[no-any-return]


@released
def watch(turns: np.ndarray, count: int) -> bool:
    """Return whether ``count`` pieces are done within a moment; this thread keeps its processor
    busy meanwhile.
    """
    for _ in range(_LOOKS):  # noqa: SIM110  # slower as a generator
        if _read(turns.ctypes.data + 8) >= count:
            return True
    return False
