"""Ground effect: a rotor near the floor delivers more thrust at the same rotor speed.

Thrust of a rotor at height z above the floor grows by the factor 1 / (1 - rho (R / (4 z))^2). This
is Cheeseman and Bennett's equation for rho = 1; for whole quadrotors rho is about 3. Each rotor has
its own height, so a tilted vehicle feels a torque. The factor is at most 2, as the equation has a
pole near the floor.
"""

from .base import CENTRAL, Coefficient, Effect
from .declaration import Family

EFFECT = Effect(
    name="ground_effect",
    kind="wrench",
    coefficients=(
        Coefficient(
            "rho",
            "1",
            (3.0, 3.0),
            "strength; 1 for a single helicopter rotor",
            minimum=0.0,
            maximum=20.0,
        ),
        CENTRAL,
    ),
    source="Cheeseman and Bennett, ARC R&M 3021, 1955; Sanchez-Cuevas, Heredia and Ollero, Int. J. "
    "Aerospace Eng. 2017",
    excitation="several heights, the lowest of one to two rotor diameters",
    model="ground_effect",
    family=Family.SURROUNDINGS,
)
