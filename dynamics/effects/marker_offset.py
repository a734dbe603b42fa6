"""Marker offset: the reported position belongs to a point beside the geometric centre.

p' = p + R m with m = (mx, my, mz) in body axes. A correction needs the attitude,
measured or estimated.
"""

from .base import Effect, along
from .declaration import Family, Role

EFFECT = Effect(
    name="marker_offset",
    kind="sensing",
    coefficients=along("m{}", "m", (0.01, 0.005), "along body {}", minimum=-1.0, maximum=1.0),
    source="definition; the centroid of the markers on a vehicle is seldom its centre",
    excitation="quick roll and pitch (trajectory shake) for mz and fast yaw for mx and my: the "
    "point swings about the centre. An offset centre of mass also makes a torque in hover; this "
    "does not",
    model="marker_offset",
    family=Family.RIGID_BODY,
    role=Role.MARKER,
)
