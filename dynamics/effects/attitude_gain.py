"""Attitude gain: the reported tilt is the true tilt times 1 + g, as in some onboard estimates.

An attitude is a turn about the vertical and a tilt about a horizontal axis. The reported
tilt angle is (1 + g) times the true angle; axis and turn are right.
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
