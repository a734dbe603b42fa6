"""Centre-of-mass offset: the centre of mass lies away from the geometric centre of the rotors.

Thrust makes a torque about the centre of mass. The logged pose, of the geometric centre, swings
about the centre of mass.
"""

from dataclasses import replace

from ..vehicle import Vehicle
from .base import Effect, along
from .declaration import Coefficients, Family, Need, Role


def amend(vehicle: Vehicle, coefficients: Coefficients) -> Vehicle:
    """Return the vehicle with its centre of mass moved by (cx, cy, cz) m."""
    return replace(vehicle, com=vehicle.com + EFFECT.vector(coefficients))


EFFECT = Effect(
    name="com_offset",
    kind="body",
    coefficients=along("c{}", "m", (0.005, 0.001), "along body {}", minimum=-1.0, maximum=1.0),
    source="rigid-body mechanics",
    excitation="climbs and drops for cx and cy, since their torque grows with thrust; quick roll "
    "and pitch (trajectory shake) for cz",
    amend=amend,
    family=Family.RIGID_BODY,
    role=Role.CENTRE_OF_MASS,
    needs=(Need.MOMENTS,),
    any_size=True,
)
