"""The fuzzer of answers, in small: nothing that is done to a flight passes as another wrench."""

from dataclasses import replace

import pytest

from tests.fuzz.answers import FAULTS, Fault, diagnosis_of, estimate_of, replay_of

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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a rotor's speed stands still", "sign of an axis"])
def test_a_spoiled_flight_is_not_diagnosed_as_another_vehicle(name):
    outcome, words = diagnosis_of(0, NAMED[name], 0)
    assert outcome != "wrong", words
