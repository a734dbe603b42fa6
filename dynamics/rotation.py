"""Rotations: unit quaternions, scalar first, Hamilton, body to world.

The functions that run at every step are the core's, ``core/rotation.hpp``. For arrays of rotations
take ``scipy.spatial.transform.Rotation``.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core

Array = NDArray[np.float64]


def matrix_of(quaternion: ArrayLike) -> Array:
    """Return the body-to-world matrix (3, 3) of a unit quaternion (4,): (7) of McKinnon and
    Schoellig, IROS 2016, with ``+2 q0 [qv]x``.
    """
    out = np.empty((3, 3))
    _core.matrix_of(np.ascontiguousarray(quaternion, dtype=np.float64), out)
    return out


def quaternion_of_yaw(yaw: float) -> Array:
    """Return the quaternion (4,) of a turn by ``yaw`` rad about the world's vertical."""
    return np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
