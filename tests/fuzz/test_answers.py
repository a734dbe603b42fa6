"""What is wrong with a flight's log though every field of it can be read: an estimate refuses the
log, carries a note that names the fault, or is that of the log that was not spoiled.

Logs in other conventions than they declare are in ``tests/golden/readings.json``.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.flown import VEHICLE, recorded
from tests.support.sizes import rms
from windwrench.dynamics import InputError
from windwrench.dynamics.effects import parse_setting
from windwrench.identification.logs.flight_log import with_rows
from windwrench.identification.wrench_series import estimate_log, pose_notes

SETTLED = 2.0  # s, from the start and from a restart, until estimates are compared
SAME = 0.03  # of the weight, and of weight times arm, RMS: the same wrench
ROTORS = ("rotor", "omega", "order", "column")
POSE = ("pose", "position", "px", "py", "pz", "jump", "leap", "restart")


@pytest.fixture(scope="module")
def circle():
    """A circle under a drag that the vehicle does not declare."""
    drag = parse_setting("rotor_drag", VEHICLE).coefficients
    return replace(recorded("circle", rotor_drag=drag), source="flight.csv")


@pytest.fixture(scope="module")
def unspoiled(circle):
    return estimate_log(circle, VEHICLE)


def put(field, rows, columns, value):
    """Return what gives some rows and columns of a log's channel what a function says of it."""

    def spoil(log):
        values = getattr(log, field).copy()
        values[rows, columns] = value(values)
        return replace(log, **{field: values})

    return spoil


def scattered(positions):
    rng = default_rng(0)
    hit = rng.random((len(positions), 1)) < 0.01
    return positions + hit * rng.standard_normal(positions.shape)


def rows_lost(log, counted):
    """The log without a fifth of its rows; ``counted``: its times go on as if none were lost."""
    kept = with_rows(log, default_rng(0).random(len(log.t)) > 0.2)
    return replace(kept, t=log.t[: len(kept.t)]) if counted else kept


ALL = slice(None)
LATER = slice(1200, None)
SPEEDS = "rotor_speeds"
PLACE = "position"
FAULTS = {
    "rotors swapped": (put(SPEEDS, ALL, [0, 2], lambda x: x[:, [2, 0]]), ROTORS),
    "a rotor's column twice": (put(SPEEDS, ALL, 1, lambda x: x[:, 3]), ROTORS),
    "a rotor's speed stands still": (put(SPEEDS, LATER, 1, lambda x: x[1200, 1]), ROTORS),
    "a rotor's speed is zero": (put(SPEEDS, LATER, 1, lambda x: 0.0), ROTORS),
    "the attitude stands still": (
        put("quaternion", LATER, ALL, lambda x: x[1200]),
        ("the attitude stands still",),
    ),
    "a second of rows is lost": (
        lambda log: with_rows(log, abs(log.t - 5.5) > 0.5),
        ("gap", *POSE),
    ),
    "every other row is lost": (lambda log: with_rows(log, np.arange(len(log.t)) % 2 == 0), ()),
    "an axis stands still": (put(PLACE, LATER, 1, lambda x: x[1200, 1]), POSE),
    "outliers of the position": (put(PLACE, ALL, ALL, scattered), POSE),
    "a jump for good": (put(PLACE, LATER, ALL, lambda x: np.add(x[1200:], [0.3, -0.4, 0])), POSE),
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
        if rms(error) > SAME * scale:
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
