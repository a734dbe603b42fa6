"""Work that threads share out among themselves in compiled code: whoever is free takes the next piece.

The turns of a piece of work are an array (2,) of whole numbers: pieces that were taken in hand, and pieces that are done.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..dynamics.compiled import compiled
from ..estimator.direct import released

_SPINS = 100_000  # looks at a number, some 0.2 ms: about as long as the last piece takes


def _pointer(builder: Any, address: Any) -> Any:
    return builder.inttoptr(address, ir.IntType(64).as_pointer())


@intrinsic  # type: ignore[untyped-decorator]
def _add_one(_typing_context: Any, address: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        return builder.atomic_rmw("add", _pointer(builder, given[0]), ir.Constant(ir.IntType(64), 1), "acq_rel")

    return types.int64(types.int64), generate


@intrinsic  # type: ignore[untyped-decorator]
def _read(_typing_context: Any, address: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        return builder.load_atomic(_pointer(builder, given[0]), "acquire", 8)

    return types.int64(types.int64), generate


@intrinsic  # type: ignore[untyped-decorator]
def _clear(_typing_context: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        builder.store_atomic(ir.Constant(ir.IntType(64), 0), _pointer(builder, given[0]), "release", 8)
        return context.get_dummy_value()

    return types.void(types.int64), generate


@compiled
def take_turn(turns: np.ndarray) -> int:
    """Return the number of the next piece of work, which nobody else has; beyond the last there is none."""
    return _add_one(turns.ctypes.data)  # type: ignore[no-any-return]


@compiled
def turn_done(turns: np.ndarray) -> None:
    """Say that a piece is done, and with it all that was written for it."""
    _add_one(turns.ctypes.data + 8)


@released
def open_turns(turns: np.ndarray) -> None:
    """Let turns be taken from the first on; who takes one sees all that was written before this."""
    _clear(turns.ctypes.data + 8)
    _clear(turns.ctypes.data)


@released
def watch(turns: np.ndarray, count: int) -> bool:
    """Return whether ``count`` pieces are done within a moment; this thread keeps its processor busy meanwhile."""
    for _ in range(_SPINS):  # noqa: SIM110  # slower as a generator
        if _read(turns.ctypes.data + 8) >= count:
            return True
    return False
