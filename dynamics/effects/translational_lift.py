"""Translational lift: a rotor in edgewise motion delivers more thrust.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = kh (u_ix^2 + u_iy^2) along body
z, applied at the rotor. RotorPy calls kh k_h.
"""

from .base import CENTRAL, Coefficient, Effect
from .declaration import Family, Role

EFFECT = Effect(
    name="translational_lift",
    kind="wrench",
    coefficients=(
        Coefficient("kh", "N/(m/s)^2", (3.4e-3, 1e-4), "per rotor"),
        CENTRAL,
    ),
    source="Leishman, Principles of Helicopter Aerodynamics, 2006; size: Folk, Paulos and Kumar, "
    "RotorPy, 2023 (0.5 kg), in proportion to the disc area for 0.03 kg",
    excitation="level flight at several speeds up to 2 m/s and more; in hover it does nothing",
    model="translational_lift",
    family=Family.AERODYNAMICS,
    role=Role.TRANSLATIONAL_LIFT,
)
