"""Inflow drag: the part of a rotor's drag in its plane that grows with the air through its disc.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = -kl u_iz (u_ix, u_iy, 0),
applied at the rotor. A rotor that climbs into its inflow drags more, one that sinks less. The part
in proportion to the rotor speed is ``rotor_drag``.
"""

from .base import Coefficient, Effect, compiled_model
from .declaration import Family
from .parts import add_force_at, air_velocity, rotor_place


@compiled_model
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    for i in range(4):
        x, y, z = rotor_place(vehicle, i, 0.0)
        ux, uy, uz = air_velocity(state, x, y, z)
        kl = c[0] * uz
        add_force_at(vehicle, state, wrench, x, y, z, -kl * ux, -kl * uy, 0.0)


EFFECT = Effect(
    name="inflow_drag",
    kind="wrench",
    coefficients=(Coefficient("kl", "N/(m/s)^2", (3.5e-3, 2e-4), "per rotor"),),
    source="blade-element theory, the rotor's H-force with inflow: Bramwell, Done and Balmford, "
    "Bramwell's Helicopter Dynamics, 2001; size: least squares on a 0.77 kg racer at 3 to 14 m/s "
    "(docs/trust.md), in proportion to the disc area",
    excitation="climbs and descents of 3 m/s and more together with 5 m/s and more across the disc",
    model=effect_model,
    family=Family.FAST_FLIGHT,
)
