"""Turns about the vertical, for the export to C."""

import math

from ..runtime.compiled import Record, compiled
from .estimate import Array

CATCH_UP = 32  # predictions, at most, that make up for a gap.
_NO_HEADING = 1e-6  # of a quaternion squared: thrust points down, and there is none


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
