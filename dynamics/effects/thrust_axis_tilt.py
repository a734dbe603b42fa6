"""Thrust axis tilt: the rotors' frame is turned against the body's axes, so thrust does not point
along body z.

Q is the turn by the rotation vector (ax, ay, 0) rad. The rotors' thrust T e_z and torque tau about
the geometric centre act as T Q e_z and Q tau; the effect adds the differences to T e_z and tau.
"""

from .base import Effect, along
from .declaration import Family, Role

EFFECT = Effect(
    name="thrust_axis_tilt",
    kind="wrench",
    coefficients=along(
        "a{}", "rad", (0.02, 0.02), "turn about body {}", minimum=-0.8, maximum=0.8, axes="xy"
    ),
    source="definition; also markers put on the body at a small angle",
    excitation="yaw through half a turn and more: this force turns with the body, that of a tilted "
    "world or a steady force stays; vertical accelerations, with which it grows",
    model="thrust_axis_tilt",
    family=Family.ALIGNMENT,
    role=Role.THRUST_AXIS,
)
