"""Rotor interaction: rotors that lead into the air lift more, at the same rotor speed, than those
that follow in their wake; the thrust of all grows by what the followers must turn faster.

With u = R'(v - wind) the airspeed in body axes, and rotor i in the direction (e_ix, e_iy) from the
geometric centre: F = -sum_i W_i (kx e_ix u_x + ky e_iy u_y) along body z, at the geometric centre.
In level flight the loop slows the leading rotors until the moments balance; where all rotors turn
alike the force is zero. The moment that goes with it is that of ``flapping_moment``.
"""

import math

from numba import cfunc

from .base import EFFECT_MODEL, ROTOR_POSITION, ROTOR_SPEED, Coefficient, Effect
from .parts import add_force_at, air_velocity


@cfunc(EFFECT_MODEL, cache=True)
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    ux, uy, _ = air_velocity(state, 0.0, 0.0, 0.0)
    force = 0.0
    for i in range(4):
        x = vehicle[ROTOR_POSITION + 3 * i]
        y = vehicle[ROTOR_POSITION + 3 * i + 1]
        arm = math.sqrt(x * x + y * y)
        if arm > 0.0:
            force -= state[ROTOR_SPEED + i] * (c[0] * x * ux + c[1] * y * uy) / arm
    add_force_at(vehicle, state, wrench, 0.0, 0.0, 0.0, 0.0, 0.0, force)


EFFECT = Effect(
    name="rotor_interaction",
    kind="wrench",
    coefficients=(
        Coefficient("kx", "N/(rad/s m/s)", (1.4e-3, 2e-5), "per rotor, for motion along body x"),
        Coefficient("ky", "N/(rad/s m/s)", (1.4e-3, 2e-5), "per rotor, for motion along body y"),
    ),
    source="form: rotors in tandem, Leishman, Principles of Helicopter Aerodynamics, 2006, and "
    "moments in trim; size: least squares on a 0.77 kg racer at 3 to 14 m/s (docs/fast-flight.md), "
    "as a share of thrust at airspeed over induced velocity",
    confused_with=("translational_lift", "flapping_moment"),
    excitation="flight at 5 m/s and more along both body axes, with turns that set the rotors "
    "apart; in hover it does nothing",
    model=effect_model,
)
