"""Wind: a steady wind, fixed in the world frame.

Every declared effect that asks for the wind (rotor_drag, body_drag, inflow_thrust ...) feels it.
``cd`` is a drag of its own, for a vehicle that declares none: with w the wind and u = w - v, F = cd
|u| u + cd |v| v at the centre of mass, that is the change against the same drag in still air. So
nothing happens without wind, and what differs from a constant force is how the force changes with
the velocity.
"""

import math

from numba import cfunc

from .base import EFFECT_MODEL, VELOCITY, WIND, Coefficient, Effect


@cfunc(EFFECT_MODEL, cache=True)
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    air, ground = 0.0, 0.0
    for i in range(3):
        state[WIND + i] += c[i]
        air += (c[i] - state[VELOCITY + i]) ** 2
        ground += state[VELOCITY + i] ** 2
    air, ground = c[3] * math.sqrt(air), c[3] * math.sqrt(ground)
    for i in range(3):
        wrench[i] += air * (c[i] - state[VELOCITY + i]) + ground * state[VELOCITY + i]


EFFECT = Effect(
    name="wind",
    kind="wrench",
    coefficients=(
        Coefficient("wx", "m/s", (2.0, 1.0), "along world x"),
        Coefficient("wy", "m/s", (1.0, 0.5), "along world y"),
        Coefficient("wz", "m/s", (0.0, 0.0), "along world z"),
        Coefficient("cd", "N/(m/s)^2", (0.04, 0.001), "drag of its own", minimum=0.0),
    ),
    source="quadratic drag, 0.5 * 1.2 kg/m3 * C_d A with C_d A = 0.06 m2, 16 cm2; wind of an open "
    "hangar door",
    confused_with=("constant_force", "body_drag", "world_tilt"),
    excitation="flight with and against the wind at 1 m/s and more; in hover it is a constant "
    "force. Declared drag makes it "
    "identifiable",
    model=effect_model,
    sets_wind=True,
)
