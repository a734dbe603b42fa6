"""Functions and memory by their addresses: a compiled loop calls one given filter and holds the
code of no other.

So one compiled call serves environments with arrays of their own, and code is compiled once for all
its callers.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from .compiled import compiled, compiled_callback

Array = NDArray[np.float64]
STEP = types.int64(types.int64, types.int64, types.float64, types.float64)


@cache
def _machine_code(function: Callable[..., Any], signature: Any) -> Any:
    return compiled_callback(signature)(function)


def address_of(function: Callable[..., Any], signature: Any = STEP) -> int:
    """Return the address of a plain function (default: a filter's step), compiled now at the
    latest.
    """
    return int(_machine_code(function, signature).address)


@intrinsic  # type: ignore[untyped-decorator]
def call_step(
    _typing_context: Any, address: Any, record: Any, parts: Any, dt: Any, voltage: Any
) -> Any:
    """Call the step at ``address`` for the filter in ``record``; return the parts of ``record.z``
    in use.
    """
    signature = types.int64(types.int64, record, types.int64, types.float64, types.float64)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        whole, real = ir.IntType(64), ir.DoubleType()
        kind = ir.FunctionType(whole, [whole, whole, real, real])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(target, [builder.ptrtoint(arguments[1], whole), *arguments[2:]])

    return signature, generate


@intrinsic  # type: ignore[untyped-decorator]
def call_at(_typing_context: Any, address: Any, *arguments: Any) -> Any:
    """Call the C function at ``address``, without a result, with whole numbers of 64 bits or
    addresses.
    """
    signature = types.void(
        types.int64, types.StarArgTuple.from_types((types.int64,) * len(arguments))
    )

    def generate(context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        values = cgutils.unpack_tuple(builder, given[1])
        kind = ir.FunctionType(ir.VoidType(), [value.type for value in values])
        builder.call(builder.inttoptr(given[0], kind.as_pointer()), values)
        return context.get_dummy_value()

    return signature, generate


@intrinsic  # type: ignore[untyped-decorator]
def pointer_to(_typing_context: Any, address: Any) -> Any:
    """Return an address as a pointer, for ``carray``."""

    def generate(context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        return builder.inttoptr(given[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@compiled
def numbers_at(address: int, shape: Any) -> Array:
    """Return the array of 64-bit floats of a shape, a tuple, that lies at ``address``; whoever owns
    it keeps it alive.
    """
    return carray(pointer_to(address), shape, np.float64)  # type: ignore[no-any-return]
