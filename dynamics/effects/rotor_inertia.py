"""Rotor inertia: the torque that it takes to spin rotors up and to turn them with the body.

With the angular momentum h = jr sum spin_i W_i along body z: tau = -dh/dt e_z - omega x h e_z in
body axes, W being delivered rotor speeds and dW/dt their mean over the step.
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
