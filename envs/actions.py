"""Actions of an agent: the five kinds, and their numbers in the flight loop's units."""

import math
from dataclasses import dataclass

import numpy as np

from ..controllers.flight import (
    ATTITUDE,
    BESIDE,
    LEAST_THRUST,
    OF_SETPOINT,
    RATES,
    ROTORS,
    FlightGains,
)
from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array
from ..runtime.errors import unknown_name

ACTIONS = ("velocity", "acceleration", "attitude", "rates", "rotors")
LARGEST = {"velocity": 1.0, "acceleration": 4.0}  # m/s and m/s2
UNITS = {"velocity": "m/s", "acceleration": "m/s2"}


@dataclass(frozen=True, eq=False)
class Action:
    """An action of ``size`` numbers from -1 to 1. ``hover + below * a`` is the command for a < 0,
    ``hover + above * a`` for the rest.
    """

    name: str
    kind: int  # one of ``controllers.flight``
    moves: bool  # whether commands are velocities of the set point
    places: np.ndarray  # (size,) indices of the commands in the set point, or in the loop's action
    hover: Array  # (size,) commands of the action 0
    below: Array
    above: Array

    @property
    def size(self) -> int:
        """Number of commands."""
        return len(self.places)

    @property
    def follows(self) -> bool:
        """Whether commands are beside a flight to the reference."""
        return self.kind == BESIDE and not self.moves


def make_action(
    name: str,
    vehicle: Vehicle,
    axes: tuple[int, ...],
    follows: bool,
    largest: float | None = None,
    gains: FlightGains | None = None,
) -> Action:
    """Return an action by its name.

    * ``"velocity"``: velocity of the set point along ``axes`` of the world, up to 1 m/s;
    * ``"acceleration"``: up to 4 m/s2 along ``axes``, added to the flight loop's if the task has a
      reference, else the set point's;
    * ``"attitude"``: roll and pitch up to the flight loop's limit (0.5 rad), yaw rate up to 2 rad/s
      (the loop's answer to 1 rad), thrust of 0.3 to 1.7 times the weight;
    * ``"rates"``: body rates up to 6.1 rad/s (the loop's answer to a right angle) and, in yaw, 2
      rad/s; the same thrust;
    * ``"rotors"``: four rotor speeds; -1: none, 0: hover, 1: the largest.

    Args:
        name: one of ``ACTIONS``.
        vehicle: the declared one.
        axes: axes of the world.
        follows: whether the flight loop follows a reference.
        largest: m/s or m/s2; default: as above.
        gains: the flight loop's.

    Raises:
        InputError: an unknown name.
    """
    if name not in ACTIONS:
        raise unknown_name("action", str(name), ACTIONS, "action")
    if name in LARGEST:
        size = np.full(len(axes), LARGEST[name] if largest is None else largest)
        moves = name == "velocity"
        kind = BESIDE if moves or follows else OF_SETPOINT
        places = np.array(axes) + (3 if moves else 0)
        return Action(name, kind, moves, places, np.zeros(len(axes)), size, size)
    gains, g = gains or FlightGains(), vehicle.gravity
    if name == "rotors":
        hover = np.full(4, vehicle.hover_rate)
        fastest = vehicle.omega_max if math.isfinite(vehicle.omega_max) else 2.0 * hover[0]
        return Action(name, ROTORS, False, np.arange(4), hover, hover, fastest - hover)
    turn, yaw_rate = gains.attitude / gains.rate, gains.yaw / gains.yaw_rate
    first = gains.tilt_limit if name == "attitude" else turn
    size = np.array([first, first, yaw_rate, (1.0 - LEAST_THRUST) * g])
    kind, hover = ATTITUDE if name == "attitude" else RATES, np.array([0.0, 0.0, 0.0, g])
    return Action(name, kind, False, np.arange(4), hover, size, size)
