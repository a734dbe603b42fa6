"""World tilt: the vertical of the motion capture's frame is not the true one.

Position and attitude are reported in a frame in which they appear turned about the world's axes by
the rotation vector (ax, ay, 0) rad: p' = Q p, R' = Q R.
"""

import math

from .base import (
    DIRECTION,
    HAS_POSITION,
    HAS_QUATERNION,
    SAMPLE_POSITION,
    Effect,
    along,
    compiled_model,
)
from .declaration import Family
from .parts import turn_attitude


@compiled_model
def effect_model(c, vehicle, sample, memory):  # type: ignore[no-untyped-def]
    ax, ay = sample[DIRECTION] * c[0], sample[DIRECTION] * c[1]
    if sample[HAS_POSITION] > 0.0:
        angle = math.sqrt(ax * ax + ay * ay)
        if angle > 1e-12:
            nx, ny, s, t = ax / angle, ay / angle, math.sin(angle), 1.0 - math.cos(angle)
            p = SAMPLE_POSITION
            x, y, z = sample[p], sample[p + 1], sample[p + 2]
            along = nx * x + ny * y
            sample[p] = x + s * ny * z + t * (nx * along - x)
            sample[p + 1] = y - s * nx * z + t * (ny * along - y)
            sample[p + 2] = z + s * (nx * y - ny * x) - t * z
    if sample[HAS_QUATERNION] > 0.0:
        turn_attitude(sample, ax, ay, 0.0)


EFFECT = Effect(
    name="world_tilt",
    kind="sensing",
    coefficients=along(
        "a{}", "rad", (0.01, 0.01), "about world {}", minimum=-0.8, maximum=0.8, axes="xy"
    ),
    source="definition; the ground plane of a motion capture is set with a square on a floor that "
    "is level to some mrad",
    excitation="yaw through half a turn and more tells it from a tilted thrust axis; from a steady "
    "force nothing does: a level frame that is tilted leaves just a constant force, of the weight "
    "times the tilt",
    model=effect_model,
    family=Family.ALIGNMENT,
)
