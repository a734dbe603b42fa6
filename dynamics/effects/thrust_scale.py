"""Thrust scale: all rotors deliver more or less than declared at the same rotor speed.

Thrust and reaction torque scale by 1 + s: the delivered rotor speed is W sqrt(1 + s).
"""

from .base import Coefficient, Effect
from .declaration import Family, Role

EFFECT = Effect(
    name="thrust_scale",
    kind="rotor input",
    coefficients=(
        Coefficient("s", "1", (-0.05, -0.05), "relative change", minimum=-0.9, maximum=2.0),
    ),
    source="definition; air density and propeller wear change thrust by several per cent",
    excitation="vertical accelerations of 1 m/s2 and more: in hover a mass, a thrust scale and a "
    "vertical force are the same; a whole battery, against sag",
    model="thrust_scale",
    family=Family.THRUST,
    role=Role.THRUST,
    any_size=True,
)
