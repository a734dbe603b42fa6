"""Ceiling effect: a rotor near the ceiling delivers more thrust at the same rotor speed.

Thrust of a rotor at distance d below ``ceiling_z`` grows by the factor 1 / (1 - rho (R / (4 d))^2),
as in the ``ground_effect``. Each rotor has its own distance, so a tilted vehicle feels a torque.
The factor is at most 2. Without a ceiling in the vehicle file nothing changes.
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
