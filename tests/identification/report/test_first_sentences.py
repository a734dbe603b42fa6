"""The first sentence of a command on hard and shared logs."""

import json

import pytest

from tests.support.golden_sentences import CASES, GOLDEN, QUICK, first_sentence

KEPT = json.loads(GOLDEN.read_bytes())


@pytest.mark.measured
@pytest.mark.parametrize(
    "case", [pytest.param(x, marks=() if x in QUICK else pytest.mark.slow) for x in CASES]
)
def test_a_first_sentence_is_the_one_that_was_read(case):
    assert first_sentence(case) == KEPT[case]
