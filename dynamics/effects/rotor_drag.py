"""Rotor drag: a force in the rotor plane against the motion of each rotor through the air, times
its rotor speed.

At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = -W_i diag(kdx, kdy, 0) u_i,
applied at the rotor.
"""

from .base import (
    CENTRAL,
    COM,
    RATE,
    ROTATION,
    ROTOR_SPEED,
    VELOCITY,
    WIND,
    Coefficient,
    Effect,
    compiled_model,
)
from .declaration import Family, Role
from .parts import rotor_place


@compiled_model
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    ax = state[VELOCITY] - state[WIND]
    ay = state[VELOCITY + 1] - state[WIND + 1]
    az = state[VELOCITY + 2] - state[WIND + 2]
    ux = state[ROTATION] * ax + state[ROTATION + 3] * ay + state[ROTATION + 6] * az
    uy = state[ROTATION + 1] * ax + state[ROTATION + 4] * ay + state[ROTATION + 7] * az
    wx, wy, wz = state[RATE], state[RATE + 1], state[RATE + 2]
    total_x = 0.0
    total_y = 0.0
    for i in range(4):
        x, y, z = rotor_place(vehicle, i, c[2])
        fx = -c[0] * state[ROTOR_SPEED + i] * (ux + wy * z - wz * y)
        fy = -c[1] * state[ROTOR_SPEED + i] * (uy + wz * x - wx * z)
        x -= vehicle[COM]
        y -= vehicle[COM + 1]
        z -= vehicle[COM + 2]
        wrench[3] -= z * fy
        wrench[4] += z * fx
        wrench[5] += x * fy - y * fx
        total_x += fx
        total_y += fy
    for i in range(3):
        wrench[i] += state[ROTATION + 3 * i] * total_x + state[ROTATION + 3 * i + 1] * total_y


EFFECT = Effect(
    name="rotor_drag",
    kind="wrench",
    coefficients=(
        Coefficient(
            "kdx", "N/(rad/s m/s)", (1.2e-4, 1.8e-6), "per rotor, along body x", minimum=0.0
        ),
        Coefficient(
            "kdy", "N/(rad/s m/s)", (1.2e-4, 1.8e-6), "per rotor, along body y", minimum=0.0
        ),
        CENTRAL,
    ),
    source="Martin and Salaun, The True Role of Accelerometer Feedback in Quadrotor Control, ICRA "
    "2010; sizes: Svacha et al., ICUAS 2017 (0.5 kg), Foerster, ETH Zurich 2015 (0.03 kg)",
    excitation="horizontal flight at 1 m/s and more along both body axes, at several loads "
    "(climbs, hard turns): rotor drag grows with the rotor speeds, body drag does not",
    model=effect_model,
    family=Family.DRAG,
    role=Role.ROTOR_DRAG,
)
