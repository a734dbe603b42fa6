"""NumPy's unit normals of a PCG64 generator, drawn by code that is compiled into its caller: the
same numbers bit for bit, several times as fast as calls of NumPy's own function.

PCG64 (O'Neill, *PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for
Random Number Generation*, 2014): a linear congruential generator of 128 bits, whose state is folded
into 64 bits and rotated. Normals: the ziggurat of Marsaglia and Tsang, *J. Stat. Software* 5 (8),
2000. 99 of 100 draws fall inside its layers; for the others NumPy's function is called at the state
before the draw.
"""

import ctypes
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, types
from numba.core import cgutils
from numba.extending import intrinsic

from .addresses import Array, MissingFunctionError, call_at, pointer_to
from .compiled import compiled, compiled_without_gil
from .random_normals import bits_address, normals_address

try:  # numba's own normals are NumPy's, and so is its ziggurat
    from numba.np.random import _constants as _ziggurat

    _INSIDE, _WIDTHS = _ziggurat.ki_double, _ziggurat.wi_double
except (ImportError, AttributeError):
    _INSIDE, _WIDTHS = np.zeros(256, np.uint64), np.zeros(256)
_MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645


@intrinsic  # type: ignore[untyped-decorator]
def _next_state(_typing_context: Any, low: Any, high: Any, add_low: Any, add_high: Any) -> Any:
    """Return the state that follows one, low and high 64 bits of each."""
    kind = types.UniTuple(types.uint64, 2)

    def generate(context: Any, builder: Any, _signature: Any, given: Any) -> Any:
        whole, half = ir.IntType(128), ir.IntType(64)

        def joined(low: Any, high: Any) -> Any:
            shifted = builder.shl(builder.zext(high, whole), ir.Constant(whole, 64))
            return builder.or_(builder.zext(low, whole), shifted)

        product = builder.mul(joined(given[0], given[1]), ir.Constant(whole, _MULTIPLIER))
        state = builder.add(product, joined(given[2], given[3]))
        parts = (
            builder.trunc(state, half),
            builder.trunc(builder.lshr(state, ir.Constant(whole, 64)), half),
        )
        return cgutils.pack_array(builder, parts)

    return kind(types.uint64, types.uint64, types.uint64, types.uint64), generate


@compiled
def draw_normals(state: int, function: int, bits: int, out: Array) -> None:
    """Fill ``out`` (n,), in any layout, with a generator's next unit normals.

    Args:
        state: address of the generator's state (``pcg_state``).
        function: address of NumPy's normals (``normals_address``).
        bits: address of the generator's ``bitgen_t`` (``bits_address``).
        out: numbers, written.
    """
    memory = carray(pointer_to(state), 4, np.uint64)
    low, high, add_low, add_high = memory[0], memory[1], memory[2], memory[3]
    one = np.empty(1)
    for k in range(len(out)):
        next_low, next_high = _next_state(low, high, add_low, add_high)
        turn = next_high >> np.uint64(58)
        r = next_low ^ next_high
        r = (r >> turn) | (r << ((np.uint64(64) - turn) & np.uint64(63)))
        layer = r & np.uint64(0xFF)
        sign = 1.0 - 2.0 * np.float64(np.int64((r >> np.uint64(8)) & np.uint64(1)))
        size = (r >> np.uint64(9)) & np.uint64(0x000FFFFFFFFFFFFF)
        if size < _INSIDE[layer]:
            out[k] = sign * (np.float64(np.int64(size)) * _WIDTHS[layer])
            low, high = next_low, next_high
        else:
            memory[0], memory[1] = low, high
            call_at(function, bits, 1, one.ctypes.data)
            out[k] = one[0]
            low, high = memory[0], memory[1]
    memory[0], memory[1] = low, high


@compiled_without_gil
def _fill(state: int, function: int, bits: int, out: Array) -> None:
    draw_normals(state, function, bits, out)


def pcg_state(generator: np.random.Generator) -> int:
    """Return the address of a generator's state for ``draw_normals``, good for as long as the
    generator lives; 0 where this NumPy keeps it otherwise, or the generator is another one.
    """
    if type(generator.bit_generator) is not np.random.PCG64 or not _is_numpys():
        return 0
    return _state_address(generator)


def _state_address(generator: np.random.Generator) -> int:
    address = int(generator.bit_generator.ctypes.state_address)
    return int(ctypes.c_uint64.from_address(address).value)


@cache
def _is_numpys() -> bool:
    """Look once whether state, tables and numbers are NumPy's."""
    try:
        function = normals_address()
    except MissingFunctionError:
        return False
    ours, theirs = (np.random.Generator(np.random.PCG64(5)) for _ in range(2))
    given = ours.bit_generator.state["state"]
    expected = [given[name] >> s & (2**64 - 1) for name in ("state", "inc") for s in (0, 64)]
    address, found = _state_address(ours), np.empty(4096)
    if list((ctypes.c_uint64 * 4).from_address(address)) != expected:
        return False
    _fill(address, function, bits_address(ours), found)
    return bool(np.array_equal(found, theirs.standard_normal(found.size)))
