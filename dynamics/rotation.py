"""Rotations: unit quaternions (scalar first, Hamilton, body to world) and modified Rodrigues
parameters.

Equation numbers are those of McKinnon and Schoellig, *Unscented External Force and Torque
Estimation for Quadrotors*, IROS 2016, with the sign conventions of body-to-world quaternions (see
docs/estimator.md). The functions are compiled and write into their last argument, so that the
filter allocates nothing in a step; arrays of rotations in Python code are better served by
``scipy.spatial.transform.Rotation``.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..runtime.compiled import compiled
from ..runtime.vector_lanes import any_of, choose

Array = NDArray[np.float64]


@compiled
def quaternion_multiply(a: Array, b: Array, out: Array) -> None:
    """Write the Hamilton product ``a * b`` of two quaternions (4,) into ``out``, which must be
    neither of them.
    """
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]


@compiled
def quaternion_to_matrix(q: Array, out: Array) -> None:
    """Write the matrix (3, 3) that takes body to world coordinates into ``out``: (7) with
    ``+2 q0 [qv]x``.
    """
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@compiled
def normalise(q: Array) -> None:
    """Scale a quaternion (4,) to unit length, in place."""
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] *= scale


@compiled
def quaternion_from_mrp(rho: Array, out: Array) -> None:
    """Write the quaternion (4,) of the modified Rodrigues parameters (3,) into ``out``, (17).

    An MRP is axis * tan(angle / 4): about a quarter of a small rotation vector.
    """
    square = rho[0] * rho[0] + rho[1] * rho[1] + rho[2] * rho[2]
    scale = 1.0 / (1.0 + square)
    out[0] = (1.0 - square) * scale
    for i in range(3):
        out[1 + i] = 2.0 * rho[i] * scale


@compiled
def mrp_from_quaternion(q: Array, out: Array) -> None:
    """Write the modified Rodrigues parameters (3,) of a unit quaternion (4,) into ``out``, (16).

    A quaternion and its negative are one attitude: the one with a non-negative scalar part is
    taken, so that the result never exceeds 1 in length (half a turn).
    """
    sign = 1.0 if q[0] >= 0.0 else -1.0
    scale = sign / (1.0 + sign * q[0])
    for i in range(3):
        out[i] = q[1 + i] * scale


@compiled
def attitude_error(q: Array, reference: Array, out: Array) -> None:
    """Write the world-frame MRP (3,) that takes ``reference`` to ``q`` into ``out``:
    ``q * conj(reference)``, (25).
    """
    w = q[0] * reference[0] + q[1] * reference[1] + q[2] * reference[2] + q[3] * reference[3]
    x = -q[0] * reference[1] + q[1] * reference[0] - q[2] * reference[3] + q[3] * reference[2]
    y = -q[0] * reference[2] + q[1] * reference[3] + q[2] * reference[0] - q[3] * reference[1]
    z = -q[0] * reference[3] - q[1] * reference[2] + q[2] * reference[1] + q[3] * reference[0]
    sign = choose(w >= 0.0, 1.0, -1.0)
    scale = sign / (1.0 + sign * w)
    out[0] = x * scale
    out[1] = y * scale
    out[2] = z * scale


@compiled
def turn_body(q: Array, wx: float, wy: float, wz: float, dt: float, out: Array) -> None:
    """Write ``q`` turned at the body rate (wx, wy, wz) rad/s for ``dt`` s into ``out``: (11), (13),
    ``-[psi]x``.
    """
    half = 0.5 * dt
    square = half * half * (wx * wx + wy * wy + wz * wz)
    # the series to the last digit of a double: three times as fast as the functions, and safe at
    # zero
    cosine = 1.0 - square / 2.0 * (
        1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0))
    )
    scale = half * (
        1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    )
    large = square >= 0.01
    if any_of(large):
        angle = math.sqrt(square)
        cosine = choose(large, math.cos(angle), cosine)
        scale = choose(large, half * math.sin(angle) / angle, scale)
    x, y, z = wx * scale, wy * scale, wz * scale
    out[0] = q[0] * cosine - q[1] * x - q[2] * y - q[3] * z
    out[1] = q[1] * cosine + q[0] * x + q[2] * z - q[3] * y
    out[2] = q[2] * cosine + q[0] * y + q[3] * x - q[1] * z
    out[3] = q[3] * cosine + q[0] * z + q[1] * y - q[2] * x


def matrix_of(quaternion: Array) -> Array:
    """Return the body-to-world matrix (3, 3) of a unit quaternion (4,)."""
    out = np.empty((3, 3))
    quaternion_to_matrix(np.asarray(quaternion, dtype=np.float64), out)
    return out


def quaternion_of_yaw(yaw: float) -> Array:
    """Return the quaternion (4,) of a turn by ``yaw`` rad about the world's vertical."""
    return np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
