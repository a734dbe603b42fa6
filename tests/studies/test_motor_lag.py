"""The lag by thrust alone, on a flight whose motors are known."""

import numpy as np
import pytest

from windwrench.studies.motor_lag.study import fitted, lagged

PERIOD, LAG, OFFSET = 0.005, 0.07, 0.012


@pytest.fixture(scope="module")
def flight():
    """Commands of 21 s, and the specific force of thrust that follows them late."""
    rng = np.random.default_rng(5)
    slow = lagged(rng.normal(size=(4200, 4)), 0.05, PERIOD)
    command = 0.5 + 0.15 * slow / slow.std()
    steps = np.arange(len(command))
    late = np.stack([np.interp(steps - OFFSET / PERIOD, steps, x) for x in command.T], axis=1)
    force = lagged((late + 2.0 * late**2).sum(axis=1), LAG, PERIOD)
    return command, force + 0.05 * rng.normal(size=len(force))


def test_the_model_that_is_true_finds_lag_and_offset(flight):
    (lag, offset), (lag_width, offset_width), left = fitted(*flight, PERIOD, "thrust", True)
    assert abs(lag - LAG) < max(lag_width, 1e-3) < 0.01
    assert abs(offset - OFFSET) < max(offset_width, 5e-4) < 0.005
    assert left == pytest.approx(0.05, rel=0.1)


def test_without_an_offset_the_lag_takes_it_and_explains_less(flight):
    (lag, offset), _, left = fitted(*flight, PERIOD, "thrust", False)
    assert lag > LAG + 0.5 * OFFSET
    assert offset == 0.0
    assert left > 0.055
