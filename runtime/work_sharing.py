"""Tasks that threads share out among themselves in compiled code: whoever is free takes the next
one.

``tasks`` is an array (3,) of whole numbers, counted atomically: the tasks that were taken, the
tasks that are done, and the threads that no longer look for tasks. A thread that sleeps takes
0.15 ms to wake, as long as the work of one or two environments; so a helping thread looks for a
while before it sleeps. Tasks that open in the very moment in which it gives up do without it, and
it is called back for the next.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from .compiled import compiled, compiled_without_gil

_LOOKS = 100_000  # at a number, some 0.2 ms: about as long as the last task takes
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
def next_task(tasks: np.ndarray) -> int:
    """Return the number of the next task, which no other thread has; a number beyond the last task
    says that none is left.
    """
    return _add_one(tasks.ctypes.data)  # type: ignore[no-any-return]


@compiled
def task_done(tasks: np.ndarray) -> None:
    """Say that a task is done, and with it all that was written for it."""
    _add_one(tasks.ctypes.data + 8)


@compiled
def tasks_open(tasks: np.ndarray, count: int, patience: int) -> bool:
    """Return whether one of ``count`` tasks is, or comes to be, free within ``patience`` looks."""
    for _ in range(patience):  # noqa: SIM110  # slower as a generator
        if _read(tasks.ctypes.data) < count:
            return True
    return False


@compiled
def stop_looking(tasks: np.ndarray) -> None:
    """Say that this thread no longer looks for tasks."""
    _add_one(tasks.ctypes.data + 16)


@compiled_without_gil
def open_tasks(tasks: np.ndarray) -> int:
    """Let tasks be taken from the first on; return how many threads no longer look, which the
    caller calls back.

    Who takes a task sees all that was written before this.
    """
    _take(tasks.ctypes.data + 8)
    _take(tasks.ctypes.data)
    return _take(tasks.ctypes.data + 16)  # type: ignore[no-any-return]


@compiled_without_gil
def all_done(tasks: np.ndarray, count: int) -> bool:
    """Return whether ``count`` tasks are done within a moment; this thread keeps its processor
    busy meanwhile.
    """
    for _ in range(_LOOKS):  # noqa: SIM110  # slower as a generator
        if _read(tasks.ctypes.data + 8) >= count:
            return True
    return False
