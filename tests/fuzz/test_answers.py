"""What is wrong with a flight's log though every field of it can be read: an estimate refuses the
log, carries a note that names the fault, or is that of the log that was not spoiled.

Logs in other conventions than they declare are in ``tests/golden/readings.json``.
"""

from dataclasses import replace

import numpy as np
import pytest

from windwrench.dynamics import InputError, load_vehicle
from windwrench.dynamics.effects import parse_setting
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog, with_rows
from windwrench.identification.wrench_series import estimate_log, pose_notes

VEHICLE = load_vehicle("ardrone2")
SECONDS = 20.0
SETTLED = 2.0  # s, from the start and from a restart, until estimates are compared
SAME = 0.03  # of the weight, and of weight times arm, RMS: the same wrench
ROTORS = ("rotor", "omega", "order", "column")
POSE = ("pose", "position", "px", "py", "pz", "jump", "leap", "restart")


@pytest.fixture(scope="module")
def circle():
    """A circle under a drag that the vehicle does not declare."""
    effects = (parse_setting("rotor_drag", VEHICLE),)
    flown = record_flight(VEHICLE, effects, "circle", SECONDS, seed=1)
    return FlightLog(**flown, name="flight", source="flight.csv")


@pytest.fixture(scope="module")
def unspoiled(circle):
    return estimate_log(circle, VEHICLE)


def rotors(log, change):
    speeds = log.rotor_speeds.copy()
    change(speeds)
    return replace(log, rotor_speeds=speeds)


def position(log, change):
    moved = log.position.copy()
    change(moved)
    return replace(log, position=moved)


def swapped(speeds):
    speeds[:, [0, 2]] = speeds[:, [2, 0]]


def repeated(speeds):
    speeds[:, 1] = speeds[:, 3]


def held(columns):
    columns[1200:, 1] = columns[1200, 1]


def stopped(speeds):
    speeds[1200:, 1] = 0.0


def attitude_held(log):
    turned = log.quaternion.copy()
    turned[1200:] = turned[1200]
    return replace(log, quaternion=turned)


def outliers(columns):
    rng = np.random.default_rng(0)
    hit = rng.random(len(columns)) < 0.01
    columns[hit] += rng.standard_normal((int(hit.sum()), 3))


def moved_for_good(columns):
    columns[2000:] += [0.3, -0.4, 0.0]


def rows_lost(log, counted):
    """The log without a fifth of its rows; ``counted``: its times go on as if none were lost."""
    kept = np.random.default_rng(0).random(len(log.t)) > 0.2
    t = log.t[0] + log.period * np.arange(kept.sum()) if counted else log.t[kept]
    parts = (log.position, log.quaternion, log.rotor_speeds)
    return FlightLog(t, *(part[kept] for part in parts), name=log.name, source=log.source)


FAULTS = {
    "rotors swapped": (lambda log: rotors(log, swapped), ROTORS),
    "a rotor's column twice": (lambda log: rotors(log, repeated), ROTORS),
    "a rotor's speed stands still": (lambda log: rotors(log, held), ROTORS),
    "a rotor's speed is zero": (lambda log: rotors(log, stopped), ROTORS),
    "the attitude stands still": (attitude_held, ("the attitude stands still",)),
    "a second of rows is lost": (
        lambda log: with_rows(log, np.abs(log.t - 5.5) > 0.5),
        ("gap", *POSE),
    ),
    "every other row is lost": (lambda log: with_rows(log, np.arange(len(log.t)) % 2 == 0), ()),
    "an axis stands still": (lambda log: position(log, held), POSE),
    "outliers of the position": (lambda log: position(log, outliers), POSE),
    "a jump for good": (lambda log: position(log, moved_for_good), POSE),
    "rows lost": (lambda log: rows_lost(log, False), ("gap", "lost", "rows", *POSE)),
    "rows lost, times counted": (lambda log: rows_lost(log, True), ("clock", "moves", *POSE)),
}


def is_same(series, unspoiled):
    """Return whether a wrench is that of the unspoiled log wherever both are tracked."""
    t = series.t
    compared = (t - t[0] > SETTLED) & (series.status_code != 1)
    for row in np.flatnonzero(series.status_code == 3):
        compared &= (t < t[row]) | (t > t[row] + SETTLED)
    assert compared.sum() > 100
    for found, expected, scale in (
        (series.force, unspoiled.force, VEHICLE.weight),
        (series.torque, unspoiled.torque, VEHICLE.weight * VEHICLE.arm_l),
    ):
        there = [np.interp(t[compared], unspoiled.t, column) for column in expected.T]
        error = found[compared] - np.column_stack(there)
        if np.sqrt(np.mean(error**2)) > SAME * scale:
            return False
    return True


def outcome(log, unspoiled, words):
    try:
        series = estimate_log(log, VEHICLE)
    except InputError:
        return "refused"
    notes = [note for note in series.notes if note not in unspoiled.notes]
    if any(word in note for note in notes for word in words):
        return "noted"
    return "same" if is_same(series, unspoiled) else "wrong"


@pytest.mark.parametrize("name", FAULTS)
def test_a_spoiled_flight_is_refused_noted_or_estimated_as_if_it_were_not(name, circle, unspoiled):
    spoil, words = FAULTS[name]
    assert outcome(spoil(circle), unspoiled, words) != "wrong"


def test_another_wrench_is_told_from_the_unspoiled_one(circle, unspoiled):
    """A log whose thrust is 10 % too large is a wrong answer, and the same log is none."""
    stronger = replace(circle, rotor_speeds=1.05 * circle.rotor_speeds)
    assert outcome(stronger, unspoiled, ("no such word",)) == "wrong"
    assert outcome(circle, unspoiled, ("no such word",)) == "same"


def test_a_diagnosis_is_told_of_poses_that_jump_as_an_estimate_is(circle):
    lossy = FAULTS["rows lost, times counted"][0](circle)
    (said,) = [note for note in estimate_log(lossy, VEHICLE).notes if "poses jump" in note]
    assert said in pose_notes(lossy, VEHICLE)
    assert not pose_notes(circle, VEHICLE)
