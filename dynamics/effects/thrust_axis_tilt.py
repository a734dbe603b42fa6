"""Thrust axis tilt: the rotors' thrust does not point along body z.

With n = R(ax, ay) e_z, e_z turned by the rotation vector (ax, ay, 0) rad, thrust T_i acts along n instead of e_z: the
force T_i (n - e_z) in body axes at each rotor is added. Reaction torques stay about body z.
"""

import math

from numba import cfunc

from .base import LAW, ROTOR_POSITION, ROTOR_THRUST, Coefficient, Effect
from .parts import push


@cfunc(LAW, cache=True)
def law(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    angle = math.sqrt(c[0] * c[0] + c[1] * c[1])
    scale = math.sin(angle) / angle if angle > 1e-12 else 1.0
    nx, ny, nz = scale * c[1], -scale * c[0], math.cos(angle) - 1.0
    for i in range(4):
        thrust = state[ROTOR_THRUST + i]
        push(vehicle, state, wrench, vehicle[ROTOR_POSITION + 3 * i], vehicle[ROTOR_POSITION + 3 * i + 1],
             vehicle[ROTOR_POSITION + 3 * i + 2], thrust * nx, thrust * ny, thrust * nz)


EFFECT = Effect(
    name="thrust_axis_tilt",
    kind="wrench",
    coefficients=tuple(
        Coefficient(f"a{axis}", "rad", (0.02, 0.02), f"about body {axis}", minimum=-0.8, maximum=0.8) for axis in "xy"
    ),
    source="definition; also markers put on the body at a small angle",
    confused_with=("world_tilt", "constant_force", "com_offset"),
    excitation="yaw through half a turn and more: this force turns with the body, that of a tilted world or a steady force "
    "stays; vertical accelerations, with which it grows",
    law=law,
)
