"""MuJoCo's ``mj_step``, called from compiled code: a call through its Python binding would end the compiled loop."""

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..dynamics.errors import InputError


@cache
def mj_step_address() -> int:
    """Return the address of ``void mj_step(const mjModel *, mjData *)`` in the library that the Python package has loaded.

    Raises:
        InputError: the package does not hold its library where it always did.
    """
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            address = ctypes.cast(ctypes.CDLL(str(path)).mj_step, ctypes.c_void_p).value
            assert address is not None
            return address
    raise InputError(f"mujoco {mujoco.__version__}: expected its library (libmujoco) in {folder}; install mujoco's own wheel")


@intrinsic  # type: ignore[untyped-decorator]
def mj_step(_typing_context: Any, function: Any, model: Any, data: Any) -> Any:
    """Call ``mj_step`` at the address ``function``; ``model`` and ``data`` are the addresses of its arguments."""
    signature = types.void(types.int64, types.int64, types.int64)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, pointer])
        target = builder.inttoptr(arguments[0], kind.as_pointer())
        builder.call(target, [builder.inttoptr(argument, pointer) for argument in arguments[1:]])
        return context.get_dummy_value()

    return signature, generate
