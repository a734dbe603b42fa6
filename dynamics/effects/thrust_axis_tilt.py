"""Thrust axis tilt: the frame of the rotors is turned against the body's axes, so that thrust does
not point along body z.

With Q the turn by the rotation vector (ax, ay, 0) rad, the rotors' thrust T e_z and torque tau
about the geometric centre act as T Q e_z and Q tau: the differences to T e_z and tau are added.
"""

import math

from .base import (
    REACTION,
    ROTOR_POSITION,
    ROTOR_SPEED,
    ROTOR_THRUST,
    SPIN,
    Effect,
    along,
    compiled_model,
)
from .declaration import Family, Role
from .parts import add_force_at


@compiled_model
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    angle = math.sqrt(c[0] * c[0] + c[1] * c[1])
    if angle < 1e-12:
        return
    thrust, tx, ty, tz = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        lift, speed = state[ROTOR_THRUST + i], state[ROTOR_SPEED + i]
        thrust += lift
        tx += vehicle[ROTOR_POSITION + 3 * i + 1] * lift
        ty -= vehicle[ROTOR_POSITION + 3 * i] * lift
        tz -= vehicle[SPIN + i] * vehicle[REACTION + i] * speed * speed
    # Rodrigues' formula about the axis (x, y, 0)
    x, y, sine, rest = c[0] / angle, c[1] / angle, math.sin(angle), 1.0 - math.cos(angle)
    add_force_at(
        vehicle, state, wrench, 0.0, 0.0, 0.0, thrust * sine * y, -thrust * sine * x, -thrust * rest
    )
    along = rest * (x * tx + y * ty)
    wrench[3] += sine * y * tz + along * x - rest * tx
    wrench[4] += -sine * x * tz + along * y - rest * ty
    wrench[5] += sine * (x * ty - y * tx) - rest * tz


EFFECT = Effect(
    name="thrust_axis_tilt",
    kind="wrench",
    coefficients=along(
        "a{}", "rad", (0.02, 0.02), "turn about body {}", minimum=-0.8, maximum=0.8, axes="xy"
    ),
    source="definition; also markers put on the body at a small angle",
    excitation="yaw through half a turn and more: this force turns with the body, that of a tilted "
    "world or a steady force stays; vertical accelerations, with which it grows",
    model=effect_model,
    family=Family.ALIGNMENT,
    role=Role.THRUST_AXIS,
)
