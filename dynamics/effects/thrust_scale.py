"""Thrust scale: all rotors deliver more or less than declared at the same rotor speed.

Thrust and reaction torque scale by 1 + s: the delivered rotor speed is W sqrt(1 + s).
"""

import math

from .base import Coefficient, Effect, compiled_model
from .declaration import Family, Role


@compiled_model
def effect_model(c, vehicle, rotors, memory):  # type: ignore[no-untyped-def]
    scale = math.sqrt(max(1.0 + c[0], 0.0))
    for i in range(4):
        rotors[i] *= scale


EFFECT = Effect(
    name="thrust_scale",
    kind="rotor input",
    coefficients=(
        Coefficient("s", "1", (-0.05, -0.05), "relative change", minimum=-0.9, maximum=2.0),
    ),
    source="definition; air density and propeller wear change thrust by several per cent",
    excitation="vertical accelerations of 1 m/s2 and more tell it from a mass (both cancel at "
    "hover) and a steady force; a whole battery tells it from sag",
    model=effect_model,
    family=Family.THRUST,
    role=Role.THRUST,
    any_size=True,
)
