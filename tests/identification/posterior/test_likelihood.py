"""The likelihood near a setting: a quadratic of the coefficients, least where the truth is."""

import pytest

from tests.support.searches import VEHICLE, settings
from windwrench.identification.inference.regression import Flights
from windwrench.identification.posterior.likelihood import Likelihood
from windwrench.studies.trials.practice_flights import fly_practice

HEAVIER, COLUMN = {"mass": {"dm": 0.03}}, ("mass", "dm")


@pytest.fixture(scope="module")
def flights():
    flown = fly_practice(VEHICLE, settings(HEAVIER), "excite", 20.0, seed=5)
    return Flights([flown], VEHICLE)


def best_change(sums, column):
    """The change of a coefficient at which the quadratic is least, alone."""
    total, at = sums.blocks.sum(axis=0), sums.columns.index(column)
    return total[at, -1] / total[at, at]


def test_the_quadratic_leads_to_the_truth_and_the_truth_to_itself(flights):
    away = Likelihood(flights, {})
    at = Likelihood(flights, HEAVIER, away)
    far, near = (best_change(x.sums([COLUMN], {}, unknown=False), COLUMN) for x in (away, at))
    # about zero part of the mass is taken for disturbances, and mass is not linear
    assert far == pytest.approx(0.03, rel=0.25)
    assert abs(near) < 0.05 * 0.03
    deviances = [x.sums([COLUMN], {}, unknown=False).deviance() for x in (away, at)]
    assert deviances[1] < deviances[0] - 100.0
