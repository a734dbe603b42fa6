"""Rotor drag: a force in the rotor plane against the motion of each rotor through the air, times
its rotor speed.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = -W_i diag(kdx, kdy, 0) u_i,
applied at the rotor.
"""

from .base import CENTRAL, Coefficient, Effect
from .declaration import Family, Role

EFFECT = Effect(
    name="rotor_drag",
    kind="wrench",
    coefficients=(
        Coefficient(
            "kdx", "N/(rad/s m/s)", (1.2e-4, 1.8e-6), "per rotor, along body x", minimum=0.0
        ),
        Coefficient(
            "kdy", "N/(rad/s m/s)", (1.2e-4, 1.8e-6), "per rotor, along body y", minimum=0.0
        ),
        CENTRAL,
    ),
    source="Martin and Salaun, The True Role of Accelerometer Feedback in Quadrotor Control, ICRA "
    "2010; sizes: Svacha et al., ICUAS 2017 (0.5 kg), Foerster, ETH Zurich 2015 (0.03 kg)",
    excitation="horizontal flight at 1 m/s and more along both body axes, at several loads "
    "(climbs, hard turns): rotor drag grows with the rotor speeds, body drag does not",
    model="rotor_drag",
    family=Family.DRAG,
    role=Role.ROTOR_DRAG,
)
