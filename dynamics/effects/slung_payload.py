"""Slung payload: a load that hangs from the geometric centre by a cable and swings.

The load is a point mass m on a taut, massless cable of length l. The unit vector n points from
vehicle to load. The rotors' specific force is f = (sum of thrusts) R e_z / M, and the load's drag
by its mass is a = damping (v + l n' - wind). The cable's tension is T = (l |n'|^2 - n (f + a)) /
(1/m + 1/M), at least zero. The cable pulls the vehicle with T n, and the load swings by l n'' = -f
- a - T n (1/m + 1/M). The effect integrates n and n' once a step, from rest, straight down. In
hover the cable pulls with the load's weight.

The equation holds for a taut cable. The swing neglects forces on the vehicle other than thrust and
weight, such as drag. No measurement corrects the swing. Errors of its start and phase decay at half
the damping. With a damping well below 1/s a real load drifts out of phase with the equation. Then
``mass`` with the same mass may explain more.
"""

import math
from collections.abc import Sequence

from ..vehicle import Vehicle
from .base import Coefficient, Effect
from .declaration import Coefficients, Family, Found, Role, Unexplained

_LENGTHS = (0.15, 0.25, 0.4, 0.65, 1.0, 1.5)  # m, cables at the start of a fit
_DAMPINGS = (0.3, 2.0)  # 1/s, the same
_LEAST_LENGTH = 0.1  # typical lengths
_MOST_DAMPING_RATIO = 0.2  # a load that swings in air


def starting_points(flights: Unexplained) -> Sequence[Coefficients]:
    """Return loads of typical mass on cables of several lengths, or of the length that is fixed:
    without a length there is no load, and the swing's frequency is not found from far away.
    """
    lengths = (flights.fixed["l"],) if "l" in flights.fixed else _LENGTHS
    return [
        {
            "m": flights.typical["m"],
            "l": length,
            "damping": flights.fixed.get("damping", damping),
        }
        for length in lengths
        for damping in (_DAMPINGS if "damping" not in flights.fixed else (0.0,))
    ]


def possible(coefficients: Coefficients, vehicle: Vehicle) -> bool:
    """Return whether air damps a load so much: one that is damped more imitates a drag."""
    length = coefficients["l"]
    return not (
        length > 0.0
        and coefficients["damping"]
        > 2.0 * _MOST_DAMPING_RATIO * math.sqrt(vehicle.gravity / length)
    )


def implausible(found: Found) -> str:
    """Return why a found load is none: its cable is too short to swing."""
    if found.coefficients["l"] >= _LEAST_LENGTH * found.typical["l"]:
        return ""
    return "hangs on hardly any cable, like a mass"


EFFECT = Effect(
    name="slung_payload",
    kind="wrench",
    coefficients=(
        Coefficient("m", "kg", (0.03, 0.003), "mass of the load", minimum=0.0),
        Coefficient("l", "m", (0.3, 0.2), "length of the cable", minimum=0.0, maximum=20.0),
        Coefficient(
            "damping",
            "1/s",
            (0.3, 0.3),  # measured flights with 5 g on 0.5 m showed 0.4
            "drag of the load in the air by its mass",
            minimum=0.0,
            maximum=20.0,
        ),
    ),
    source="Sreenath, Michael and Kumar, Trajectory Generation and Control of a Quadrotor with a "
    "Cable-Suspended Load, ICRA 2013; sizes: a tenth of the vehicle's mass",
    excitation="horizontal starts and stops, then hover: the load goes on swinging at its own "
    "frequency, which gives the cable's length",
    model="slung_payload",
    family=Family.LOAD,
    role=Role.SUSPENDED_LOAD,
    any_size=True,
    starting_points=starting_points,
    possible=possible,
    implausible=implausible,
)
