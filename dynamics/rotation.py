"""Rotations: unit quaternions (scalar first, Hamilton, body to world) and modified Rodrigues
parameters.

Equation numbers: McKinnon and Schoellig, *Unscented External Force and Torque Estimation for
Quadrotors*, IROS 2016. Signs: body-to-world quaternions (see docs/estimator.md). The functions are
compiled and write into their last argument: the filter allocates nothing in a step. For arrays of
rotations in Python code take ``scipy.spatial.transform.Rotation``.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..runtime.compiled import compiled, compiled_inline
from ..runtime.vector_lanes import any_of, choose

Array = NDArray[np.float64]
Numbers = tuple[float, ...]


# Formulas of numbers, shared by compiled loops over many rotations and the functions below; each is
# compiled anew in its caller.


@compiled_inline
def product_of(
    a0: float, a1: float, a2: float, a3: float, b0: float, b1: float, b2: float, b3: float
) -> Numbers:
    """Return the Hamilton product ``a * b`` of two quaternions."""
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


@compiled_inline
def matrix_of_numbers(w: float, x: float, y: float, z: float) -> Numbers:
    """Return the nine numbers, row by row, of the matrix that takes body to world coordinates: (7)
    with ``+2 q0 [qv]x``.
    """
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


@compiled_inline
def product(M: Array, x: float, y: float, z: float) -> Numbers:
    """Return the three numbers of a matrix (3, 3) times a vector."""
    return (
        M[0, 0] * x + M[0, 1] * y + M[0, 2] * z,
        M[1, 0] * x + M[1, 1] * y + M[1, 2] * z,
        M[2, 0] * x + M[2, 1] * y + M[2, 2] * z,
    )


@compiled_inline
def quaternion_of_mrp(r0: float, r1: float, r2: float) -> Numbers:
    """Return the quaternion of modified Rodrigues parameters: (17)."""
    square = r0 * r0 + r1 * r1 + r2 * r2
    scale = 1.0 / (1.0 + square)
    return (1.0 - square) * scale, 2.0 * r0 * scale, 2.0 * r1 * scale, 2.0 * r2 * scale


@compiled_inline
def mrp_between(
    a0: float, a1: float, a2: float, a3: float, b0: float, b1: float, b2: float, b3: float
) -> Numbers:
    """Return the world-frame MRP that takes the quaternion b to a: ``a * conj(b)``, (25)."""
    w = a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3
    sign = choose(w >= 0.0, 1.0, -1.0)
    scale = sign / (1.0 + sign * w)
    return (
        (-a0 * b1 + a1 * b0 - a2 * b3 + a3 * b2) * scale,
        (-a0 * b2 + a1 * b3 + a2 * b0 - a3 * b1) * scale,
        (-a0 * b3 - a1 * b2 + a2 * b1 + a3 * b0) * scale,
    )


@compiled_inline
def turn_of_step(square: float, half: float) -> Numbers:
    """Return the cosine of half a turn, and its sine over the rate, from the square of half the
    angle and half the time step, s: (13) for small angles.

    The series to the last digit of a double: three times as fast as the functions, and safe at
    zero.
    """
    cosine = 1.0 - square / 2.0 * (
        1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0))
    )
    scale = half * (
        1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
    )
    return cosine, scale


@compiled_inline
def large_turn_of_step(square: float, half: float, cosine: float, scale: float) -> Numbers:
    """Return the same for any angle; ``cosine`` and ``scale`` are those of ``turn_of_step``."""
    large = square >= 0.01
    if any_of(large):
        angle = math.sqrt(square)
        cosine = choose(large, math.cos(angle), cosine)
        scale = choose(large, half * math.sin(angle) / angle, scale)
    return cosine, scale


@compiled_inline
def turned_by(
    q0: float, q1: float, q2: float, q3: float, cosine: float, x: float, y: float, z: float
) -> Numbers:
    """Return a quaternion turned by (cosine, x, y, z) in the body frame: (11), ``-[psi]x``."""
    return (
        q0 * cosine - q1 * x - q2 * y - q3 * z,
        q1 * cosine + q0 * x + q2 * z - q3 * y,
        q2 * cosine + q0 * y + q3 * x - q1 * z,
        q3 * cosine + q0 * z + q1 * y - q2 * x,
    )


@compiled
def quaternion_multiply(a: Array, b: Array, out: Array) -> None:
    """Write the Hamilton product ``a * b`` of two quaternions (4,) into ``out``, which must be
    neither of them.
    """
    out[0], out[1], out[2], out[3] = product_of(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])


@compiled
def quaternion_to_matrix(q: Array, out: Array) -> None:
    """Write the matrix (3, 3) that takes body to world coordinates into ``out``: (7) with
    ``+2 q0 [qv]x``.
    """
    R = matrix_of_numbers(q[0], q[1], q[2], q[3])
    out[0, 0], out[0, 1], out[0, 2] = R[0], R[1], R[2]
    out[1, 0], out[1, 1], out[1, 2] = R[3], R[4], R[5]
    out[2, 0], out[2, 1], out[2, 2] = R[6], R[7], R[8]


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
    out[0], out[1], out[2], out[3] = quaternion_of_mrp(rho[0], rho[1], rho[2])


@compiled
def attitude_error(q: Array, reference: Array, out: Array) -> None:
    """Write the world-frame MRP (3,) that takes ``reference`` to ``q`` into ``out``:
    ``q * conj(reference)``, (16), (25).

    A quaternion and its negative are one attitude: the MRP never exceeds 1 in length, half a turn.
    """
    r = reference
    out[0], out[1], out[2] = mrp_between(q[0], q[1], q[2], q[3], r[0], r[1], r[2], r[3])


@compiled
def turn_body(q: Array, wx: float, wy: float, wz: float, dt: float, out: Array) -> None:
    """Write ``q`` turned at the body rate (wx, wy, wz) rad/s for ``dt`` s into ``out``: (11), (13),
    ``-[psi]x``.
    """
    half = 0.5 * dt
    square = half * half * (wx * wx + wy * wy + wz * wz)
    cosine, scale = turn_of_step(square, half)
    cosine, scale = large_turn_of_step(square, half, cosine, scale)
    x, y, z = wx * scale, wy * scale, wz * scale
    out[0], out[1], out[2], out[3] = turned_by(q[0], q[1], q[2], q[3], cosine, x, y, z)


def matrix_of(quaternion: Array) -> Array:
    """Return the body-to-world matrix (3, 3) of a unit quaternion (4,)."""
    out = np.empty((3, 3))
    quaternion_to_matrix(np.asarray(quaternion, dtype=np.float64), out)
    return out


def quaternion_of_yaw(yaw: float) -> Array:
    """Return the quaternion (4,) of a turn by ``yaw`` rad about the world's vertical."""
    return np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
