"""What a log says of the vehicle that flew: its airframe, its outputs, and what moved.

A quadrotor is what this kit knows. Every reader fills the same form from what its log states, and
one gate refuses what is none, before four of six motors are taken for a quadrotor's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .rotor_orders import Order
from .table import Array

# MAVLink's MAV_TYPE, as PX4's parameter MAV_TYPE, its vehicle_status and heartbeats have it
MAV_TYPES = {
    1: "a fixed-wing plane",
    2: "a quadrotor",
    3: "a coaxial helicopter",
    4: "a helicopter",
    7: "an airship",
    10: "a ground rover",
    11: "a boat",
    12: "a submarine",
    13: "a hexarotor",
    14: "an octorotor",
    15: "a tricopter",
    16: "a flapping wing",
    19: "a VTOL plane",
    20: "a VTOL plane",
    21: "a VTOL plane",
    22: "a VTOL plane",
    23: "a VTOL plane",
    24: "a VTOL plane",
    25: "a VTOL plane",
    29: "a dodecarotor",
    35: "a decarotor",
}
QUADROTOR = "a quadrotor"
_ROTORS = {QUADROTOR: 4, "a tricopter": 3, "a hexarotor": 6, "an octorotor": 8}
_ROTORS |= {"a decarotor": 10, "a dodecarotor": 12}
_QUADRANTS = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))  # x forward, y left
_APART = np.radians(30.0)  # by which a motor may stand off the rotor that it is


@dataclass(frozen=True)
class RunningSettings:
    """When an output beside the four motors runs as they do."""

    level: float = 0.25  # of the span of the motors' range: how far its median is off theirs
    moves: float = 0.02  # of that span: the least that it moves
    correlation: float = 0.5  # with the mean of the four


RUNNING = RunningSettings()


@dataclass(frozen=True)
class WhatFlew:
    """What a log states of its vehicle; empty and None: nothing.

    Attributes:
        airframe: in words, such as "a hexarotor".
        by: the parameter, message or header that says so.
        rotors: how many it has.
        running: how many outputs run as motors do.
        outputs: protocol and range of the motors' outputs, in words.
    """

    airframe: str = ""
    by: str = ""
    rotors: int | None = None
    running: int | None = None
    outputs: str = ""

    def refusal(self) -> str:
        """Return why the log is none of a quadrotor, as a sentence; empty where it may be one."""
        count = self.rotors if self.rotors is not None else _ROTORS.get(self.airframe)
        with_rotors = "" if count in (None, 4) else f" with {count} rotors"
        if self.airframe not in ("", QUADROTOR) or with_rotors:
            what = self.airframe or "a vehicle"
            return f"{self.by} says {what}{with_rotors}; expected a quadrotor"
        if self.running not in (None, 4) and not self.airframe:
            return (
                f"{self.running} outputs run as motors do, so it is no quadrotor; expected four, "
                "or a log that states a quadrotor"
            )
        return ""

    def rows(self) -> list[tuple[str, str, str]]:
        """Return what is known, as rows of a table: what, its value, and what says it."""
        told = [
            ("airframe", self.airframe.partition(" ")[2], self.by),
            ("rotors", "" if self.rotors is None else str(self.rotors), self.by),
            ("running", "" if self.running is None else f"{self.running} outputs", "their values"),
            ("outputs", self.outputs, ""),
        ]
        return [row for row in told if row[1]]


UNSTATED = WhatFlew()


def check_flown(path: object, flown: WhatFlew) -> None:
    """Check that a log is a quadrotor's.

    Raises:
        InputError: it states another vehicle, or other outputs than four run.
    """
    if why := flown.refusal():
        raise InputError(f"{path}: {why}")


def running(outputs: Array, low: float, high: float) -> list[int]:
    """Return which outputs (N, k), of which the first four are motors, run as these do.

    Args:
        outputs: in any unit; NaN: not sent.
        low: end of the motors' range, where they stand.
        high: the other end.
    """
    x = (np.nan_to_num(outputs, nan=low) - low) / (high - low)
    flying = x[:, :4].mean(axis=1) > 0.5 * float(np.quantile(x[:, :4].mean(axis=1), 0.9))
    x = x[flying]
    out = list(range(min(4, outputs.shape[1])))
    if len(x) < 2:
        return out
    motors = x[:, :4].mean(axis=1)
    for i in range(4, x.shape[1]):
        near = abs(float(np.median(x[:, i])) - float(np.median(motors))) < RUNNING.level
        moves = float(np.ptp(x[:, i])) > RUNNING.moves
        if near and moves and np.corrcoef(x[:, i], motors)[0, 1] > RUNNING.correlation:
            out.append(i)
    return out


def order_by_places(
    places: Sequence[tuple[float, float]], vehicle: Vehicle | None = None
) -> Order | None:
    """Return which motor, from 1, each of the vehicle's rotors is, by their directions from the
    centre; None where they do not match.

    Args:
        places: (x forward, y left) of motors 1 to 4, in any unit.
        vehicle: with rotors wherever its file has them; None: one in each quadrant.
    """
    rotors = _QUADRANTS if vehicle is None else vehicle.positions[:, :2].tolist()
    motors = np.arctan2(*np.array(places, dtype=np.float64).T[::-1])
    wanted = np.arctan2(*np.array(rotors, dtype=np.float64).T[::-1])
    off = np.abs(np.angle(np.exp(1j * (wanted[:, None] - motors))))
    found = [int(i) for i in np.argmin(off, axis=1)]
    if sorted(found) != [0, 1, 2, 3] or off.min(axis=1).max() > _APART:
        return None
    first, second, third, fourth = (i + 1 for i in found)
    return first, second, third, fourth
