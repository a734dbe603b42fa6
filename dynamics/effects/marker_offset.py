"""Marker offset: the reported position is not that of the geometric centre but of a point beside
it.

p' = p + R m with m = (mx, my, mz) in body axes. To undo it takes the attitude, measured or, where
none was, estimated.
"""

from .base import (
    DIRECTION,
    HAS_POSITION,
    SAMPLE_POSITION,
    SAMPLE_QUATERNION,
    Effect,
    along,
    compiled_model,
)
from .declaration import Family, Role


@compiled_model
def effect_model(c, vehicle, sample, memory):  # type: ignore[no-untyped-def]
    if sample[HAS_POSITION] > 0.0:
        q = SAMPLE_QUATERNION
        w, x, y, z = sample[q], sample[q + 1], sample[q + 2], sample[q + 3]
        # m + 2 w (v x m) + 2 v x (v x m)
        a, b, d = y * c[2] - z * c[1], z * c[0] - x * c[2], x * c[1] - y * c[0]
        s, p = sample[DIRECTION], SAMPLE_POSITION
        sample[p] += s * (c[0] + 2.0 * (w * a + y * d - z * b))
        sample[p + 1] += s * (c[1] + 2.0 * (w * b + z * a - x * d))
        sample[p + 2] += s * (c[2] + 2.0 * (w * d + x * b - y * a))


EFFECT = Effect(
    name="marker_offset",
    kind="sensing",
    coefficients=along("m{}", "m", (0.01, 0.005), "along body {}", minimum=-1.0, maximum=1.0),
    source="definition; the centroid of the markers on a vehicle is seldom its centre",
    excitation="quick roll and pitch (trajectory shake) for mz and fast yaw for mx and my: the "
    "point swings about the centre. An offset centre of mass also makes a torque in hover; this "
    "does not",
    model=effect_model,
    family=Family.RIGID_BODY,
    role=Role.MARKER,
)
