"""Attitude gain: the reported tilt is the true one times 1 + g, as that of an onboard estimate may
be.

With the attitude split into a turn about the vertical and a tilt by an angle about a horizontal
axis, the angle is reported as (1 + g) times what it is, axis and turn as they are.
"""

from .base import Coefficient, Effect
from .declaration import Family

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
    model="attitude_gain",
    family=Family.ALIGNMENT,
    scales_noise=True,
)
