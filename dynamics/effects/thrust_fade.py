"""Thrust fade: thrust at a given rotor speed falls steadily with flight time, as motors and battery
warm up.

Thrust and reaction torque scale by 1 - rate * t, at least a tenth. The delivered rotor speed is W
times the root of this factor. The time t starts with the flight; in an estimator, with ``reset``.
"""

from .base import Coefficient, Effect
from .declaration import Family, Role

EFFECT = Effect(
    name="thrust_fade",
    kind="rotor input",
    coefficients=(
        Coefficient(
            "rate", "1/s", (1e-3, 1e-3), "relative loss of thrust", minimum=-0.1, maximum=0.1
        ),
    ),
    source="definition; size: 6 % in a minute where the logged rates are commands",
    excitation="a minute and more of flight with the battery voltage logged: loads that come and "
    "go move the voltage, and with it sag, but not time",
    model="thrust_fade",
    family=Family.THRUST,
    role=Role.THRUST_OVER_TIME,
)
