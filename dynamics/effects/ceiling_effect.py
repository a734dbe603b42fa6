"""Ceiling effect: a rotor near the ceiling delivers more thrust at the same rotor speed.

Thrust of a rotor at distance d below ``ceiling_z`` is multiplied by 1 / (1 - rho (R / (4 d))^2),
the mirror image of the ``ground_effect``. Applied rotor by rotor, so a tilted vehicle feels a
torque. The distance is taken as no less than where the factor reaches 2. Nothing changes where the
vehicle states no ceiling.
"""

from .base import CENTRAL, Coefficient, Effect
from .declaration import Family

EFFECT = Effect(
    name="ceiling_effect",
    kind="wrench",
    coefficients=(
        Coefficient("rho", "1", (3.0, 3.0), "strength", minimum=0.0, maximum=20.0),
        CENTRAL,
    ),
    source="form: the ground effect's (Cheeseman and Bennett, ARC R&M 3021, 1955) mirrored; a "
    "ceiling raises thrust too: Sanchez-Cuevas, Heredia and Ollero, Int. J. Aerospace Eng. 2017; "
    "size assumed as near the ground",
    excitation="several distances from the ceiling, the nearest of one to two rotor diameters",
    model="ceiling_effect",
    family=Family.SURROUNDINGS,
)
