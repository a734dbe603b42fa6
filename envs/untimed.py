"""MuJoCo's steps without its clock: it reads the time two dozen times a step for ``mjData.timer``,
which takes more than half of the step of a single free body.
"""

import ctypes
from functools import cache
from typing import Any

import mujoco
from numba import types

from ..runtime.addresses import address_of


def _no_time() -> float:
    return 0.0


@cache
def _clock() -> Any:
    return ctypes.CFUNCTYPE(ctypes.c_double)(address_of(_no_time, types.float64()))


class Untimed:
    """Within ``with Untimed():`` no step of this process is timed; then MuJoCo's own clock runs
    again, or the one that a user had set.
    """

    def __enter__(self) -> None:
        clock = mujoco.get_mjcb_time()
        self._clock = None if clock is _clock() else clock  # another thread's steps are untimed
        mujoco.set_mjcb_time(_clock())

    def __exit__(self, *_error: object) -> None:
        mujoco.set_mjcb_time(self._clock)
