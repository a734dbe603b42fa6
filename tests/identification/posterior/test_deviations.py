"""Deviations know of both estimates of a coefficient."""

import numpy as np
import pytest

from windwrench.identification.findings import NamedEffect, RankedSet, Ranking
from windwrench.identification.posterior.deviations import (
    of_two_estimates,
    with_both_estimates,
)


def test_intervals_hold_where_both_estimates_are_wrong_alike():
    rng = np.random.default_rng(0)
    noise, wrong = 0.01, 0.03
    own, other = (
        noise * rng.standard_normal(4000) + wrong * rng.standard_normal(4000) for _ in range(2)
    )
    std = [of_two_estimates(noise, a, b) for a, b in zip(own, other, strict=True)]
    # the mean square is right, though each is known from one difference
    assert np.mean(np.square(std)) == pytest.approx(np.mean(np.square(own)), rel=0.1)
    assert np.mean(np.abs(own) < np.multiply(1.96, noise)) < 0.6
    assert np.mean(np.abs(own) < np.multiply(1.96, std)) > 0.8


def test_an_effect_that_no_set_has_stays_as_it_is():
    effect = NamedEffect("mass", {"dm": 0.05}, {"dm": 0.001}, {"dm": "kg"}, False, (), {})
    sets = [
        RankedSet(("wind",), 0.9, {"wind": {"vx": 1.0}}, {"wind": {"vx": 0.1}}),
        RankedSet(("mass",), 0.1, {"mass": {"dm": 0.054}}, {"mass": {"dm": 0.002}}),
    ]
    without, ranking = (Ranking({}, tuple(some), 0.0, 1.0) for some in (sets[:1], sets))
    assert with_both_estimates([effect], without) == (effect,)
    (found,) = with_both_estimates([effect], ranking)
    assert found.std["dm"] == pytest.approx(np.hypot(0.001, 0.004 / np.sqrt(2.0)))
    assert found.coefficients == effect.coefficients
