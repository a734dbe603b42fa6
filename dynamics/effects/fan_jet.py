"""Fan jet: the jet of a drum fan, and the drag of a vehicle in it.

The mean wind is that of ``dynamics.mean_jet``: ``u^2 = u0^2 (annular disc) * Gaussian``, with the
inflow that continuity asks for. The fan stands at (x, y, z) m and blows horizontally, along world x
turned by ``heading`` about the vertical. Drag acts at stations, each in its own wind, which is why
a symmetric vehicle feels a torque: F = kd u in its plane at each rotor, and F = 0.6 kg/m3 * area /
8 |u| u at each of eight points of a ring on the hull, u being the wind relative to the station. It
is the jet of the fan-tracking environment without its gusts.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from ..mean_jet import AIR_DENSITY, FIRST_X, HULL_RADIUS, HULL_STATIONS, STEP_R, STEP_X, jet_table
from .base import (
    POSITION,
    RATE,
    ROTATION,
    VELOCITY,
    Coefficient,
    Effect,
    compiled_model,
)
from .declaration import Coefficients, Family, Found, Unexplained
from .parts import add_force_at, rotor_place

_AXIAL, _RADIAL = jet_table(0.45, 0.10)
_ROWS, _COLUMNS = _AXIAL.shape
_ANGLES = np.arange(HULL_STATIONS) * math.pi / 4
_RING_X, _RING_Y = HULL_RADIUS * np.cos(_ANGLES), HULL_RADIUS * np.sin(_ANGLES)

_LEAST_SPEED_RATIO = 2.0  # times the vehicle's speed, of a jet at its source
# where a fan may stand as a fit starts: the way it blows (rad), m from the flight against that
# way, and m across
_HEADINGS = tuple(2 * math.pi * k / 8 for k in range(8))
_DISTANCES, _ACROSS = (1.5, 2.5, 3.5), (-0.6, 0.0, 0.6)


@compiled_model
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    cosine, sine = math.cos(c[4]), math.sin(c[4])
    hull = 0.5 * AIR_DENSITY * c[6] / HULL_STATIONS
    R = ROTATION
    for n in range(4 + HULL_STATIONS):
        if n < 4:
            sx, sy, sz = rotor_place(vehicle, n, 0.0)
        else:
            sx, sy, sz = _RING_X[n - 4], _RING_Y[n - 4], 0.0
        # the station as seen from the fan: distance along its axis, and offset across it
        px = state[POSITION] + state[R] * sx + state[R + 1] * sy + state[R + 2] * sz - c[1]
        py = state[POSITION + 1] + state[R + 3] * sx + state[R + 4] * sy + state[R + 5] * sz - c[2]
        dz = state[POSITION + 2] + state[R + 6] * sx + state[R + 7] * sy + state[R + 8] * sz - c[3]
        distance, dy = cosine * px + sine * py, cosine * py - sine * px
        r = math.sqrt(dy * dy + dz * dz)
        row, column = (distance - FIRST_X) / STEP_X, r / STEP_R
        u, v = 0.0, 0.0
        if row >= 0.0 and row < _ROWS - 1 and column < _COLUMNS - 1:
            i, j = int(row), int(column)
            a, b = row - i, column - j
            u = (1 - a) * ((1 - b) * _AXIAL[i, j] + b * _AXIAL[i, j + 1])
            u += a * ((1 - b) * _AXIAL[i + 1, j] + b * _AXIAL[i + 1, j + 1])
            v = (1 - a) * ((1 - b) * _RADIAL[i, j] + b * _RADIAL[i, j + 1])
            v += a * ((1 - b) * _RADIAL[i + 1, j] + b * _RADIAL[i + 1, j + 1])
        u *= c[0]
        v *= c[0] / r if r > 1e-9 else 0.0
        # relative to the vehicle, in body axes
        ax = cosine * u - sine * v * dy - state[VELOCITY]
        ay = sine * u + cosine * v * dy - state[VELOCITY + 1]
        az = v * dz - state[VELOCITY + 2]
        wx, wy, wz = state[RATE], state[RATE + 1], state[RATE + 2]
        bx = state[R] * ax + state[R + 3] * ay + state[R + 6] * az - (wy * sz - wz * sy)
        by = state[R + 1] * ax + state[R + 4] * ay + state[R + 7] * az - (wz * sx - wx * sz)
        bz = state[R + 2] * ax + state[R + 5] * ay + state[R + 8] * az - (wx * sy - wy * sx)
        if n < 4:
            add_force_at(vehicle, state, wrench, sx, sy, sz, c[5] * bx, c[5] * by, 0.0)
        else:
            scale = hull * math.sqrt(bx * bx + by * by + bz * bz)
            add_force_at(vehicle, state, wrench, sx, sy, sz, scale * bx, scale * by, scale * bz)


def starting_points(flights: Unexplained) -> Sequence[Coefficients]:
    """Return fans all around the flight: from far beside its jet a fit does not find it."""
    centre, found = flights.centre, []
    for heading, distance, across in itertools.product(_HEADINGS, _DISTANCES, _ACROSS):
        along = np.array([math.cos(heading), math.sin(heading)])
        x, y = centre[:2] - distance * along + across * np.array([-along[1], along[0]])
        place = {"x": float(x), "y": float(y), "z": float(centre[2]), "heading": heading}
        found.append({**flights.typical, **place})
    return found


def implausible(found: Found) -> str:
    """Return why a found jet is none: it is not much faster than the vehicle, whose drag in still
    air it may stand for.
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
    model=effect_model,
    family=Family.SURROUNDINGS,
    starting_points=starting_points,
    implausible=implausible,
)
