"""The twelve sigma points of attitude and rate side by side, for a vehicle without wrench effects.

Each loop takes one operation of the model to all points at once, which is what a processor's vector
unit does well. The formulas are those of ``displace``, ``propagate`` and ``error_from`` with one
point at a time, and so are the results, bit for bit. Arrays here have a row for each number and a
column for each point.
"""

from ..dynamics.motion import LONG_TURN, accelerations_of, body_numbers, gyroscopic_rest
from ..dynamics.rotation import (
    large_turn_of_step,
    matrix_of_numbers,
    mrp_between,
    product_of,
    quaternion_of_mrp,
    turn_of_step,
    turned_by,
)
from ..runtime.compiled import Record, compiled_for_vectors
from ..runtime.vector_lanes import any_of, choose

PAIRS = 6  # columns of the root that turn or spin the vehicle
POINTS = 2 * PAIRS  # forwards along each, then backwards


@compiled_for_vectors
def spread_points(f: Record, spread: float) -> None:
    """Write the points ``spread`` along the first columns of the root into ``f.points`` (19, 12),
    as ``displace`` does.
    """
    x, S, X, D = f.x, f.S, f.points, f.errors
    for i in range(0, 18, 2):
        for j in range(PAIRS):
            a, b = spread * S[j, i], spread * S[j, i + 1]
            D[i, j], D[i, PAIRS + j] = a, -a
            D[i + 1, j], D[i + 1, PAIRS + j] = b, -b
    q0, q1, q2, q3 = x[3], x[4], x[5], x[6]
    for k in range(POINTS):
        a0, a1, a2, a3 = quaternion_of_mrp(D[0, k], D[1, k], D[2, k])
        X[3, k], X[4, k], X[5, k], X[6, k] = product_of(a0, a1, a2, a3, q0, q1, q2, q3)
    for i in range(3):
        for k in range(POINTS):
            X[10 + i, k] = x[10 + i] + D[3 + i, k]
            X[i, k] = x[i] + D[6 + i, k]
            X[7 + i, k] = x[7 + i] + D[9 + i, k]
            X[13 + i, k] = x[13 + i] + D[12 + i, k]
            X[16 + i, k] = x[16 + i] + D[15 + i, k]


@compiled_for_vectors
def propagate_points(f: Record, dt: float) -> None:
    """Carry ``f.points`` (19, 12) ``dt`` s ahead, in place, as ``propagate`` does: (2)-(5),
    (11)-(14).
    """
    X, C, A = f.points, f.turns, f.accelerations
    J, inverse, w, body = (
        f.body.inertia,
        f.body.inverse_inertia,
        f.rotor_wrench,
        body_numbers(f.body),
    )
    rotors, no_effects = (w[0], w[1], w[2], w[3]), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(POINTS):
        A[0, k], A[1, k], A[2, k], A[3, k], A[4, k], A[5, k] = accelerations_of(
            body,
            matrix_of_numbers(X[3, k], X[4, k], X[5, k], X[6, k]),
            (X[10, k], X[11, k], X[12, k]),
            rotors,
            (X[13, k], X[14, k], X[15, k]),
            (X[16, k], X[17, k], X[18, k]),
            no_effects,
        )
    half = 0.5 * dt
    for k in range(POINTS):
        wx, wy, wz = X[10, k], X[11, k], X[12, k]
        C[0, k] = half * half * (wx * wx + wy * wy + wz * wz)
        C[1, k], C[2, k] = turn_of_step(C[0, k], half)
    for k in range(POINTS):
        wx, wy, wz = X[10, k], X[11, k], X[12, k]
        square = dt * dt * (wx * wx + wy * wy + wz * wz)
        far = square > LONG_TURN * LONG_TURN
        if any_of(far):
            rest = gyroscopic_rest(J, inverse, wx, wy, wz, square, dt)
            for i in range(3):
                A[3 + i, k] += choose(far, rest[i], 0.0)
    for k in range(POINTS):
        C[1, k], C[2, k] = large_turn_of_step(C[0, k], half, C[1, k], C[2, k])
    for k in range(POINTS):
        x, y, z = X[10, k] * C[2, k], X[11, k] * C[2, k], X[12, k] * C[2, k]
        X[3, k], X[4, k], X[5, k], X[6, k] = turned_by(
            X[3, k], X[4, k], X[5, k], X[6, k], C[1, k], x, y, z
        )
    for i in range(3):
        for k in range(POINTS):
            X[i, k] += dt * (X[7 + i, k] + 0.5 * dt * A[i, k])
            X[7 + i, k] += dt * A[i, k]
            X[10 + i, k] += dt * A[3 + i, k]


@compiled_for_vectors
def errors_of_points(f: Record) -> None:
    """Write the error states of ``f.points`` seen from ``f.centre`` into ``f.errors`` (18, 12), as
    ``error_from``, (25).
    """
    X, c, D = f.points, f.centre, f.errors
    q0, q1, q2, q3 = c[3], c[4], c[5], c[6]
    for k in range(POINTS):
        D[0, k], D[1, k], D[2, k] = mrp_between(X[3, k], X[4, k], X[5, k], X[6, k], q0, q1, q2, q3)
    for i in range(3):
        for k in range(POINTS):
            D[3 + i, k] = X[10 + i, k] - c[10 + i]
            D[6 + i, k] = X[i, k] - c[i]
            D[9 + i, k] = X[7 + i, k] - c[7 + i]
            D[12 + i, k] = X[13 + i, k] - c[13 + i]
            D[15 + i, k] = X[16 + i, k] - c[16 + i]


@compiled_for_vectors
def halve_pairs(f: Record, scale: float, weight: float) -> None:
    """Write scaled half differences and half sums of each pair's errors, and their mean, into
    ``f.H``, ``f.E``, ``f.mean``.
    """
    D, T, H, E, mean = f.errors, f.rows, f.H, f.E, f.mean
    for i in range(0, 18, 2):
        for k in range(POINTS):
            T[k, i] = D[i, k]
            T[k, i + 1] = D[i + 1, k]
    for i in range(18):
        mean[i] = 0.0
    for j in range(PAIRS):
        for i in range(18):
            H[j, i] = scale * (T[j, i] - T[PAIRS + j, i])
        for i in range(12):
            total = T[j, i] + T[PAIRS + j, i]
            E[j, i] = scale * total
            mean[i] += weight * total  # (26)
