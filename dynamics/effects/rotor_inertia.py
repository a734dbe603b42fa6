"""Rotor inertia: the torque of rotors as they spin up, and as they turn with the body.

The angular momentum along body z is h = jr sum spin_i W_i. The torque in body axes is
tau = -dh/dt e_z - omega x h e_z, with delivered rotor speeds W and the mean of dW/dt over a step.
"""

from .base import Coefficient, Effect
from .declaration import Family, Need

EFFECT = Effect(
    name="rotor_inertia",
    kind="wrench",
    coefficients=(
        Coefficient("jr", "kg m2", (2e-5, 7e-8), "of one rotor about its axis", minimum=0.0),
    ),
    source="rigid-body mechanics; sizes: a thin rod of the propeller's mass and span (4 g, 0.2 m "
    "and a geared drive; 0.4 g, 0.046 m)",
    excitation="quick changes of yaw rate: rotors that speed up turn the body at once, before "
    "their drag does",
    model="rotor_inertia",
    family=Family.ROTOR_DYNAMICS,
    needs=(Need.FAST_MOTION, Need.FINE_ROTOR_SPEEDS, Need.MOMENTS),
)
