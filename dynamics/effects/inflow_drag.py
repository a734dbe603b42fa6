"""Inflow drag: the part of a rotor's in-plane drag in proportion to the air through its disc.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = -kl u_iz (u_ix, u_iy, 0),
applied at the rotor. A climbing rotor drags more, a sinking rotor less. The part
in proportion to the rotor speed is ``rotor_drag``.
"""

from .base import Coefficient, Effect
from .declaration import Family

EFFECT = Effect(
    name="inflow_drag",
    kind="wrench",
    coefficients=(Coefficient("kl", "N/(m/s)^2", (3.5e-3, 2e-4), "per rotor"),),
    source="blade-element theory, the rotor's H-force with inflow: Bramwell, Done and Balmford, "
    "Bramwell's Helicopter Dynamics, 2001; size: least squares on a 0.77 kg racer at 3 to 14 m/s, "
    "in proportion to the disc area",
    excitation="climbs and descents of 3 m/s and more together with 5 m/s and more across the disc",
    model="inflow_drag",
    family=Family.FAST_FLIGHT,
)
