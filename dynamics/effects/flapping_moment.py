"""Flapping moment: the blades of a moving rotor flap, and their hub turns the vehicle away from the
motion.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: the torque -kflap W_i (u_i x e_z) in
body axes. RotorPy calls kflap k_flap. ``rotor_drag`` is the force of flapping.
"""

from .base import Coefficient, Effect
from .declaration import Family, Need, Role

EFFECT = Effect(
    name="flapping_moment",
    kind="wrench",
    coefficients=(Coefficient("kflap", "Nm/(rad/s m/s)", (4e-6, 1.5e-9), "per rotor"),),
    source="Hoffmann, Huang, Waslander and Tomlin, AIAA GNC 2007; form as in Folk, Paulos and "
    "Kumar, RotorPy, 2023; sizes: a thirtieth of the typical rotor drag times the arm's length",
    excitation="speeds of 1 m/s and more along both body axes: its torque follows the velocity and "
    "changes sign with it",
    model="flapping_moment",
    family=Family.AERODYNAMICS,
    needs=(Need.MOMENTS,),
    role=Role.FLAPPING_MOMENT,
)
