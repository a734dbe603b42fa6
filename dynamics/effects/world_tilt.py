"""World tilt: the motion capture's vertical is tilted.

Reported position and attitude are turned about the world's axes by the rotation vector (ax, ay, 0)
rad: p' = Q p, R' = Q R.
"""

from .base import Effect, along
from .declaration import Family

EFFECT = Effect(
    name="world_tilt",
    kind="sensing",
    coefficients=along(
        "a{}", "rad", (0.01, 0.01), "about world {}", minimum=-0.8, maximum=0.8, axes="xy"
    ),
    source="definition; the ground plane of a motion capture is set with a square on a floor that "
    "is level to some mrad",
    excitation="yaw through half a turn and more, against a tilted thrust axis; no flight tells it "
    "from a steady force: a tilted level frame leaves a constant force, the weight times the tilt",
    model="world_tilt",
    family=Family.ALIGNMENT,
)
