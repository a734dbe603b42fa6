"""Thrust curvature: thrust does not grow exactly with the square of the rotor speed.

Thrust and reaction torque are those declared times 1 + a (W^2 / W_hover^2 - 1), no less than zero,
so that nothing changes at the rotor speed of hover. The delivered rotor speed is W times the root
of that.
"""

import math

from .base import HOVER_RATE, Coefficient, Effect, compiled_model
from .declaration import Family, Need, Role


@compiled_model
def effect_model(c, vehicle, rotors, memory):  # type: ignore[no-untyped-def]
    for i in range(4):
        ratio = rotors[i] / vehicle[HOVER_RATE]
        rotors[i] *= math.sqrt(max(1.0 + c[0] * (ratio * ratio - 1.0), 0.0))


EFFECT = Effect(
    name="thrust_curvature",
    kind="rotor input",
    coefficients=(
        Coefficient(
            "a",
            "1",
            (-0.1, -0.1),
            "relative change at twice the hover thrust",
            minimum=-0.9,
            maximum=2.0,
        ),
    ),
    source="a fit to second order about hover, as thrust stands of small propellers show: "
    "Foerster, System Identification of the Crazyflie 2.0, ETH Zurich 2015",
    excitation="thrusts from half to one and a half times hover: fast climbs, drops and turns",
    model=effect_model,
    family=Family.THRUST,
    role=Role.THRUST_CURVE,
    needs=(Need.FINE_ROTOR_SPEEDS,),
)
