"""A law acts at once and lasts; a flight loop's answer comes a moment later, and shared noise is gone a moment later."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from windwrench.identification.feedback import is_law

PERIOD = 0.04
ROWS = 1500


def flights(pieces=1):
    start = np.zeros(ROWS, dtype=bool)
    start[:: ROWS // pieces] = True
    return SimpleNamespace(period=PERIOD, start=start, fit=np.ones(ROWS, dtype=bool))


def white(x):
    return x


def smooth(seed, seconds=0.15):
    x = gaussian_filter1d(np.random.default_rng(seed).standard_normal((ROWS, 6)), seconds / PERIOD, axis=0)
    return x / x.std()


@pytest.mark.parametrize("late", [0, 1, 2, 3])
def test_what_comes_after_the_residual_is_an_answer(late):
    gusts = smooth(0)
    answer = 0.3 * np.roll(gusts, late, axis=0)
    for sign in (1.0, -1.0):
        assert is_law(flights(), white, sign * answer, gusts + 0.5 * smooth(1)) == (late == 0)
    assert is_law(flights(), white, 0.3 * np.roll(gusts, -late, axis=0), gusts)


def test_an_answer_may_be_of_the_other_sign_and_well_after_a_first_that_is_not():
    gusts = smooth(0)
    answer = np.roll(gusts, 1, axis=0) - 1.5 * np.roll(gusts, 5, axis=0)
    assert np.sum(answer * gusts) > 0.0
    for sign in (1.0, -1.0):
        assert not is_law(flights(), white, sign * answer, gusts)
    assert is_law(flights(), white, answer, answer + 0.1 * gusts)


@pytest.mark.parametrize("seed", range(5))
def test_a_small_law_in_much_noise_is_none(seed):
    law, noise = smooth(seed), np.random.default_rng(seed + 100).standard_normal((ROWS, 6))
    assert is_law(flights(), white, law, 0.08 * law + noise)


@pytest.mark.parametrize("seed", range(5))
def test_noise_in_common_is_no_law(seed):
    law, noise = smooth(seed), np.random.default_rng(seed).standard_normal((ROWS, 6))
    assert not is_law(flights(), white, law + 0.5 * noise, 0.2 * noise)
    assert is_law(flights(), white, law + 0.5 * noise, law + 0.2 * noise)


def test_pieces_are_shifted_apart():
    # what ends one piece would answer what begins the next
    f = flights(pieces=2)
    remainder, explained = np.zeros((ROWS, 6)), np.zeros((ROWS, 6))
    remainder[ROWS // 2 - 2 : ROWS // 2] = 100.0
    explained[ROWS // 2 : ROWS // 2 + 2] = 1.0
    remainder[100:110] = explained[100:110] = 1.0
    assert not is_law(flights(), white, explained, remainder)
    assert is_law(f, white, explained, remainder)
