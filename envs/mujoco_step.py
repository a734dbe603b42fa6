"""MuJoCo's step as compiled code calls it: by its address in C, or through its Python binding."""

from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import mujoco

from ..runtime.addresses import MissingFunctionError, as_c_function, library_function


class Step(NamedTuple):
    """A step of one world: compiled code calls ``function(model, data)``, all three addresses."""

    function: int
    model: int
    data: int
    kept: object  # must live as long as the addresses are used


@cache
def mj_step_address() -> int:
    """Return the address of ``void mj_step(const mjModel *, mjData *)`` in the library that the
    Python package has loaded.

    Raises:
        MissingFunctionError: the package does not hold its library, or its objects their addresses,
            where they always did.
    """
    folder = Path(mujoco.__file__).parent
    for kind in (mujoco.MjModel, mujoco.MjData):
        if not hasattr(kind, "_address"):
            raise MissingFunctionError(f"the address of {kind.__name__}")
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            return library_function(path, "mj_step")
    raise MissingFunctionError(f"mj_step (no libmujoco in {folder})")


def step_in_c(model: "mujoco.MjModel", data: "mujoco.MjData") -> Step:
    """Return MuJoCo's own step in C.

    Raises:
        MissingFunctionError: as ``mj_step_address``.
    """
    return Step(mj_step_address(), model._address, data._address, (model, data))


def step_through_python(model: "mujoco.MjModel", data: "mujoco.MjData") -> Step:
    """Return the step of MuJoCo's Python binding, which runs the same code in C: slower, and bit
    for bit the same.
    """
    function, kept = as_c_function(partial(mujoco.mj_step, model, data))
    return Step(function, 0, 0, kept)
