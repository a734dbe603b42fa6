"""The twelve sigma points of attitude and rate side by side, for a vehicle without wrench effects.

Each loop takes one operation of the model to all points at once, which is what a processor's vector
unit does well. The arithmetic is, operation by operation, that of ``displace``, ``propagate`` and
``error_from`` with one point at a time, and so are the results, bit for bit. Arrays here have a row
for each number and a column for each point.
"""

import math

from ..dynamics.motion import LONG_TURN, gyroscopic_rest
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
        # (17)
        r0, r1, r2 = D[0, k], D[1, k], D[2, k]
        square = r0 * r0 + r1 * r1 + r2 * r2
        scale = 1.0 / (1.0 + square)
        a0, a1, a2, a3 = (
            (1.0 - square) * scale,
            2.0 * r0 * scale,
            2.0 * r1 * scale,
            2.0 * r2 * scale,
        )
        X[3, k] = a0 * q0 - a1 * q1 - a2 * q2 - a3 * q3
        X[4, k] = a0 * q1 + a1 * q0 + a2 * q3 - a3 * q2
        X[5, k] = a0 * q2 - a1 * q3 + a2 * q0 + a3 * q1
        X[6, k] = a0 * q3 + a1 * q2 - a2 * q1 + a3 * q0
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
    J, inverse, com = f.body.inertia, f.body.inverse_inertia, f.body.com
    # read ahead of the loop: a compiler cannot know that the loop does not write there
    J00, J01, J02, J10, J11, J12, J20, J21, J22 = (
        J[0, 0],
        J[0, 1],
        J[0, 2],
        J[1, 0],
        J[1, 1],
        J[1, 2],
        J[2, 0],
        J[2, 1],
        J[2, 2],
    )
    I00, I01, I02, I10, I11, I12, I20, I21, I22 = (
        inverse[0, 0],
        inverse[0, 1],
        inverse[0, 2],
        inverse[1, 0],
        inverse[1, 1],
        inverse[1, 2],
        inverse[2, 0],
        inverse[2, 1],
        inverse[2, 2],
    )
    thrust, moment_x, moment_y, moment_z = (
        f.rotor_wrench[0],
        f.rotor_wrench[1],
        f.rotor_wrench[2],
        f.rotor_wrench[3],
    )
    cx, cy, cz = -com[0], -com[1], -com[2]
    inverse_mass, gravity = 1.0 / f.body.mass, f.body.gravity
    for k in range(POINTS):
        w, x, y, z = X[3, k], X[4, k], X[5, k], X[6, k]
        wx, wy, wz = X[10, k], X[11, k], X[12, k]
        t0, t1, t2 = X[13, k], X[14, k], X[15, k]
        # (7)
        R00, R01, R02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
        R10, R11, R12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
        R20, R21, R22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        # (12)
        hx = J00 * wx + J01 * wy + J02 * wz
        hy = J10 * wx + J11 * wy + J12 * wz
        hz = J20 * wx + J21 * wy + J22 * wz
        tx = moment_x + R00 * t0 + R10 * t1 + R20 * t2 - (wy * hz - wz * hy)
        ty = moment_y + R01 * t0 + R11 * t1 + R21 * t2 - (wz * hx - wx * hz)
        tz = moment_z + R02 * t0 + R12 * t1 + R22 * t2 - (wx * hy - wy * hx)
        ax = I00 * tx + I01 * ty + I02 * tz
        ay = I10 * tx + I11 * ty + I12 * tz
        az = I20 * tx + I21 * ty + I22 * tz
        A[3, k], A[4, k], A[5, k] = ax, ay, az
        # (4) and the way from the centre of mass to the geometric centre
        nx, ny, nz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
        px = ay * cz - az * cy + wy * nz - wz * ny
        py = az * cx - ax * cz + wz * nx - wx * nz
        pz = ax * cy - ay * cx + wx * ny - wy * nx
        A[0, k] = (R02 * thrust + X[16, k]) * inverse_mass + (R00 * px + R01 * py + R02 * pz)
        A[1, k] = (R12 * thrust + X[17, k]) * inverse_mass + (R10 * px + R11 * py + R12 * pz)
        A[2, k] = (
            (R22 * thrust + X[18, k]) * inverse_mass + (R20 * px + R21 * py + R22 * pz) - gravity
        )
    half = 0.5 * dt
    for k in range(POINTS):
        # (11), (13); the series of ``turn_body``
        wx, wy, wz = X[10, k], X[11, k], X[12, k]
        square = half * half * (wx * wx + wy * wy + wz * wz)
        C[0, k] = square
        C[1, k] = 1.0 - square / 2.0 * (
            1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0))
        )
        C[2, k] = half * (
            1.0
            - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
        )
    for k in range(POINTS):
        wx, wy, wz = X[10, k], X[11, k], X[12, k]
        square = dt * dt * (wx * wx + wy * wy + wz * wz)
        far = square > LONG_TURN * LONG_TURN
        if any_of(far):
            rest = gyroscopic_rest(J, inverse, wx, wy, wz, square, dt)
            for i in range(3):
                A[3 + i, k] += choose(far, rest[i], 0.0)
    for k in range(POINTS):
        large = C[0, k] >= 0.01
        if any_of(large):
            angle = math.sqrt(C[0, k])
            C[1, k] = choose(large, math.cos(angle), C[1, k])
            C[2, k] = choose(large, half * math.sin(angle) / angle, C[2, k])
    for k in range(POINTS):
        q0, q1, q2, q3, cosine, scale = X[3, k], X[4, k], X[5, k], X[6, k], C[1, k], C[2, k]
        x, y, z = X[10, k] * scale, X[11, k] * scale, X[12, k] * scale
        X[3, k] = q0 * cosine - q1 * x - q2 * y - q3 * z
        X[4, k] = q1 * cosine + q0 * x + q2 * z - q3 * y
        X[5, k] = q2 * cosine + q0 * y + q3 * x - q1 * z
        X[6, k] = q3 * cosine + q0 * z + q1 * y - q2 * x
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
        a0, a1, a2, a3 = X[3, k], X[4, k], X[5, k], X[6, k]
        w = a0 * q0 + a1 * q1 + a2 * q2 + a3 * q3
        sign = choose(w >= 0.0, 1.0, -1.0)
        scale = sign / (1.0 + sign * w)
        D[0, k] = (-a0 * q1 + a1 * q0 - a2 * q3 + a3 * q2) * scale
        D[1, k] = (-a0 * q2 + a1 * q3 + a2 * q0 - a3 * q1) * scale
        D[2, k] = (-a0 * q3 - a1 * q2 + a2 * q1 + a3 * q0) * scale
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
