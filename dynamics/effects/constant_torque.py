"""Constant torque: a steady torque, fixed in the body frame (a bent arm, an unequal set of
propellers).
"""

from .base import Effect, along
from .declaration import Family, Need

EFFECT = Effect(
    name="constant_torque",
    kind="wrench",
    coefficients=along("t{}", "Nm", (0.01, 1e-4), "about body {}"),
    source="definition",
    excitation="climbs and drops: the torque of an offset centre of mass or a weak rotor grows "
    "with thrust",
    model="constant_torque",
    family=Family.STEADY,
    needs=(Need.MOMENTS,),
    any_size=True,
)
