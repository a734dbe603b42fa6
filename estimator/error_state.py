"""The error state (rho, omega, x, v, torque, force): away from an estimate and back into it."""

import math

from ..dynamics.rotation import attitude_error, normalise, quaternion_from_mrp, quaternion_multiply
from ..runtime.compiled import Record, compiled
from ..runtime.vector_lanes import any_of, choose
from .estimate import Array

LARGEST_MRP_VARIANCE = 0.25  # a standard deviation of about 115 degrees


@compiled
def displace(x: Array, column: Array, spread: float, rho: Array, q: Array, out: Array) -> None:
    """Write the sigma point ``spread`` along a column (18,) of the root into ``out``."""
    for i in range(3):
        rho[i] = spread * column[i]
        out[10 + i] = x[10 + i] + spread * column[3 + i]
        out[i] = x[i] + spread * column[6 + i]
        out[7 + i] = x[7 + i] + spread * column[9 + i]
        out[13 + i] = x[13 + i] + spread * column[12 + i]
        out[16 + i] = x[16 + i] + spread * column[15 + i]
    quaternion_from_mrp(rho, q)
    quaternion_multiply(q, x[3:7], out[3:7])


@compiled
def error_from(after: Array, centre: Array, error: Array) -> None:
    """Write the error state (18,) of one sigma point, seen from the central one, into ``error``,
    (25).
    """
    attitude_error(after[3:7], centre[3:7], error[0:3])
    for i in range(3):
        error[3 + i] = after[10 + i] - centre[10 + i]
        error[6 + i] = after[i] - centre[i]
        error[9 + i] = after[7 + i] - centre[7 + i]
        error[12 + i] = after[13 + i] - centre[13 + i]
        error[15 + i] = after[16 + i] - centre[16 + i]


@compiled
def fold(f: Record, base: Array, error: Array) -> None:
    """Make ``base``, which is not the estimate itself, plus the error state (18,) the estimate; the
    mean MRP folds into q, (26), (35), (37).
    """
    x = f.x
    quaternion_from_mrp(error[0:3], f.q)
    quaternion_multiply(f.q, base[3:7], x[3:7])
    normalise(x[3:7])
    for i in range(3):
        x[10 + i] = base[10 + i] + error[3 + i]
        x[i] = base[i] + error[6 + i]
        x[7 + i] = base[7 + i] + error[9 + i]
        x[13 + i] = base[13 + i] + error[12 + i]
        x[16 + i] = base[16 + i] + error[15 + i]


@compiled
def symmetrise(P: Array) -> None:
    """Make P (n, n) symmetric, and bound the attitude's variances, its first, within an MRP's
    meaning.
    """
    n = len(P)
    for i in range(n):
        for j in range(i):
            a = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = a
            P[j, i] = a
    for i in range(3):
        bound_variance(P, i, LARGEST_MRP_VARIANCE)


@compiled
def bound_variance(P: Array, i: int, most: float) -> None:
    """Scale row and column ``i`` of P (n, n) down to a variance of ``most`` where it is larger."""
    wide = P[i, i] > most
    if any_of(wide):
        scale = choose(wide, math.sqrt(most / P[i, i]), 1.0)
        for j in range(len(P)):
            P[i, j] *= scale
            P[j, i] *= scale
