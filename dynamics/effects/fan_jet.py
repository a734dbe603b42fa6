"""Fan jet: the jet of a drum fan, and the drag of a vehicle in it.

The mean wind is that of ``dynamics.mean_jet``: ``u^2 = u0^2 (annular disc) * Gaussian``, with the
inflow that continuity asks for. The fan stands at (x, y, z) m and blows horizontally, along world x
turned by ``heading`` about the vertical. Drag acts at stations, each in its own wind, so
a symmetric vehicle feels a torque. With u the wind relative to a station, F = kd u acts in the
plane of each rotor, and F = 0.6 kg/m3 * area / 8 |u| u at eight points of a ring on the hull. The
fan-tracking environment has the same jet, with gusts.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from ... import _core
from ..mean_jet import jet_table
from .base import Coefficient, Effect
from .declaration import Coefficients, Family, Found, Unexplained

_core.set_jet_table(*jet_table(0.45, 0.10))  # m, radii of the fan and its hub

_LEAST_SPEED_RATIO = 2.0  # times the vehicle's speed, of a jet at its source
# starting points of a fit: the fan's heading (rad), m upwind of the flight, and m across
_HEADINGS = tuple(2 * math.pi * k / 8 for k in range(8))
_DISTANCES, _ACROSS = (1.5, 2.5, 3.5), (-0.6, 0.0, 0.6)


def starting_points(flights: Unexplained) -> Sequence[Coefficients]:
    """Return fans all around the flight: from far beside its jet a fit does not find it."""
    centre, points = flights.centre, []
    for heading, distance, across in itertools.product(_HEADINGS, _DISTANCES, _ACROSS):
        along = np.array([math.cos(heading), math.sin(heading)])
        x, y = centre[:2] - distance * along + across * np.array([-along[1], along[0]])
        place = {"x": float(x), "y": float(y), "z": float(centre[2]), "heading": heading}
        points.append({**flights.typical, **place})
    return points


def implausible(found: Found) -> str:
    """Return the reason against a fitted jet: a jet hardly faster than the vehicle may be the
    vehicle's drag in still air.
    """
    if found.coefficients["u0"] >= _LEAST_SPEED_RATIO * found.speed:
        return ""
    return "blows no faster than the vehicle flies, like a drag"


EFFECT = Effect(
    name="fan_jet",
    kind="wrench",
    coefficients=(
        Coefficient(
            "u0", "m/s", (3.6, 2.0), "speed of the jet at its source", minimum=0.0, maximum=50.0
        ),
        Coefficient("x", "m", (-2.3, -2.3), "where the fan stands, world x"),
        Coefficient("y", "m", (0.0, 0.0), "where the fan stands, world y"),
        Coefficient("z", "m", (1.2, 1.2), "height of its axis, world z"),
        Coefficient(
            "heading",
            "rad",
            (0.0, 0.0),
            "where it blows, from world x towards y",
            minimum=-7.0,
            maximum=7.0,
        ),
        Coefficient("kd", "N/(m/s)", (0.02, 0.001), "drag of each rotor in its plane", minimum=0.0),
        Coefficient("area", "m2", (0.06, 0.0016), "drag area of the whole hull", minimum=0.0),
    ),
    source="momentum of a jet still in its shear layer, Pope, Turbulent Flows, 2000; sizes: the "
    "wrench that McKinnon and Schoellig, IROS 2016, measured in the jet of a drum fan",
    excitation="flight across the jet and out of it: force and torque depend on the place; its "
    "still-air drag is like rotor and body drag",
    model="fan_jet",
    family=Family.SURROUNDINGS,
    starting_points=starting_points,
    implausible=implausible,
)
