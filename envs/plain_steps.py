"""Whether compiled loops call MuJoCo and NumPy in C or through Python, which is plain and slower.

An installation whose MuJoCo or NumPy does not hold its functions where they always were flies all
the same, and says so once. The numbers are the same bit for bit.
"""

import multiprocessing
import os
import sys
from functools import cache
from threading import Lock
from typing import NamedTuple

import mujoco
import numpy as np

from ..runtime.addresses import MissingFunction
from ..runtime.random_normals import (
    Normals,
    normals_address,
    normals_in_c,
    normals_through_python,
)
from .mujoco_step import Step, mj_step_address, step_in_c, step_through_python

VARIABLE = "WINDWRENCH_PLAIN_STEPS"  # of the environment: 1 asks for plain steps
_CHOOSING = Lock()  # a cached function may run twice in two threads, and would say it twice


class _Plain(NamedTuple):
    """What is called through Python."""

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
    """Look once what this installation has; what it lacks is said on stderr, but not by workers."""
    if os.environ.get(VARIABLE, "0") not in ("", "0"):
        plain, reason = _Plain(True, True), f"{VARIABLE} is set"
    else:
        missing = [_missing_in_mujoco(), _missing_in_numpy()]
        plain, reason = _Plain(*map(bool, missing)), ", ".join(filter(None, missing))
    if any(plain) and multiprocessing.parent_process() is None:
        called = " and ".join(
            name for name, is_plain in (("MuJoCo", plain.mujoco), ("NumPy", plain.numpy)) if is_plain
        )
        print(
            f"windwrench: {reason}: {called} are called through Python; flights are "
            f"slower, with the same numbers.",
            file=sys.stderr,
            flush=True,
        )
    return plain


def _missing_in_mujoco() -> str:
    try:
        mj_step_address()
    except MissingFunction as what:
        return f"mujoco {mujoco.__version__} does not offer {what}"
    return ""


def _missing_in_numpy() -> str:
    try:
        normals_address()
    except MissingFunction as what:
        return f"numpy {np.__version__} does not offer {what}"
    return ""
