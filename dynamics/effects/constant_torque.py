"""Constant torque: a steady torque, fixed in the body frame (a bent arm, an unequal set of
propellers).
"""

from numba import cfunc

from .base import EFFECT_MODEL, Coefficient, Effect
from .declaration import Family, Need


@cfunc(EFFECT_MODEL, cache=True)
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    for i in range(3):
        wrench[3 + i] += c[i]


EFFECT = Effect(
    name="constant_torque",
    kind="wrench",
    coefficients=tuple(
        Coefficient(f"t{axis}", "Nm", (0.01, 1e-4), f"about body {axis}") for axis in "xyz"
    ),
    source="definition",
    excitation="climbs and drops: the torque of an offset centre of mass or a weak rotor grows "
    "with thrust",
    model=effect_model,
    family=Family.STEADY,
    needs=(Need.MOMENTS,),
    any_size=True,
)
