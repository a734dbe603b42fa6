"""Ground effect: a rotor near the floor delivers more thrust at the same rotor speed.

Thrust of a rotor at height z above the floor is multiplied by 1 / (1 - rho (R / (4 z))^2),
Cheeseman and Bennett's equation for rho = 1; rho of about 3 was measured for whole quadrotors.
Applied rotor by rotor, so a tilted vehicle feels a torque. The height is taken as no less than
where the factor reaches 2, as the equation has a pole below it.
"""

from numba import cfunc

from .base import (
    CENTRAL,
    COM,
    EFFECT_MODEL,
    FLOOR,
    POSITION,
    ROTATION,
    ROTOR_POSITION,
    ROTOR_RADIUS,
    ROTOR_THRUST,
    Coefficient,
    Effect,
)
from .declaration import Family


@cfunc(EFFECT_MODEL, cache=True)
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    if not vehicle[FLOOR] > -1e6:
        return
    scale = c[0] * (0.25 * vehicle[ROTOR_RADIUS]) ** 2
    total = 0.0
    for i in range(4):
        x = (1.0 - c[1]) * vehicle[ROTOR_POSITION + 3 * i]
        y = (1.0 - c[1]) * vehicle[ROTOR_POSITION + 3 * i + 1]
        z = (1.0 - c[1]) * vehicle[ROTOR_POSITION + 3 * i + 2]
        height = state[POSITION + 2] - vehicle[FLOOR]
        height += state[ROTATION + 6] * x + state[ROTATION + 7] * y + state[ROTATION + 8] * z
        ratio = scale / (height * height) if height > 1e-3 else 0.5
        ratio = min(ratio, 0.5)
        extra = state[ROTOR_THRUST + i] * ratio / (1.0 - ratio)
        wrench[3] += (y - vehicle[COM + 1]) * extra
        wrench[4] -= (x - vehicle[COM]) * extra
        total += extra
    for i in range(3):
        wrench[i] += state[ROTATION + 3 * i + 2] * total


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
        Coefficient("central", "1", (0.0, 0.0), CENTRAL, minimum=0.0, maximum=1.0),
    ),
    source="Cheeseman and Bennett, ARC R&M 3021, 1955; Sanchez-Cuevas, Heredia and Ollero, Int. J. "
    "Aerospace Eng. 2017",
    excitation="several heights, the lowest of one to two rotor diameters",
    model=effect_model,
    family=Family.SURROUNDINGS,
)
