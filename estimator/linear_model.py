"""The model (2)-(5), (11)-(14), linearised at an estimate.

The filter with a constant gain carries its covariance by the derivatives at hover. The unscented
filter in C needs the derivatives at the estimate, for the linear part of its covariance.
"""

import math

from ..dynamics.model import apply_effects
from ..runtime.compiled import Record, compiled
from .estimate import NIS, Array
from .filter_record import N

# steps of the difference quotients of an effect's wrench; single precision needs larger ones
EFFECT_TURN = 1e-6  # rad
EFFECT_STEP = 1e-5  # m, m/s and rad/s


@compiled
def _add_cross(
    out: Array, row: int, column: int, x: float, y: float, z: float, scale: float
) -> None:
    """Add ``scale * [(x, y, z)]x`` to the block of ``out`` that starts at ``row``, ``column``."""
    out[row, column + 1] -= scale * z
    out[row, column + 2] += scale * y
    out[row + 1, column] += scale * z
    out[row + 1, column + 2] -= scale * x
    out[row + 2, column] -= scale * y
    out[row + 2, column + 1] += scale * x


@compiled
def _add_effect_jacobian(f: Record, A: Array) -> None:
    """Add the derivatives of the declared effects' wrench by (rho, omega, x, v) to those of the
    force, rows 9-11 of ``A``, and of the torque, ``f.torques``; overwrites ``f.rotation`` and
    ``f.effect_wrench``.

    Central differences: an effect model is a black box behind an address.
    """
    x, point, turned, R, change = f.x, f.point, f.rotation, f.centre_rotation, f.innovation
    for n in range(12):
        kind, axis = n // 3, n % 3
        size = EFFECT_TURN if kind == 0 else EFFECT_STEP
        for side in range(2):
            step = size if side == 0 else -size
            for i in range(3):
                for j in range(3):
                    turned[i, j] = R[i, j]
            for i in range(NIS):
                point[i] = x[i]
            if kind == 0:
                a, b, c, s = (axis + 1) % 3, (axis + 2) % 3, math.cos(size), math.sin(step)
                for j in range(3):
                    turned[a, j] = c * R[a, j] - s * R[b, j]
                    turned[b, j] = s * R[a, j] + c * R[b, j]
            else:
                point[axis + (10 if kind == 1 else 0 if kind == 2 else 7)] += step
            apply_effects(f, point[0:3], turned, point[7:10], point[10:13])
            for i in range(6):
                wrench = f.effect_wrench[i]
                change[i] = wrench if side == 0 else change[i] - wrench
        scale = 4.0 if kind == 0 else 1.0  # an MRP is a quarter of an angle
        for i in range(3):
            A[9 + i, n] += scale * (change[i] / (2.0 * size))
            f.torques[i, n] += scale * (change[3 + i] / (2.0 * size))


@compiled
def _add_offset_jacobian(f: Record, A: Array) -> None:
    """Add what the geometric centre's acceleration has beyond that of the centre of mass, at c from
    it: R (alpha x c + omega x (omega x c)), here s in the body frame.
    """
    R, B, w = f.centre_rotation, f.torques, f.x[10:13]
    c0, c1, c2 = -f.body.com[0], -f.body.com[1], -f.body.com[2]
    n0, n1, n2 = w[1] * c2 - w[2] * c1, w[2] * c0 - w[0] * c2, w[0] * c1 - w[1] * c0
    a0, a1, a2 = f.acceleration[3], f.acceleration[4], f.acceleration[5]
    s0 = a1 * c2 - a2 * c1 + w[1] * n2 - w[2] * n1
    s1 = a2 * c0 - a0 * c2 + w[2] * n0 - w[0] * n2
    s2 = a0 * c1 - a1 * c0 + w[0] * n1 - w[1] * n0
    for j in range(N):
        B[0, j] = A[4, j] * c2 - A[5, j] * c1
        B[1, j] = A[5, j] * c0 - A[3, j] * c2
        B[2, j] = A[3, j] * c1 - A[4, j] * c0
    # omega x (omega x c) = omega (omega' c) - c omega' omega
    dot = w[0] * c0 + w[1] * c1 + w[2] * c2
    for i in range(3):
        c = -f.body.com[i]
        B[i, 3] += w[i] * c0 - 2.0 * c * w[0]
        B[i, 4] += w[i] * c1 - 2.0 * c * w[1]
        B[i, 5] += w[i] * c2 - 2.0 * c * w[2]
        B[i, 3 + i] += dot
    for i in range(3):
        for j in range(N):
            A[9 + i, j] += R[i, 0] * B[0, j] + R[i, 1] * B[1, j] + R[i, 2] * B[2, j]
    s3 = R[0, 0] * s0 + R[0, 1] * s1 + R[0, 2] * s2
    s4 = R[1, 0] * s0 + R[1, 1] * s1 + R[1, 2] * s2
    s5 = R[2, 0] * s0 + R[2, 1] * s1 + R[2, 2] * s2
    _add_cross(A, 9, 0, s3, s4, s5, -4.0)


@compiled
def acceleration_jacobian(f: Record, A: Array, effects: bool) -> None:
    """Write the derivatives of the accelerations at ``f.x`` by the error state into ``A`` (12, 18),
    rows 3-5 and 9-11; those of declared effects where ``effects`` says so.

    Rows 3-5 are the angular acceleration (body), rows 9-11 the geometric centre's (world): (4),
    (12). Expects ``f.rotation``, ``f.acceleration`` and ``f.effect_wrench`` of the estimate, as
    ``propagate`` leaves them.
    """
    R, x, B, J, inverse = f.centre_rotation, f.x, f.torques, f.body.inertia, f.body.inverse_inertia
    tau, omega = x[13:16], x[10:13]
    # B: derivatives of the torque in the body frame; rows 9-11: of the force in the world frame
    for i in range(3):
        for j in range(N):
            B[i, j] = 0.0
            A[9 + i, j] = 0.0
        for j in range(3):
            R[i, j] = f.rotation[i, j]
    for i in range(3):
        # R' tau at an attitude turned by 4 rho: R' (tau + tau x 4 rho)
        t0, t1, t2 = R[0, i], R[1, i], R[2, i]
        B[i, 0] = 4.0 * (t1 * tau[2] - t2 * tau[1])
        B[i, 1] = 4.0 * (t2 * tau[0] - t0 * tau[2])
        B[i, 2] = 4.0 * (t0 * tau[1] - t1 * tau[0])
        for j in range(3):
            B[i, 12 + j] = R[j, i]
        A[9 + i, 15 + i] = 1.0
    # - omega x J omega
    h0 = J[0, 0] * omega[0] + J[0, 1] * omega[1] + J[0, 2] * omega[2]
    h1 = J[1, 0] * omega[0] + J[1, 1] * omega[1] + J[1, 2] * omega[2]
    h2 = J[2, 0] * omega[0] + J[2, 1] * omega[1] + J[2, 2] * omega[2]
    _add_cross(B, 0, 3, h0, h1, h2, 1.0)
    for j in range(3):
        B[0, 3 + j] -= omega[1] * J[2, j] - omega[2] * J[1, j]
        B[1, 3 + j] -= omega[2] * J[0, j] - omega[0] * J[2, j]
        B[2, 3 + j] -= omega[0] * J[1, j] - omega[1] * J[0, j]
    # thrust along the body's z axis
    thrust = f.rotor_wrench[0]
    _add_cross(A, 9, 0, R[0, 2] * thrust, R[1, 2] * thrust, R[2, 2] * thrust, -4.0)
    if f.wrench_count > 0:  # noqa: SIM102 - an export decides this one by itself
        if effects:
            _add_effect_jacobian(f, A)
    for i in range(3):
        for j in range(N):
            A[3 + i, j] = (
                inverse[i, 0] * B[0, j] + inverse[i, 1] * B[1, j] + inverse[i, 2] * B[2, j]
            )
            A[9 + i, j] /= f.body.mass
    if f.body.com[0] != 0.0 or f.body.com[1] != 0.0 or f.body.com[2] != 0.0:
        _add_offset_jacobian(f, A)


@compiled
def model_jacobian(f: Record, dt: float, A: Array, effects: bool) -> None:
    """Write the first 12 rows of ``F - 1`` into ``A`` (12, 18); the rows of torque and force would
    be zero.

    F is the derivative of the error state after ``dt`` s by the one before, at the estimate
    ``f.x``. Call ``drive`` and ``propagate`` before.
    """
    for i in range(12):
        for j in range(N):
            A[i, j] = 0.0
    acceleration_jacobian(f, A, effects)
    R = f.centre_rotation
    # the turn of this step is at the old rate: 4 d(rho) = R Jl(omega dt) dt d(omega), Jl the left
    # Jacobian of SO(3)
    px, py, pz = f.x[10] * dt, f.x[11] * dt, f.x[12] * dt
    q = px * px + py * py + pz * pz
    if q > 0.25:
        angle = math.sqrt(q)
        half, third = (1.0 - math.cos(angle)) / q, (angle - math.sin(angle)) / (q * angle)
    else:  # the series, to 1e-9
        half = 0.5 - q / 24.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0))
        third = (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0))) / 6.0
    for i in range(3):
        r0, r1, r2 = R[i, 0], R[i, 1], R[i, 2]
        along = third * (r0 * px + r1 * py + r2 * pz)
        straight = 1.0 - third * q
        A[i, 3] = 0.25 * dt * (straight * r0 + along * px + half * (r1 * pz - r2 * py))
        A[i, 4] = 0.25 * dt * (straight * r1 + along * py + half * (r2 * px - r0 * pz))
        A[i, 5] = 0.25 * dt * (straight * r2 + along * pz + half * (r0 * py - r1 * px))
        for j in range(N):
            A[3 + i, j] *= dt
            A[9 + i, j] *= dt
            A[6 + i, j] = 0.5 * dt * A[9 + i, j]
        A[6 + i, 9 + i] += dt
