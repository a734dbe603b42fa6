"""Constant force: a steady force, fixed in the world frame, at the centre of mass."""

from .base import Effect, along
from .declaration import Family, Role

EFFECT = Effect(
    name="constant_force",
    kind="wrench",
    coefficients=along("f{}", "N", (0.2, 0.015), "along world {}"),
    source="definition",
    excitation="yaw through half a turn and more, and vertical accelerations of 1 m/s2 and more; "
    "in hover fz is a mass or a thrust scale",
    model="constant_force",
    family=Family.STEADY,
    role=Role.STEADY_FORCE,
    any_size=True,
)
