"""Arithmetic on the covariance: root, linear part of the model, noise, sums of squares.

A compiler turns the loops over 12 or 18 columns into vector instructions: much work for each
column, several rows at once, no possible alias in memory. Sums keep their order.
"""

import math

import numpy as np

from ..runtime.compiled import Record, compiled, compiled_for_vectors, compiled_inline
from ..runtime.vector_lanes import all_of, choose, first_below, first_column
from .estimate import Array
from .filter_record import N
from .recovery import pose_noise


@compiled
def root_of(P: Array) -> Array:
    """Return the lower root of P (n, n); a pivot eaten by rounding does no harm."""
    n = len(P)
    root = np.zeros((n, n))
    for j in range(n):
        pivot = P[j, j]
        for k in range(j):
            pivot -= root[j, k] * root[j, k]
        root[j, j] = math.sqrt(max(pivot, _least_pivot(P[j, j])))
        for i in range(j + 1, n):
            total = P[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = total / root[j, j]
    return root


@compiled
def divide(root: Array, rows: Array) -> Array:
    """Return ``root^-1 rows`` for a lower triangular root (n, n) and rows (n, m)."""
    n, m = rows.shape
    out = np.empty((n, m))
    for i in range(n):
        inverse = 1.0 / root[i, i]
        for j in range(m):
            out[i, j] = rows[i, j]
        for k in range(i):
            a = root[i, k]
            for j in range(m):
                out[i, j] -= a * out[k, j]
        for j in range(m):
            out[i, j] *= inverse
    return out


@compiled
def divide_transposed(root: Array, rows: Array) -> None:
    """Replace rows (n, m) with ``root'^-1 rows`` for a lower triangular root (n, n)."""
    n, m = rows.shape
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            a = root[k, i]
            for j in range(m):
                rows[i, j] -= a * rows[k, j]
        inverse = 1.0 / root[i, i]
        for j in range(m):
            rows[i, j] *= inverse


@compiled_inline
def _least_pivot(variance: float) -> float:
    """Return the least pivot of a row of the covariance: rounding may eat the smallest pivots, and
    a tiny positive one keeps the filter alive and changes nothing.
    """
    return 1e-14 * variance + 1e-300


@compiled_for_vectors
def root_of_six(f: Record) -> None:
    """Factor P: the first six columns of its lower root into ``S``, the Schur complement of the
    others into ``M``.
    """
    P, S, M = f.P, f.S, f.M
    _six_columns(f, P[0:6], 0)
    for i in range(12):
        for j in range(first_column(M, i), 12):
            M[i, j] = P[6 + i, 6 + j]
    _take_off(S, 0, M)
    for i in range(12):
        for j in range(first_column(M, i)):
            M[i, j] = M[j, i]


@compiled_for_vectors
def root_of_twelve(f: Record) -> None:
    """Do the same with the first twelve columns; nothing of x and v is left in ``M``."""
    P, S, M = f.P, f.S, f.M
    root_of_six(f)
    for r in range(6, 12):
        l0, l1, l2, l3, l4, l5 = S[0, r], S[1, r], S[2, r], S[3, r], S[4, r], S[5, r]
        for i in range(N):
            S[r, i] = (
                P[r, i]
                - l0 * S[0, i]
                - l1 * S[1, i]
                - l2 * S[2, i]
                - l3 * S[3, i]
                - l4 * S[4, i]
                - l5 * S[5, i]
            )
    _six_columns(f, S[6:12], 6)
    _take_off(S, 6, M)
    for i in range(6):
        for j in range(12):
            M[i, j] = 0.0
            M[j, i] = 0.0


@compiled_inline
def _take_off(S: Array, first: int, M: Array) -> None:
    """Take the squares of six columns off their Schur complement."""
    for i in range(0, 12, 2):
        a0, a1, a2 = S[first, 6 + i], S[first + 1, 6 + i], S[first + 2, 6 + i]
        a3, a4, a5 = S[first + 3, 6 + i], S[first + 4, 6 + i], S[first + 5, 6 + i]
        b0, b1, b2 = S[first, 7 + i], S[first + 1, 7 + i], S[first + 2, 7 + i]
        b3, b4, b5 = S[first + 3, 7 + i], S[first + 4, 7 + i], S[first + 5, 7 + i]
        for j in range(first_column(M, i), 12):
            s0, s1, s2 = S[first, 6 + j], S[first + 1, 6 + j], S[first + 2, 6 + j]
            s3, s4, s5 = S[first + 3, 6 + j], S[first + 4, 6 + j], S[first + 5, 6 + j]
            M[i, j] -= (a0 * s0 + a1 * s1) + (a2 * s2 + a3 * s3) + (a4 * s4 + a5 * s5)
            M[i + 1, j] -= (b0 * s0 + b1 * s1) + (b2 * s2 + b3 * s3) + (b4 * s4 + b5 * s5)


@compiled_inline
def _six_columns(f: Record, rows: Array, first: int) -> None:
    """Write six columns of the root, from ``first`` on, into ``S``; ``rows`` (6, 18) lack the
    columns before.
    """
    P, S, L, scales = f.P, f.S, f.L, f.scales
    for j in range(6):
        pivot = rows[j, first + j]
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        scale = 1.0 / math.sqrt(max(pivot, _least_pivot(P[first + j, first + j])))
        scales[j] = scale
        for r in range(j + 1, 6):
            total = rows[j, first + r]
            for k in range(j):
                total -= L[j, k] * L[r, k]
            L[r, j] = total * scale
    _substitute(L, scales, rows, S[first : first + 6])
    for j in range(6):
        for i in range(first + j):
            S[first + j, i] = 0.0


@compiled_inline
def _substitute(L: Array, scales: Array, rows: Array, out: Array) -> None:
    """Solve ``L out = rows`` for six rows (18,); the diagonal of the lower triangular L is
    ``1 / scales``.
    """
    l10, l20, l21, l30, l31, l32 = L[1, 0], L[2, 0], L[2, 1], L[3, 0], L[3, 1], L[3, 2]
    l40, l41, l42, l43 = L[4, 0], L[4, 1], L[4, 2], L[4, 3]
    l50, l51, l52, l53, l54 = L[5, 0], L[5, 1], L[5, 2], L[5, 3], L[5, 4]
    c0, c1, c2, c3, c4, c5 = scales[0], scales[1], scales[2], scales[3], scales[4], scales[5]
    for i in range(N):
        s0 = rows[0, i] * c0
        s1 = (rows[1, i] - l10 * s0) * c1
        s2 = (rows[2, i] - l20 * s0 - l21 * s1) * c2
        s3 = (rows[3, i] - l30 * s0 - l31 * s1 - l32 * s2) * c3
        s4 = (rows[4, i] - l40 * s0 - l41 * s1 - l42 * s2 - l43 * s3) * c4
        s5 = (rows[5, i] - l50 * s0 - l51 * s1 - l52 * s2 - l53 * s3 - l54 * s4) * c5
        out[0, i], out[1, i], out[2, i], out[3, i], out[4, i], out[5, i] = s0, s1, s2, s3, s4, s5


@compiled_inline
def _linear_rows(f: Record, dt: float, source: Array, out: Array, columns: int) -> None:
    """Apply the linear part of the model to the rows (x, v, torque, force) of ``source`` (12, n):
    ``out`` (18, n).
    """
    J, R, com = f.body.inverse_inertia, f.centre_rotation, f.body.com
    R00, R01, R02 = R[0, 0], R[0, 1], R[0, 2]
    R10, R11, R12 = R[1, 0], R[1, 1], R[1, 2]
    R20, R21, R22 = R[2, 0], R[2, 1], R[2, 2]
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = (
        J[0, 0] * R00 + J[0, 1] * R01 + J[0, 2] * R02,
        J[0, 0] * R10 + J[0, 1] * R11 + J[0, 2] * R12,
        J[0, 0] * R20 + J[0, 1] * R21 + J[0, 2] * R22,
        J[1, 0] * R00 + J[1, 1] * R01 + J[1, 2] * R02,
        J[1, 0] * R10 + J[1, 1] * R11 + J[1, 2] * R12,
        J[1, 0] * R20 + J[1, 1] * R21 + J[1, 2] * R22,
        J[2, 0] * R00 + J[2, 1] * R01 + J[2, 2] * R02,
        J[2, 0] * R10 + J[2, 1] * R11 + J[2, 2] * R12,
        J[2, 0] * R20 + J[2, 1] * R21 + J[2, 2] * R22,
    )
    cx, cy, cz, gain = com[0], com[1], com[2], dt / f.body.mass
    offset = cx != 0.0 or cy != 0.0 or cz != 0.0
    for j in range(columns):
        t0, t1, t2 = source[6, j], source[7, j], source[8, j]
        wx = dt * (a0 * t0 + a1 * t1 + a2 * t2)
        wy = dt * (b0 * t0 + b1 * t1 + b2 * t2)
        wz = dt * (c0 * t0 + c1 * t1 + c2 * t2)
        f0, f1, f2 = source[9, j], source[10, j], source[11, j]
        vx, vy, vz = gain * f0, gain * f1, gain * f2
        if offset:
            # the geometric centre also moves with the angular acceleration: com x alpha
            px, py, pz = cy * wz - cz * wy, cz * wx - cx * wz, cx * wy - cy * wx
            vx += R00 * px + R01 * py + R02 * pz
            vy += R10 * px + R11 * py + R12 * pz
            vz += R20 * px + R21 * py + R22 * pz
        v0, v1, v2 = source[3, j], source[4, j], source[5, j]
        x0, x1, x2 = source[0, j], source[1, j], source[2, j]
        out[0, j], out[1, j], out[2, j] = 0.0, 0.0, 0.0
        out[3, j], out[4, j], out[5, j] = wx, wy, wz
        out[6, j], out[7, j], out[8, j] = (
            x0 + dt * (v0 + 0.5 * vx),
            x1 + dt * (v1 + 0.5 * vy),
            x2 + dt * (v2 + 0.5 * vz),
        )
        out[9, j], out[10, j], out[11, j] = v0 + vx, v1 + vy, v2 + vz
        out[12, j], out[13, j], out[14, j] = t0, t1, t2
        out[15, j], out[16, j], out[17, j] = f0, f1, f2


@compiled_for_vectors
def carry_linear_part(f: Record, dt: float) -> None:
    """Write ``M A'`` into ``Z`` and ``A M A'`` into P, with the linear part A of the model at
    ``f.centre_rotation``. The attitude's columns are zero.
    """
    P, Z = f.P, f.Z
    _linear_rows(f, dt, f.M, Z.T, 12)
    for i in range(N):
        for j in range(3):
            P[i, j] = 0.0
    _linear_rows(f, dt, Z[:, 3:], P[:, 3:], N - 3)


@compiled
def carry_by_jacobian(P: Array, A: Array, G: Array) -> None:
    """Replace P (18, 18) by ``F P F' = P + A P + (A P)' + A P A'``. ``A`` (12, 18) has the rows of
    F - 1 beside its zero rows, and is sparse. ``G`` (12, 18) is overwritten.
    """
    for i in range(12):
        for j in range(N):
            G[i, j] = 0.0
        for k in range(N):
            a = A[i, k]
            if a != 0.0:
                for j in range(N):
                    G[i, j] += a * P[k, j]
    for i in range(12):
        for j in range(N):
            P[i, j] += G[i, j]
            P[j, i] += G[i, j]
        for k in range(N):
            a = A[i, k]
            if a != 0.0:
                for j in range(12):
                    P[j, i] += a * G[j, k]


@compiled_inline
def add_squares(
    P: Array, rows: Array, first: int, sign: float, size: int, written: bool = False
) -> None:
    """Add ``sign r' r`` to the first ``size`` rows and columns of P for six rows (18,) of ``rows``
    from ``first`` on, six at once for speed. ``written``: the caller writes rows 0-2 and 6-8 anew
    afterwards, and pairs of these are left out.
    """
    r0, r1, r2, r3, r4, r5 = first, first + 1, first + 2, first + 3, first + 4, first + 5
    for i in range(0, size, 2):
        if written and (i == 0 or i == 6):
            continue
        a0, a1, a2 = sign * rows[r0, i], sign * rows[r1, i], sign * rows[r2, i]
        a3, a4, a5 = sign * rows[r3, i], sign * rows[r4, i], sign * rows[r5, i]
        b0, b1, b2 = sign * rows[r0, i + 1], sign * rows[r1, i + 1], sign * rows[r2, i + 1]
        b3, b4, b5 = sign * rows[r3, i + 1], sign * rows[r4, i + 1], sign * rows[r5, i + 1]
        for j in range(first_column(P, i), size):
            s0, s1, s2 = rows[r0, j], rows[r1, j], rows[r2, j]
            s3, s4, s5 = rows[r3, j], rows[r4, j], rows[r5, j]
            a = (a0 * s0 + a1 * s1) + (a2 * s2 + a3 * s3) + (a4 * s4 + a5 * s5)
            b = (b0 * s0 + b1 * s1) + (b2 * s2 + b3 * s3) + (b4 * s4 + b5 * s5)
            P[i, j] += a
            P[i + 1, j] += b
            if j >= first_below(P, i + 1):
                P[j, i] += a
                P[j, i + 1] += b


@compiled_for_vectors
def add_pairs(f: Record, first: int) -> None:
    """Add ``H' H + E' E`` of six pairs of sigma points, from ``first`` on, to P; only the first 12
    rows of the model are nonlinear.
    """
    add_squares(f.P, f.H, first, 1.0, N)
    add_squares(f.P, f.E, first, 1.0, 12)


@compiled_for_vectors
def add_noise(f: Record, rotation: Array, dt: float) -> None:
    """Add ``B Q B'`` to P: the sum of 24 of the 61 sigma points, (27)."""
    P, J, c, B = f.P, f.body.inverse_inertia, f.body.com, f.B
    # stated per period: white noise averages over a longer step, a walk grows
    white, walk = f.period / dt, dt / f.period
    offset = c[0] != 0.0 or c[1] != 0.0 or c[2] != 0.0
    for n in range(3):
        P[12 + n, 12 + n] += walk * f.torque_walk[n]
        P[15 + n, 15 + n] += walk * f.force_walk[n]
        torque, thrust = (
            dt * math.sqrt(white * f.motor_torque[n]),
            dt * math.sqrt(white * f.thrust[n]) / f.body.mass,
        )
        for i in range(3):
            B[n, 3 + i] = torque * J[i, n]
            B[3 + n, 9 + i] = thrust * rotation[i, n]
            B[3 + n, 6 + i] = 0.5 * dt * B[3 + n, 9 + i]
        if offset:
            ax, ay, az = J[0, n], J[1, n], J[2, n]
            px, py, pz = c[1] * az - c[2] * ay, c[2] * ax - c[0] * az, c[0] * ay - c[1] * ax
            for i in range(3):
                B[n, 9 + i] = torque * (
                    rotation[i, 0] * px + rotation[i, 1] * py + rotation[i, 2] * pz
                )
                B[n, 6 + i] = 0.5 * dt * B[n, 9 + i]
    if offset:
        add_squares(P, B, 0, 1.0, N)
        return
    # else torque and thrust have nothing to do with each other: two blocks
    for i in range(3, 6):
        for j in range(3, 6):
            P[i, j] += B[0, i] * B[0, j] + B[1, i] * B[1, j] + B[2, i] * B[2, j]
    for i in range(6, 12):
        for j in range(6, 12):
            P[i, j] += B[3, i] * B[3, j] + (B[4, i] * B[4, j] + B[5, i] * B[5, j])


@compiled_for_vectors
def whiten(f: Record) -> None:
    """Write the whitened cross covariance of the measurement (rho, x) into ``f.W`` and its part in
    the mean into ``f.mean``.

    Expects the root of the innovation's covariance in ``f.L``, its inverse diagonal in
    ``f.scales``, and the whitened innovation; all zero for parts not measured.
    """
    P, W, L, scales, y, mean = f.P, f.W, f.L, f.scales, f.innovation, f.mean
    y0, y1, y2, y3, y4, y5 = y[0], y[1], y[2], y[3], y[4], y[5]
    for i in range(N):
        for j in range(3):
            W[j, i], W[3 + j, i] = P[j, i], P[6 + j, i]
    _substitute(L, scales, W, W)
    for i in range(N):
        mean[i] = (
            W[0, i] * y0 + W[1, i] * y1 + W[2, i] * y2 + W[3, i] * y3 + W[4, i] * y4 + W[5, i] * y5
        )


@compiled_for_vectors
def subtract_squares(f: Record) -> None:
    """Take ``W' W`` off P. Of measured rows ``R S^-1`` remains and is written as such: with a noise
    R of 1e-16 of them the difference would be rounding alone.
    """
    P, W, L, c, T = f.P, f.W, f.L, f.scales, f.E
    add_squares(P, W, 0, -1.0, N, all_of((c[0] > 0.0) & (c[3] > 0.0)))
    for j in range(N):
        t5 = W[5, j] * c[5]
        t4 = (W[4, j] - L[5, 4] * t5) * c[4]
        t3 = (W[3, j] - L[4, 3] * t4 - L[5, 3] * t5) * c[3]
        t2 = (W[2, j] - L[3, 2] * t3 - L[4, 2] * t4 - L[5, 2] * t5) * c[2]
        t1 = (W[1, j] - L[2, 1] * t2 - L[3, 1] * t3 - L[4, 1] * t4 - L[5, 1] * t5) * c[1]
        t0 = W[0, j] - L[1, 0] * t1 - L[2, 0] * t2 - L[3, 0] * t3 - L[4, 0] * t4 - L[5, 0] * t5
        T[0, j], T[1, j], T[2, j] = t0 * c[0], t1, t2
        T[3, j], T[4, j], T[5, j] = t3, t4, t5
    for k in range(6):
        row, measured, noise = k if k < 3 else k + 3, c[k] > 0.0, pose_noise(f, k)
        for j in range(N):
            kept = choose(measured, noise * T[k, j], P[row, j])
            P[row, j] = kept
            P[j, row] = kept
