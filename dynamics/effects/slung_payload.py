"""Slung payload: a load that hangs from the geometric centre by a cable and swings.

The load is a point mass m on a massless cable of length l that stays taut. With n the unit vector
from vehicle to load, f = (sum of thrusts) R e_z / M the specific force of the rotors and a =
damping (v + l n' - wind) the load's drag in the air by its mass, the cable's tension is T = (l
|n'|^2 - n (f + a)) / (1/m + 1/M), no less than zero. It pulls the vehicle with T n, and the load
swings by l n'' = -f - a - T n (1/m + 1/M). n and n' are the effect's own state, carried on once a
step; they start at rest, straight down. In hover it pulls with the load's weight.

It holds while the cable is taut. Forces on the vehicle other than thrust and weight (its drag, say)
are left out of the swing. No measurement corrects the swing: how it was at the start is forgotten,
and an error of its phase dies out, at half the damping. With a damping well below 1/s a real load
drifts out of phase with the equation, which then may explain less than ``mass`` with the same mass.
"""

import math
from collections.abc import Sequence

from ..vehicle import Vehicle
from .base import (
    HIDDEN,
    MASS,
    ROTATION,
    ROTOR_THRUST,
    STEP,
    VELOCITY,
    WIND,
    Coefficient,
    Effect,
    compiled_model,
)
from .declaration import Coefficients, Family, Found, Role, Unexplained
from .parts import add_force_at

_LENGTHS = (0.15, 0.25, 0.4, 0.65, 1.0, 1.5)  # m, cables at the start of a fit
_DAMPINGS = (0.3, 2.0)  # 1/s, the same
_LEAST_LENGTH = 0.1  # typical lengths
_MOST_DAMPING_RATIO = 0.2  # of a load that swings in air
# the effect's own state, from HIDDEN on: 0 whether it has started, 1-3 n, 4-6 n'
_N, _RATE = HIDDEN + 1, HIDDEN + 4


@compiled_model
def effect_model(c, vehicle, state, wrench):  # type: ignore[no-untyped-def]
    if not (c[0] > 0.0 and c[1] > 0.0):
        return
    specific = 0.0
    for i in range(4):
        specific += state[ROTOR_THRUST + i] / vehicle[MASS]
    nx, ny, nz = 0.0, 0.0, -1.0
    if c[HIDDEN] > 0.0:
        nx, ny, nz = c[_N], c[_N + 1], c[_N + 2]
    pull = 0.0
    for i in range(3):
        n = nx if i == 0 else ny if i == 1 else nz
        rate = c[_RATE + i]
        drag = c[2] * (state[VELOCITY + i] + c[1] * rate - state[WIND + i])
        pull += c[1] * rate * rate - n * (state[ROTATION + 3 * i + 2] * specific + drag)
    tension = max(pull / (1.0 / c[0] + 1.0 / vehicle[MASS]), 0.0)
    # the cable's pull in body axes
    bx = state[ROTATION] * nx + state[ROTATION + 3] * ny + state[ROTATION + 6] * nz
    by = state[ROTATION + 1] * nx + state[ROTATION + 4] * ny + state[ROTATION + 7] * nz
    bz = state[ROTATION + 2] * nx + state[ROTATION + 5] * ny + state[ROTATION + 8] * nz
    add_force_at(vehicle, state, wrench, 0.0, 0.0, 0.0, tension * bx, tension * by, tension * bz)


@compiled_model
def advance(c, vehicle, state, rotors):  # type: ignore[no-untyped-def]
    if not (c[0] > 0.0 and c[1] > 0.0):
        return
    if c[HIDDEN] == 0.0:
        c[HIDDEN], c[_N + 2] = 1.0, -1.0
    dt, specific, pull = rotors[STEP], 0.0, 0.0
    for i in range(4):
        specific += state[ROTOR_THRUST + i] / vehicle[MASS]
    for i in range(3):
        drag = c[2] * (state[VELOCITY + i] + c[1] * c[_RATE + i] - state[WIND + i])
        pull += c[1] * c[_RATE + i] ** 2 - c[_N + i] * (
            state[ROTATION + 3 * i + 2] * specific + drag
        )
    pull = max(pull, 0.0)
    length, turning = 0.0, 0.0
    for i in range(3):
        drag = c[2] * (state[VELOCITY + i] + c[1] * c[_RATE + i] - state[WIND + i])
        c[_RATE + i] -= (
            dt * (state[ROTATION + 3 * i + 2] * specific + drag + pull * c[_N + i]) / c[1]
        )
    for i in range(3):
        c[_N + i] += dt * c[_RATE + i]
        length += c[_N + i] ** 2
    length = math.sqrt(length)
    for i in range(3):
        c[_N + i] /= length
        turning += c[_N + i] * c[_RATE + i]
    for i in range(3):
        c[_RATE + i] -= turning * c[_N + i]


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
    model=effect_model,
    advance=advance,
    family=Family.LOAD,
    role=Role.SUSPENDED_LOAD,
    any_size=True,
    starting_points=starting_points,
    possible=possible,
    implausible=implausible,
)
