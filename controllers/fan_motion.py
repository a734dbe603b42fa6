"""The family of motions that an informed tracker knows of: those of the fan-tracking scenarios."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = ("still", "sine", "triangle", "ramp")
_RAMP, _SHORTEST, _SHARE = 0.8, 0.5, 8 / 7  # m, m, 1: a ramp ends after 0.8 + 8/7 (travel - 0.5)


def place_after(kind: NDArray[np.int64], speed: Array, travel: Array, time: float) -> Array:
    """Return places (n,) m after ``time`` s of motions ``KINDS[kind]`` (n,) with a largest
    ``speed`` (n,) m/s over ``travel`` (n,) m, each from 0 to positive places first.
    """
    place = np.zeros(len(kind))
    some = np.flatnonzero(kind == 1)
    place[some] = travel[some] * np.sin(speed[some] / travel[some] * time)
    some = np.flatnonzero(kind == 2)
    phase = np.sin(math.pi / 2 * speed[some] / travel[some] * time)
    place[some] = travel[some] * 2 / math.pi * np.arcsin(phase)
    some = np.flatnonzero(kind == 3)
    end = _RAMP + _SHARE * (travel[some] - _SHORTEST)
    place[some] = np.minimum(speed[some] * time, end)
    return place
