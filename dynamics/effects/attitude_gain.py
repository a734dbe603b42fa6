"""Attitude gain: the reported tilt is the true one times 1 + g, as that of an onboard estimate may
be.

With the attitude split into a turn about the vertical and a tilt by an angle about a horizontal
axis, the angle is reported as (1 + g) times what it is, axis and turn as they are.
"""

import math

from .base import DIRECTION, HAS_QUATERNION, SAMPLE_QUATERNION, Coefficient, Effect, compiled_model
from .declaration import Family
from .parts import turn_attitude


@compiled_model
def effect_model(c, vehicle, sample, memory):  # type: ignore[no-untyped-def]
    if sample[HAS_QUATERNION] > 0.0:
        q = SAMPLE_QUATERNION
        w, x, y, z = sample[q], sample[q + 1], sample[q + 2], sample[q + 3]
        # body z in the world; the tilt turns e_z into it about (-by, bx, 0)
        bx, by, bz = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
        sine = math.sqrt(bx * bx + by * by)
        angle = math.atan2(sine, bz)
        if sine > 1e-12:
            gain = c[0] if sample[DIRECTION] > 0.0 else 1.0 / (1.0 + c[0]) - 1.0
            turn_attitude(sample, -by / sine * gain * angle, bx / sine * gain * angle, 0.0)


EFFECT = Effect(
    name="attitude_gain",
    kind="sensing",
    coefficients=(
        Coefficient(
            "g", "1", (0.05, 0.05), "relative change of the tilt", minimum=-0.5, maximum=1.0
        ),
    ),
    source="definition; attitude from an onboard filter that trusts an accelerometer in flight "
    "reads tilt by a few per cent wrong",
    excitation="horizontal accelerations of 2 m/s2 and more: its force goes with the tilt, that of "
    "drag with the velocity",
    model=effect_model,
    family=Family.ALIGNMENT,
    scales_noise=True,
)
