"""The covariance of the filter with a constant gain while its gain is not constant: after a gap, a
restart, a refused measurement.

The model is linearised at hover, in the frame of the vehicle's heading. So the covariance depends
on the measurements and their times, not on the vehicle's path: a filter in C with single precision
comes back to its constant gain at the same step, and needs no Jacobian. At large tilts and fast
turns the covariance is an approximation, as is the constant gain itself.
"""

import math

import numpy as np

from ..runtime.compiled import Record, compiled, compiled_without_gil
from .covariance import add_noise, carry_by_jacobian
from .error_state import symmetrise
from .estimate import Array
from .filter_record import N, drive, propagate
from .linear_model import acceleration_jacobian

CATCH_UP = 32  # predictions, at most, that make up for a gap.
_NOTHING = 1e-9  # of the largest part of an acceleration's deviation: rounding of a derivative
_NO_HEADING = 1e-6  # of a quaternion squared: thrust points down, and there is none


@compiled
def carry_at_hover(f: Record, dt: float) -> None:
    """Carry the covariance ``dt`` s ahead by the model at hover."""
    P, A, G, J = f.P, f.S, f.H, f.hover
    A[0:3], A[3:6], A[9:12] = 0.0, dt * J[:3], dt * J[3:]
    A[6:9] = 0.5 * dt * A[9:12]
    for i in range(3):
        A[i, 3 + i] = 0.25 * dt  # an MRP is a quarter of an angle
        A[6 + i, 9 + i] += dt
    carry_by_jacobian(P, A, G)
    f.centre_rotation[:] = np.eye(3)
    add_noise(f, f.centre_rotation, dt)
    symmetrise(P)


@compiled
def catch_up(f: Record) -> None:
    """Carry the covariance over the time since the last measurement."""
    since = max(f.poses.position_age, f.poses.attitude_age)
    if since <= 0.0:
        return
    count = max(1, int(min(since / f.period, 1.0 * CATCH_UP) + 0.5))
    for _ in range(count):
        carry_at_hover(f, since / count)


@compiled
def heading(q: Array) -> tuple[float, float]:
    """Return cosine and sine of half the turn about the vertical that is in an attitude; no turn
    where the vehicle hangs head down.
    """
    square = q[0] * q[0] + q[3] * q[3]
    if square < _NO_HEADING:
        return 1.0, 0.0
    scale = 1.0 / math.sqrt(square)
    return q[0] * scale, q[3] * scale


@compiled
def turn_world(f: Record, pose: Array, w: float, z: float, before: Array, after: Array) -> None:
    """Turn the world about the vertical through ``before`` (3,), which moves to ``after`` (3,):
    estimate, pose (7,) and remembered poses; cosine ``w`` and sine ``z`` of half the angle.

    About the vehicle, so that single precision turns small numbers: 17 m away the rounding of a
    turn about the origin was 0.2 % of a pose's noise, in each step.
    """
    cosine, sine = w * w - z * z, 2.0 * w * z
    _turn_pose(f.x, w, z, before, after)
    _turn_pose(pose, w, z, before, after)
    _turn_pose(f.poses.seen, w, z, before, after)
    turn_vectors(f.x[7:10], 1, cosine, sine)
    turn_vectors(f.x[13:19], 2, cosine, sine)
    if f.gated > 0:
        _turn_pose(f.poses.doubted, w, z, before, after)
        turn_vectors(f.poses.pace, 2, cosine, sine)


@compiled
def _turn_pose(pose: Array, w: float, z: float, before: Array, after: Array) -> None:
    """Turn position and quaternion, which a pose begins with."""
    for i in range(3):
        pose[i] -= before[i]
    turn_vectors(pose[0:3], 1, w * w - z * z, 2.0 * w * z)
    for i in range(3):
        pose[i] += after[i]
    for i in range(2):
        a, b = pose[3 + i], pose[6 - i]
        pose[3 + i] = w * a - z * b
        pose[6 - i] = w * b + z * a


@compiled
def turn_vectors(values: Array, count: int, cosine: float, sine: float) -> None:
    """Turn the horizontal part of ``count`` vectors, which follow one another, about the vertical,
    in place.
    """
    for k in range(count):
        a, b = values[3 * k], values[3 * k + 1]
        values[3 * k] = cosine * a - sine * b
        values[3 * k + 1] = sine * a + cosine * b


@compiled_without_gil
def _jacobian_at(record: np.ndarray, voltage: float, out: Array) -> None:
    f = record[0]
    drive(f, f.last_speeds, f.period, voltage)
    propagate(f, f.x, f.period, f.centre)
    acceleration_jacobian(f, f.S, True)
    out[:3], out[3:] = f.S[3:6], f.S[9:12]


def jacobian_at_hover(record: np.ndarray, voltage: float, deviations: Array) -> Array:
    """Return the derivatives (6, 18) of angular (body) and linear acceleration by the error state
    of a filter that hovers facing along x, without rounding errors.

    Args:
        record: the filter's, overwritten.
        voltage: V.
        deviations: (18,) of the error state: the scale of an acceleration's parts.
    """
    out = np.zeros((6, N))
    record[0]["S"] = 0.0
    _jacobian_at(record, voltage, out)
    size = np.abs(out) * deviations
    out[size < _NOTHING * size.max(axis=1, keepdims=True)] = 0.0
    return out
