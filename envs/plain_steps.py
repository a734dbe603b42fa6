"""Whether compiled loops call MuJoCo and NumPy in C or, plain and slower, through Python.

An installation whose MuJoCo or NumPy does not hold its functions where they always were flies all
the same, to the same numbers bit for bit, and says so once.
"""

import multiprocessing
import os
import sys
from functools import cache
from threading import Lock
from typing import NamedTuple

import mujoco
import numpy as np

from ..runtime.addresses import MissingFunctionError
from ..runtime.random_normals import (
    Normals,
    normals_address,
    normals_in_c,
    normals_through_python,
)
from .mujoco_step import Step, mj_step_address, step_in_c, step_through_python

VARIABLE = "WINDWRENCH_PLAIN_STEPS"  # of the environment: with 1, both are called through Python
_CHOOSING = Lock()  # a cached function may run twice in two threads, and would say it twice


class _Plain(NamedTuple):
    """Which libraries are called through Python."""

    mujoco: bool
    numpy: bool


def step_of(model: "mujoco.MjModel", data: "mujoco.MjData") -> Step:
    """Return MuJoCo's step of a world, for compiled code."""
    return step_through_python(model, data) if _plain().mujoco else step_in_c(model, data)


def normals_of(generator: np.random.Generator, count: int) -> Normals:
    """Return a generator's unit normals for compiled code that draws ``count`` at a time."""
    return normals_through_python(generator, count) if _plain().numpy else normals_in_c(generator)


def _plain() -> _Plain:
    with _CHOOSING:
        return _choose()


@cache
def _choose() -> _Plain:
    """Look once what there is; say on stderr what is missing, unless this is a worker process."""
    if os.environ.get(VARIABLE, "0") not in ("", "0"):
        plain, reason = _Plain(True, True), f"{VARIABLE} is set"
    else:
        missing = {"mujoco": _missing_in_mujoco(), "numpy": _missing_in_numpy()}
        plain = _Plain(**{library: bool(what) for library, what in missing.items()})
        reason = "; ".join(filter(None, missing.values()))
    if any(plain) and multiprocessing.parent_process() is None:
        called = " and ".join(
            name for name, is_plain in zip(("MuJoCo", "NumPy"), plain, strict=True) if is_plain
        )
        print(
            f"windwrench: {reason}: flights call {called} through Python, which takes some 15 % "
            f"longer, more on several threads; the results are the same",
            file=sys.stderr,
            flush=True,
        )
    return plain


def _missing_in_mujoco() -> str:
    try:
        mj_step_address()
    except MissingFunctionError as what:
        return f"mujoco {mujoco.__version__} does not offer {what}"
    return ""


def _missing_in_numpy() -> str:
    try:
        normals_address()
    except MissingFunctionError as what:
        return f"numpy {np.__version__} does not offer {what}"
    return ""
