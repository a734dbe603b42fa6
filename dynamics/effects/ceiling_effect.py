"""Ceiling effect: a rotor near the ceiling delivers more thrust at the same rotor speed.

Thrust of a rotor at distance d below ``ceiling_z`` is multiplied by 1 / (1 - rho (R / (4 d))^2),
the mirror image of the ``ground_effect``. Applied rotor by rotor, so a tilted vehicle feels a
torque. The distance is taken as no less than where the factor reaches 2. Nothing changes where the
vehicle states no ceiling.
"""

from numba import cfunc

from .base import (
    CEILING,
    CENTRAL,
    EFFECT_MODEL,
    POSITION,
    ROTATION,
    ROTOR_POSITION,
    ROTOR_RADIUS,
    ROTOR_THRUST,
    Coefficient,
    Effect,
)
from .declaration import Family
from .parts import add_force_at


@cfunc(EFFECT_MODEL, cache=True)
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    if not vehicle[CEILING] < 1e6:
        return
    scale = c[0] * (0.25 * vehicle[ROTOR_RADIUS]) ** 2
    for i in range(4):
        x = (1.0 - c[1]) * vehicle[ROTOR_POSITION + 3 * i]
        y = (1.0 - c[1]) * vehicle[ROTOR_POSITION + 3 * i + 1]
        z = (1.0 - c[1]) * vehicle[ROTOR_POSITION + 3 * i + 2]
        distance = vehicle[CEILING] - state[POSITION + 2]
        distance -= state[ROTATION + 6] * x + state[ROTATION + 7] * y + state[ROTATION + 8] * z
        ratio = min(scale / (distance * distance), 0.5) if distance > 1e-3 else 0.5
        add_force_at(
            vehicle,
            state,
            wrench,
            x,
            y,
            z,
            0.0,
            0.0,
            state[ROTOR_THRUST + i] * ratio / (1.0 - ratio),
        )


EFFECT = Effect(
    name="ceiling_effect",
    kind="wrench",
    coefficients=(
        Coefficient("rho", "1", (3.0, 3.0), "strength", minimum=0.0, maximum=20.0),
        Coefficient("central", "1", (0.0, 0.0), CENTRAL, minimum=0.0, maximum=1.0),
    ),
    source="form: the ground effect's (Cheeseman and Bennett, ARC R&M 3021, 1955) mirrored; a "
    "ceiling raises thrust too: "
    "Sanchez-Cuevas, Heredia and Ollero, Int. J. Aerospace Eng. 2017; size assumed as near the "
    "ground",
    excitation="several distances from the ceiling, the nearest of one to two rotor diameters",
    model=effect_model,
    family=Family.SURROUNDINGS,
)
