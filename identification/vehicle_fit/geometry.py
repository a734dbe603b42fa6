"""The rotors' positions as a user gives them, and usual ratios of quadrotors."""

from typing import NamedTuple

import numpy as np

from ...dynamics.vehicle import QUADRANT
from ...runtime.arrays import Array
from ...runtime.errors import InputError

Interval = tuple[float, float, float]  # value, low and high

GRAVITY = 9.81  # m/s2
AIR_DENSITY = 1.225  # kg/m3, at sea level, as in PX4 and ArduPilot


# Ratios of the shipped vehicles (0.03 to 0.5 kg), for quantities missing from a flight. Behind the
# value stands a range, low and high, claimed in place of an interval.
# Jz over Jx + Jy: 0.88 to 0.96 in these vehicles; 1, the largest ratio, in a flat body
FLAT = (0.9, 0.75, 1.0)
# (Jx + Jy) / 2 over mass times the squared arm: 0.35 to 0.58 in these vehicles
GYRATION = (0.45, 0.25, 0.8)
# reaction torque over thrust, as a share of the arm: 0.18 to 0.24 in these vehicles
YAW_REACH = (0.2, 0.1, 0.4)
ROTOR_RADIUS = 0.78  # as a share of the arm: 0.71 to 0.83
# standard deviations, as shares, of thrust from day to day, invisible in the logs of one day:
# at one rotor speed sessions differ by 0.6 to 2.4 %, at one command by 10 %
THRUST_SPREAD = 0.015
COMMAND_SPREAD = 0.1
# range of a voltage's exponent: 0 if the firmware makes up for the battery, 2 if rotor speed
# follows the voltage
VOLTAGE_EXPONENTS = 2.0
HOVER_SPEED = 1000.0  # rad/s, for logs without rotor speeds


class Geometry(NamedTuple):
    """Rotor positions (4, 3) in m, front-left, rear-left, rear-right, front-right."""

    positions: Array
    known: bool = True  # False: length 1 in x and y stands for an unknown arm

    @property
    def arm(self) -> float:
        """Mean distance of the rotors from the body x and y axes, m."""
        return float(np.abs(self.positions[:, :2]).mean())


def parse_geometry(text: str | None) -> Geometry:
    """Return the geometry of ``ARM`` or of ``X1,Y1;X2,Y2;X3,Y3;X4,Y4``, in m; None: not known.

    Raises:
        InputError: neither of the two, or a quadrant without its rotor.
    """
    expected = (
        "expected the rotors' distance from the body x and y axes in m (0.12), or four positions "
        "x,y in m with semicolons between them, front-left, rear-left, rear-right, front-right"
    )
    if text is None:
        return Geometry(QUADRANT, known=False)
    try:
        rows = [[float(x) for x in row.split(",")] for row in text.split(";")]
    except ValueError as error:
        raise InputError(f"--geometry {text}: is not made of numbers; {expected}") from error
    if len(rows) == len(rows[0]) == 1 and 0.0 < rows[0][0] < 10.0:
        return Geometry(rows[0][0] * QUADRANT)
    if len(rows) != 4 or any(len(row) not in (2, 3) for row in rows):
        raise InputError(f"--geometry {text}: {expected}")
    positions = np.array([[*row, 0.0][:3] for row in rows])
    inside = positions[:, :2] * QUADRANT[:, :2] > 0.0
    if not (np.isfinite(positions).all() and inside.all()):
        raise InputError(
            f"--geometry {text}: the rotors do not stand one in each quadrant, front-left, "
            f"rear-left, rear-right, front-right; {expected}"
        )
    return Geometry(positions)
