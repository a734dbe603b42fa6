"""Thrust curvature: thrust does not grow exactly with the square of the rotor speed.

Thrust and reaction torque are the declared ones times 1 + a (W^2 / W_hover^2 - 1), at least zero.
Nothing changes at the rotor speed of hover. The delivered rotor speed is W times the root of the
factor.
"""

from .base import Coefficient, Effect
from .declaration import Family, Need, Role

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
    model="thrust_curvature",
    family=Family.THRUST,
    role=Role.THRUST_CURVE,
    needs=(Need.FINE_ROTOR_SPEEDS,),
)
