"""Ground effect: a rotor near the floor delivers more thrust at the same rotor speed.

Thrust of a rotor at height z above the floor is multiplied by 1 / (1 - rho (R / (4 z))^2),
Cheeseman and Bennett's equation for rho = 1; rho of about 3 was measured for whole quadrotors.
Applied rotor by rotor, so a tilted vehicle feels a torque. The height is taken as no less than
where the factor reaches 2, as the equation has a pole below it.
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
