"""Whether a log shows a flight, and the phases of one, told from its rotors and height: on the
ground, take-off, flight and landing.
"""

from math import inf
from typing import NamedTuple

import numpy as np

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import CUTOFFS, low_pass
from .flight_log import FlightLog
from .table import Array, Mask, finite_rows, lengths

GROUND, TAKE_OFF, FLIGHT, LANDING = "ground", "take-off", "flight", "landing"


def flying(total: Array) -> Mask:
    """Return the samples (N,) with enough thrust (N,), in any unit, to carry a vehicle: more than
    half of the 90th percentile.
    """
    return total > 0.5 * np.quantile(total, 0.9)


def usual_thrust(total: Array) -> float:
    """Return the median thrust of turning rotors, by their thrust (N,) in any unit; infinite: none
    turns.
    """
    turning = total[total > 0.3 * np.quantile(total, 0.95)]
    return float(np.median(turning)) if turning.size else inf


def carrying(total: Array) -> Mask:
    """Return the samples (N,) with enough thrust (N,), in any unit, to carry a mostly hovering
    vehicle: more than half of the usual thrust.
    """
    return total > 0.5 * usual_thrust(total)


def carried(rotors: Array, period: float) -> Mask:
    """Return the samples (N,), ``period`` s apart, where rotors carry a vehicle, dives included:
    by the squares of their speeds or commands (N, 4), slowly averaged.
    """
    load = low_pass((rotors**2).mean(axis=1), CUTOFFS.flying_hz, period)
    return load > 0.3 * usual_thrust(load)  # a vehicle below stands on the ground


def flew(log: FlightLog) -> tuple[str, str]:
    """Return whether a log's vehicle flew, and why: "no" where the motors never turn, "not shown"
    where the vehicle may stand or drive on the ground, or moves as no vehicle does, "unknown"
    without measured motion.
    """
    if log.has_rotor_speeds:
        total = (log.rotor_speeds**2).sum(axis=1)
    elif log.command is not None:
        total = np.nan_to_num(log.command).sum(axis=1)
    else:
        return "unknown", "neither rotor speeds nor motor commands"
    if not (total > 0.0).any():
        return "no", "the motors never turn"
    aloft = carrying(total)
    told = f"yes, {np.diff(log.t)[aloft[:-1]].sum():.3g} s"
    rows = aloft & finite_rows(log.position)
    place = log.position[rows]
    if len(place) > 1:
        speeds = lengths(np.diff(place, axis=0)) / np.diff(log.t[rows])
        # no quadrotor flies faster than 200 m/s; leaps of the pose, at most 5 %, are no speed
        if (speed := np.quantile(speeds, 0.95)) > 200.0:
            return "not shown", (
                f"the position moves by {speed:.2g} m/s: another unit, or a simulation that blew up"
            )
        x, y, z = np.ptp(np.quantile(place, [0.01, 0.99], axis=0), axis=0)
        far = np.linalg.norm((x, y, z))
        said = f"the position spans {far:.3g} m, {z:.3g} m in height"
        # a flight over 2 m changes its height by more than 3 mm
        drove = np.hypot(x, y) > 2.0 and z < 0.003
        # a vehicle at rest moves by less, whatever the noise of its pose
        return "not shown" if far < 0.1 or drove else told, said
    if log.gyro is not None:
        rates = log.gyro[aloft & finite_rows(log.gyro)]
        count = max(1, round(0.2 / log.period))
        means = rates[: len(rates) // count * count].reshape(-1, count, 3).mean(axis=1)
        turns = means.std(axis=0).max(initial=0.0) if len(means) else 0.0
        said = f"the motors run, and the body turns at {turns:.2g} rad/s"
        # means of a vehicle at rest turn by less, whatever its vibration
        return "unknown" if turns < 0.03 else told, said
    return "unknown", "the motors run, and no motion was logged"


class Phase(NamedTuple):
    """One stretch of a flight, from ``start`` to ``end`` in s."""

    name: str
    start: float
    end: float


def flight_phases(t: Array, height: Array, rotor_speeds: Array, vehicle: Vehicle) -> list[Phase]:
    """Return the phases of a flight in order of time; without gaps.

    A log beginning (or ending) with turning rotors begins (or ends) in flight. Take-off lasts from
    leaving the ground until the first climb ends, landing from the start of the last descent until
    touching the ground.

    Args:
        t: (N,) s.
        height: (N,) m.
        rotor_speeds: (N, 4) rad/s.
        vehicle: the vehicle.
    """
    at_rest = rotor_speeds**2 @ vehicle.k < 0.1 * vehicle.weight
    times, last = t.tolist(), len(t) - 1
    on = _run(at_rest)
    off = last - _run(at_rest[::-1])
    starts, lands = on > 0, off < last  # whether the log shows take-off and landing
    before = np.median(height[:on]) if starts else -inf
    after = np.median(height[off + 1 :]) if lands else -inf
    clear = height > max(before, after) + 0.05  # m above the place of rest
    clear[:on] = clear[off + 1 :] = False
    if not clear.any():  # the vehicle never left the ground
        return [Phase(GROUND, times[0], times[-1])]

    # well above the ground: a bounce on landing is no flight
    typical = np.median(height[clear])
    climb = (np.interp(t + 0.25, t, height) - np.interp(t - 0.25, t, height)) / 0.5
    lift_off, cruise, descent, touch_down = 0, 0, last, last
    if starts:
        lift_off, cruise = _first_climb(clear, height, before, typical, climb)
    if lands:  # a take-off, backwards in time
        up, end = _first_climb(clear[::-1], height[::-1], after, typical, -climb[::-1])
        touch_down, descent = last - up, last - end
    cruise, descent = min(cruise, touch_down), max(descent, lift_off)
    if cruise > descent:  # a hop: up and down again at once
        cruise = descent = (cruise + descent) // 2
    edges = [times[i] for i in (0, lift_off, cruise, descent, touch_down, last)]
    names = (GROUND, TAKE_OFF, FLIGHT, LANDING, GROUND)
    return [p for p in map(Phase, names, edges, edges[1:]) if p.end > p.start]


def _first_climb(
    clear: Mask, height: Array, ground: float, typical: float, climb: Array
) -> tuple[int, int]:
    """Return the first sample off the ground, and the first behind the climb (N,) from there."""
    up = int((clear & (height >= ground + 0.2 * (typical - ground))).argmax())
    return up - _run(clear[up::-1]) + 1, up + _run(climb[up:] > 0.1)  # m/s


def _run(true: Mask) -> int:
    """Return how many elements from the first on are True."""
    return int(np.append(true, False).argmin())
