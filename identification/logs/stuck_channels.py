"""Channels that stand still while their sisters change, and rotor speeds that stand in a log twice:
what a hung sensor and a wrong column leave.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import runs_of
from .flight_log import FlightLog

Array = NDArray[np.float64]

LEAST_SECONDS = 0.5  # that a channel stands still; a busy link repeats a few samples
# changes of each sister meanwhile: of channels that change equally often, the chance that one does
# not at all is at most exp(-20)
SISTERS_CHANGE = 20
_AT_LIMIT = 0.99  # of the fastest rotor speed: a rotor at its limit stands still rightly


def stuck_notes(log: FlightLog, vehicle: Vehicle) -> tuple[str, ...]:
    """Return a note for each channel that repeats to the last digit, for half a second or more in
    flight, while the other channels of its kind change, and for one that stands there twice.

    Args:
        log: the flight.
        vehicle: whose rotors may stand at their limit.
    """
    seen = np.flatnonzero(log.valid)
    thrust = np.square(log.rotor_speeds) @ vehicle.k
    flying = thrust > 0.3 * vehicle.weight
    notes = []
    rotors = [log.rotor_speeds[:, i] for i in range(4)]
    for i, speeds in enumerate(rotors):
        still = np.append(False, speeds[1:] == speeds[:-1]) & flying & (speeds > 0.0)
        if vehicle.omega_max > 0.0:
            still &= speeds < _AT_LIMIT * vehicle.omega_max
        notes += _note(f"omega{i + 1}", "the other rotor speeds", log.t, still, rotors, i)
    axes = [log.position[seen, i] for i in range(3)]
    turning = [log.quaternion[seen, i] for i in range(4)]
    for i, position in enumerate(axes):
        still = np.append(False, position[1:] == position[:-1]) & flying[seen]
        notes += _note(f"p{'xyz'[i]}", "the other coordinates", log.t[seen], still, axes, i)
    held = np.append(False, np.all(np.diff(np.column_stack(turning), axis=0) == 0.0, axis=1))
    notes += _note(
        "the attitude", "the coordinates", log.t[seen], held & flying[seen], [turning[0], *axes], 0
    )
    return (*notes, *_doubled(rotors))


def _doubled(rotors: list[Array]) -> list[str]:
    """Return a note where two rotors have the same speeds to the last digit in every row and the
    two others have not: a flight in one plane without noise has two such pairs.
    """
    alike = [
        (i, j)
        for i, j in combinations(range(4), 2)
        if np.count_nonzero(np.diff(rotors[i])) >= SISTERS_CHANGE
        and np.array_equal(rotors[i], rotors[j])
    ]
    if len(alike) != 1:
        return []
    ((i, j),) = alike
    return [
        f"warning: the columns omega{i + 1} and omega{j + 1} are the same in every row: if one is "
        "written under both names, force and torque are wrong"
    ]


def _note(
    name: str, others: str, t: Array, still: NDArray[np.bool_], sisters: list[Array], own: int
) -> list[str]:
    """Return a note on the longest stretch (s) in which a channel stands still and its sisters do
    not, if there is one.
    """
    changes = [
        np.append(0, np.cumsum(np.diff(other) != 0.0))
        for i, other in enumerate(sisters)
        if i != own
    ]
    found = []
    for first, end in runs_of(still):
        seconds = float(t[end - 1] - t[first])
        changed = min(int(count[end - 1] - count[first]) for count in changes)
        if seconds >= LEAST_SECONDS and changed >= SISTERS_CHANGE:
            found.append((seconds, float(t[first])))
    if not found:
        return []
    return [
        f"warning: {name} stands still for {_longest(found)} while {others} change: what depends "
        "on it there is wrong if its sensor hung"
    ]


def stretches(rows: NDArray[np.bool_], t: Array, least: float) -> str:
    """Return the longest run of rows (N,) that lasts more than ``least`` s, and how many do, in
    words; nothing where none does.
    """
    runs = [(float(t[end - 1] - t[first]), float(t[first])) for first, end in runs_of(rows)]
    found = [run for run in runs if run[0] > least]
    return _longest(found) if found else ""


def _longest(found: list[tuple[float, float]]) -> str:
    """Return runs (s, and their beginnings) in words."""
    seconds, begin = max(found, key=lambda run: run[0])
    return f"{seconds:.3g} s from t = {begin:.6g} s ({len(found)} such stretch(es))"
