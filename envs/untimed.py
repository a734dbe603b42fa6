"""MuJoCo's steps without its clock: two dozen readings of the time a step, for ``mjData.timer``,
take more than half of the step of a single free body.
"""

import ctypes
from threading import Lock
from typing import Any

import mujoco

from .. import _core

_STILL = ctypes.CFUNCTYPE(ctypes.c_double)(_core.no_time())  # a clock


class Untimed:
    """Within ``with Untimed():`` no step of this process is timed. After the last block, in any
    thread, MuJoCo's own clock or a user's runs again.
    """

    _lock, _inside = Lock(), 0
    _before: Any = None

    def __enter__(self) -> None:
        with Untimed._lock:
            if Untimed._inside == 0:
                Untimed._before = mujoco.get_mjcb_time()
                mujoco.set_mjcb_time(_STILL)
            Untimed._inside += 1

    def __exit__(self, *_error: object) -> None:
        with Untimed._lock:
            Untimed._inside -= 1
            if Untimed._inside == 0:
                mujoco.set_mjcb_time(Untimed._before)
