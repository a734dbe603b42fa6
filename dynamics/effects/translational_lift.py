"""Translational lift: a rotor that moves through the air edgewise delivers more thrust.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = kh (u_ix^2 + u_iy^2) along body
z, applied at the rotor. It is the k_h of RotorPy.
"""

from .base import CENTRAL, Coefficient, Effect, compiled_model
from .declaration import Family, Role
from .parts import add_force_at, air_velocity, rotor_place


@compiled_model
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    for i in range(4):
        x, y, z = rotor_place(vehicle, i, c[1])
        ux, uy, _ = air_velocity(state, x, y, z)
        add_force_at(vehicle, state, wrench, x, y, z, 0.0, 0.0, c[0] * (ux * ux + uy * uy))


EFFECT = Effect(
    name="translational_lift",
    kind="wrench",
    coefficients=(
        Coefficient("kh", "N/(m/s)^2", (3.4e-3, 1e-4), "per rotor"),
        CENTRAL,
    ),
    source="Leishman, Principles of Helicopter Aerodynamics, 2006; size: Folk, Paulos and Kumar, "
    "RotorPy, 2023 (0.5 kg), in proportion to the disc area for 0.03 kg",
    excitation="level flight at several speeds up to 2 m/s and more; in hover it does nothing",
    model=effect_model,
    family=Family.AERODYNAMICS,
    role=Role.TRANSLATIONAL_LIFT,
)
