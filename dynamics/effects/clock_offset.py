"""Clock offset: pose and rotor speeds in one row of the log belong to different instants.

With dt > 0 the pose is dt older than the rotor speeds; with dt < 0 the rotor speeds are -dt older
than the pose. A cubic interpolates between samples. An estimator with this effect delays the other
signal, and so estimates the flight of dt ago.
"""

from .base import Coefficient, Effect
from .declaration import Family, Need, Role

EFFECT = Effect(
    name="clock_offset",
    kind="sensing",
    coefficients=(
        Coefficient(
            "dt",
            "s",
            (0.03, 0.02),
            "by which the pose is older than the rotor speeds",
            minimum=-0.06,
            maximum=0.06,
        ),
    ),
    source="definition; motion capture reaches the vehicle's clock 5 to 30 ms late",
    excitation="quick manoeuvres: a motor lag smooths them; a latency leaves the log of dt > 0",
    model="clock_offset",
    family=Family.ALIGNMENT,
    role=Role.DELAY,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS),
)
