"""A filter's step as an address, so that a compiled loop calls the filter it was given and holds the code of no other."""

from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic

_STEP = types.int64(types.voidptr, types.int64, types.float64, types.float64)


@cache
def _machine_code(step: Callable[..., int]) -> Any:
    return cfunc(_STEP, cache=True)(step)


def address_of(step: Callable[..., int]) -> int:
    """Return the address of ``step(filter's pointer, parts, dt, voltage)``, a plain function, compiled now if it was not."""
    return int(_machine_code(step).address)


@intrinsic  # type: ignore[untyped-decorator]
def call_step(_typing_context: Any, address: Any, record: Any, parts: Any, dt: Any, voltage: Any) -> Any:
    """Call the step at ``address`` for the filter in ``record``; what it returns are the parts of ``record.z`` it used."""
    signature = types.int64(types.int64, record, types.int64, types.float64, types.float64)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer, whole, real = ir.IntType(8).as_pointer(), ir.IntType(64), ir.DoubleType()
        kind = ir.FunctionType(whole, [pointer, whole, real, real])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(target, [builder.bitcast(arguments[1], pointer), *arguments[2:]])

    return signature, generate
