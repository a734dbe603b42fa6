"""Rotor speeds that no quadrotor has: equal columns, uneven rotors, an impossible thrust."""

import math
from collections.abc import Sequence

import numpy as np

from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from .channels import MotionPiece

_MOST_UNEVEN = 2.0  # ratio of two rotors' medians in flight
# thrust over air density, disc area and squared tip speed: propellers of 0.03 to 5 kg have 0.005 to
# 0.03; a radius known by the arm alone may be off by a factor of 1.4, thrust then by 4
_THRUST_COEFFICIENTS = (0.002, 0.1)
_AIR_DENSITY = 1.225  # kg/m3


def check_rotors(pieces: Sequence[MotionPiece], logs: Sequence[FlightLog]) -> None:
    """Check that four rotors carry each log's vehicle.

    Raises:
        InputError: two rotors have the same values in every row, or medians a factor of 2 apart.
    """
    for number, log in enumerate(logs):
        parts = [p for p in pieces if p.log == number]
        commanded = any(p.rotor_speeds is None for p in parts)
        drives = [p.command if commanded else p.rotor_speeds for p in parts]
        if not drives:
            continue
        rotors = np.concatenate([drive for drive in drives if drive is not None])
        what = "commands" if commanded else "rotor speeds"
        for i, j in zip(*np.triu_indices(4, 1), strict=True):
            if np.array_equal(rotors[:, i], rotors[:, j]):
                raise InputError(
                    f"{log.name}: {what} of motors {i + 1} and {j + 1} are equal in every row; "
                    "expected four motors"
                )
        medians = np.median(rotors, axis=0)
        if medians.max() > _MOST_UNEVEN * medians.min():
            listed = ", ".join(f"{x:.3g}" for x in medians)
            raise InputError(
                f"{log.name}: medians of the four motors' {what} are {listed}; expected a ratio "
                f"of at most {_MOST_UNEVEN:g}"
            )


def check_thrust(k: float, radius: float, log: str) -> None:
    """Check a thrust coefficient ``k`` in N/(rad/s)^2 of a rotor with a radius in m.

    Raises:
        InputError: no propeller has such a thrust coefficient.
    """
    coefficient = k / (_AIR_DENSITY * math.pi * radius**4)
    low, high = _THRUST_COEFFICIENTS
    if low <= coefficient <= high:
        return
    usual = math.sqrt(coefficient / math.sqrt(low * high))
    raise InputError(
        f"{log}: rotor speeds: thrust coefficient {coefficient:.3g} with a rotor radius of "
        f"{radius:.3g} m; expected {low:g} to {high:g}. The speeds are about {usual:.2g} times too "
        f"{'small' if usual > 1.0 else 'large'} to be rad/s: check their unit in the log or the map"
    )
