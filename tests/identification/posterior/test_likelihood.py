"""The likelihood near a setting: a quadratic of the coefficients, least where the truth is."""

import numpy as np
import pytest

from tests.support.searches import VEHICLE, settings
from windwrench.identification.inference.regression import Flights
from windwrench.identification.inference.time_offsets import LAG_ASYMMETRY
from windwrench.identification.posterior.likelihood import BETWEEN, GAIN, UNKNOWN, Likelihood
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


def test_what_any_flight_may_have_is_beside_what_is_asked(flights):
    likelihood = Likelihood(flights, {})
    sums = likelihood.sums([COLUMN], {}, unknown=False)
    names = {name for effect, name in sums.columns if not effect}
    assert {"rotor_time_offset", "attitude_time_offset", BETWEEN} <= names
    assert any(name.startswith(GAIN) for name in names)
    assert not any(name.startswith(UNKNOWN) for name in names)
    assert LAG_ASYMMETRY not in sums.columns
    again = likelihood.sums([("inertia", "jx")], {}, unknown=True)
    # a column that was asked for once is kept
    assert {COLUMN, ("inertia", "jx")} <= set(again.columns)
    assert any(name.startswith(UNKNOWN) for _, name in again.columns)


def test_a_lag_may_be_uneven(flights):
    late = Likelihood(flights, {"motor_lag": {"tau": 0.03}})
    assert LAG_ASYMMETRY in late.sums([], {}, unknown=False).columns


def test_sums_of_blocks_are_products(flights):
    blocks = Likelihood(flights, {}).sums([COLUMN], {}, unknown=False).blocks
    np.testing.assert_allclose(blocks, np.swapaxes(blocks, 1, 2))
    assert np.linalg.eigvalsh(blocks.sum(axis=0)).min() > -1e-6 * blocks.sum(axis=0).max()
