"""The fuzzer of answers, in small: nothing that is done to a flight passes as another wrench."""

from dataclasses import replace

import numpy as np
import pytest

from tests.fuzz.answers import FAULTS, Fault, diagnosis_of, estimate_of, flight, replay_of, vehicle
from windwrench.identification.wrench_series import estimate_log, pose_notes

NAMED = {fault.name: fault for fault in FAULTS}


@pytest.mark.parametrize("name", NAMED)
def test_a_spoiled_flight_is_refused_noted_or_estimated_as_if_it_were_not(name):
    # flight 1: a circle with a drag that the vehicle does not declare
    outcome, words = estimate_of(1, NAMED[name], 0)
    assert outcome != "wrong", words


@pytest.mark.parametrize("name", ["sign of an axis", "the pose stands still", "a jump for good"])
def test_what_is_drawn_of_a_spoiled_flight_is_refused_noted_or_the_same(name):
    outcome, words = replay_of(1, NAMED[name], 0)
    assert outcome != "wrong", words


def test_another_wrench_is_told_from_the_unspoiled_one():
    """The fuzzer itself: a log whose thrust is 10 % too large, unseen, is a wrong answer."""
    stronger = Fault(
        "stronger", lambda log, rng: replace(log, rotor_speeds=1.05 * log.rotor_speeds), ("no",)
    )
    assert estimate_of(1, stronger, 0)[0] == "wrong"


def test_a_diagnosis_is_told_of_poses_that_jump_as_an_estimate_is():
    """Rows that are lost while times are counted as if none were; slow turns."""
    lossy = NAMED["rows lost, times counted"].spoil(flight(3), np.random.default_rng([19, 3, 2]))
    (said,) = [note for note in estimate_log(lossy, vehicle()).notes if "poses jump" in note]
    assert said in pose_notes(lossy, vehicle())
    assert not pose_notes(flight(3), vehicle())


@pytest.mark.slow
def test_a_clock_that_counts_lost_rows_is_not_diagnosed_unsaid():
    outcome, words = diagnosis_of(3, NAMED["rows lost, times counted"], 19)
    assert outcome == "noted", words


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a rotor's speed stands still", "sign of an axis"])
def test_a_spoiled_flight_is_not_diagnosed_as_another_vehicle(name):
    outcome, words = diagnosis_of(0, NAMED[name], 0)
    assert outcome != "wrong", words
