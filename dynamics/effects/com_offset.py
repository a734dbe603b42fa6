"""Centre-of-mass offset: the centre of mass lies away from the geometric centre of the rotors.

Thrust then makes a torque about it, and the pose, which is that of the geometric centre, swings
about it.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .base import Coefficient, Effect
from .declaration import Family, Need, Role

if TYPE_CHECKING:
    from ..vehicle import Vehicle


def amend(vehicle: "Vehicle", coefficients: Mapping[str, float]) -> "Vehicle":
    """Return the vehicle with its centre of mass moved by (cx, cy, cz) m."""
    return replace(
        vehicle, com=vehicle.com + np.array([coefficients.get(f"c{axis}", 0.0) for axis in "xyz"])
    )


EFFECT = Effect(
    name="com_offset",
    kind="body",
    coefficients=tuple(
        Coefficient(
            f"c{axis}", "m", (0.005, 0.001), f"along body {axis}", minimum=-1.0, maximum=1.0
        )
        for axis in "xyz"
    ),
    source="rigid-body mechanics",
    excitation="climbs and drops for cx and cy, since their torque grows with thrust; quick roll "
    "and pitch (trajectory shake) "
    "for cz",
    amend=amend,
    family=Family.RIGID_BODY,
    role=Role.CENTRE_OF_MASS,
    needs=(Need.MOMENTS,),
    any_size=True,
)
