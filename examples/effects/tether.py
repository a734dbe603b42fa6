"""Tether: an elastic thread from the vehicle to a hook in the room, without slack.

F = k (hook - x) in the world frame at the geometric centre, with the hook 2.5 m above the room's
origin.
"""

from windwrench.dynamics.effects.base import (
    COM,
    POSITION,
    ROTATION,
    Coefficient,
    Effect,
    compiled_model,
)

HOOK = (0.0, 0.0, 2.5)  # m, world


@compiled_model
def effect_model(c, vehicle, state, wrench):
    """Add force (world) and torque (body, about the centre of mass) to ``wrench`` (6,)."""
    fx = c[0] * (HOOK[0] - state[POSITION])
    fy = c[0] * (HOOK[1] - state[POSITION + 1])
    fz = c[0] * (HOOK[2] - state[POSITION + 2])
    wrench[0] += fx
    wrench[1] += fy
    wrench[2] += fz
    # the force in body axes; its lever is from the centre of mass to the geometric centre
    bx = state[ROTATION] * fx + state[ROTATION + 3] * fy + state[ROTATION + 6] * fz
    by = state[ROTATION + 1] * fx + state[ROTATION + 4] * fy + state[ROTATION + 7] * fz
    bz = state[ROTATION + 2] * fx + state[ROTATION + 5] * fy + state[ROTATION + 8] * fz
    wrench[3] -= vehicle[COM + 1] * bz - vehicle[COM + 2] * by
    wrench[4] -= vehicle[COM + 2] * bx - vehicle[COM] * bz
    wrench[5] -= vehicle[COM] * by - vehicle[COM + 1] * bx


EFFECT = Effect(
    name="tether",
    kind="wrench",
    coefficients=(Coefficient("k", "N/m", (0.1, 0.006), "stiffness", minimum=0.0),),
    source="Hooke's law; size: a thread that pulls with 5 % of the weight at 2 m",
    excitation="flight over a metre and more along every axis; in one place it is a constant force",
    model=effect_model,
)
