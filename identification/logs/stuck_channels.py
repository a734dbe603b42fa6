"""Channels that stand still while their sisters change, and rotor speeds that stand in a log twice:
what a hung sensor and a wrong column leave.
"""

from itertools import combinations

import numpy as np

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import runs_of
from .flight_log import FlightLog
from .table import Array, Mask

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
    rotors, seen = log.rotor_speeds, np.flatnonzero(log.valid)
    aloft = np.square(rotors) @ vehicle.k > 0.3 * vehicle.weight
    turning = (rotors > 0.0) & (rotors < (_AT_LIMIT * vehicle.omega_max or np.inf))
    place, turn, flown = log.position[seen], log.quaternion[seen], aloft[seen]
    notes = []
    for i in range(4):
        others = np.delete(rotors, i, axis=1), "the other rotor speeds"
        notes += _note(f"omega{i + 1}", log.t, aloft & turning[:, i], rotors[:, [i]], *others)
    for i, axis in enumerate("xyz"):
        others = np.delete(place, i, axis=1), "the other coordinates"
        notes += _note(f"p{axis}", log.t[seen], flown, place[:, [i]], *others)
    notes += _note("the attitude", log.t[seen], flown, turn, place, "the coordinates")
    # in every row; a flight in one plane without noise has two such pairs
    alike = [
        (i + 1, j + 1)
        for i, j in combinations(range(4), 2)
        if np.count_nonzero(np.diff(rotors[:, i])) >= SISTERS_CHANGE
        and np.array_equal(rotors[:, i], rotors[:, j])
    ]
    if len(alike) == 1:
        notes.append(
            "warning: the columns omega{} and omega{} are the same in every row: if one is written "
            "under both names, force and torque are wrong".format(*alike[0])
        )
    return tuple(notes)


def _note(name: str, t: Array, rows: Mask, channel: Array, sisters: Array, names: str) -> list[str]:
    """Return a note on the stretches of rows (N,) in which a channel (N, k) stands still and its
    sisters (N, m), called ``names``, do not, if there is one.
    """
    still = np.append(False, np.all(np.diff(channel, axis=0) == 0.0, axis=1)) & rows
    changes = np.cumsum(np.diff(sisters, axis=0, prepend=sisters[:1]) != 0.0, axis=0)
    for first, end in runs_of(still):
        if np.min(changes[end - 1] - changes[first]) < SISTERS_CHANGE:
            still[first:end] = False
    found = stretches(still, t, LEAST_SECONDS)
    wrong = "what depends on it there is wrong if its sensor hung"
    text = f"warning: {name} stands still for {found} while {names} change: {wrong}"
    return [text] if found else []


def stretches(rows: Mask, t: Array, least: float) -> str:
    """Return the longest run of rows (N,) that lasts at least ``least`` s, and how many do, in
    words; nothing where none does.
    """
    runs = [(float(t[end - 1] - t[first]), float(t[first])) for first, end in runs_of(rows)]
    found = [run for run in runs if run[0] >= least]
    if not found:
        return ""
    seconds, begin = max(found, key=lambda run: run[0])
    return f"{seconds:.3g} s from t = {begin:.6g} s ({len(found)} such stretch(es))"
