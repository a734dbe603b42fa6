"""Inflow thrust: a climbing rotor delivers less thrust, a sinking rotor more.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = -kz W_i u_iz along body z,
applied at the rotor. This damps roll and pitch. RotorPy calls kz k_z.
"""

from .base import CENTRAL, Coefficient, Effect
from .declaration import Family, Role

EFFECT = Effect(
    name="inflow_thrust",
    kind="wrench",
    coefficients=(
        Coefficient("kz", "N/(rad/s m/s)", (2.3e-4, 7.6e-7), "per rotor", minimum=0.0),
        CENTRAL,
    ),
    source="blade-element theory; Hoffmann, Huang, Waslander and Tomlin, Quadrotor Helicopter "
    "Flight Dynamics and Control, AIAA GNC 2007; sizes: Folk, Paulos and Kumar, RotorPy, 2023",
    excitation="climbs and descents of 0.5 m/s and more; quick roll and pitch for its damping "
    "torque",
    model="inflow_thrust",
    family=Family.AERODYNAMICS,
    role=Role.INFLOW_THRUST,
)
