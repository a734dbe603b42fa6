"""Tether: an elastic thread from the vehicle to a hook in the room, without slack.

F = k (hook - x) in the world frame at the geometric centre, with the hook 2.5 m above the room's
origin.
"""

import numpy as np

from windwrench.dynamics.effects.base import Coefficient, Effect

HOOK = np.array([0.0, 0.0, 2.5])  # m, world


def effect_model(c, vehicle, state, wrench):
    """Add force (3,) in the world, and torque (3,) in the body about the centre of mass."""
    force = c[0] * (HOOK - state.position)
    wrench.force += force
    # the lever is from the centre of mass to the geometric centre; np.cross takes 16 us
    x, y, z = -vehicle.com
    fx, fy, fz = force @ state.rotation  # in body axes
    wrench.torque += y * fz - z * fy, z * fx - x * fz, x * fy - y * fx


EFFECT = Effect(
    name="tether",
    kind="wrench",
    coefficients=(Coefficient("k", "N/m", (0.1, 0.006), "stiffness", minimum=0.0),),
    source="Hooke's law; size: a thread that pulls with 5 % of the weight at 2 m",
    excitation="flight over a metre and more along every axis; in one place it is a constant force",
    model=effect_model,
)
