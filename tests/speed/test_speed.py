"""The benchmark measures what it says; how fast the kit is belongs to benchmarks, not to tests."""

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.estimator import UKFTuning, WrenchUKF
from windwrench.speed.contenders import HEADER, Contender, cells, measure
from windwrench.speed.filters import PERIOD, PeerFilter, filters, flight, start
from windwrench.speed.programs import decisions, starts


def test_medians_and_ratios_are_taken_round_by_round():
    values = iter([1.0, 10.0, 2.0, 10.0, 3.0, 60.0])
    figures = measure(
        [
            Contender("one", "s", "x", lambda: next(values)),
            Contender("two", "s", "y", lambda: next(values)),
        ],
        rounds=3,
    )
    assert figures[0].value == (2.0, 1.0, 3.0)
    assert figures[1].value == (10.0, 10.0, 60.0)
    assert figures[1].ratio == (10.0, 5.0, 20.0)
    assert cells(figures[1]) == ["two", "10.00 s", "10.00 - 60.00", "10 (5 - 20)", "y"]
    assert len(HEADER) == 5


def test_filterpy_agrees_with_the_filter_that_it_is_timed_beside():
    pytest.importorskip("filterpy")
    vehicle, tuning, samples = load_vehicle("ardrone2"), UKFTuning(), flight(60)
    ukf, peer = WrenchUKF(vehicle, tuning, PERIOD), PeerFilter(vehicle, tuning, PERIOD)
    start(ukf, samples, None)
    covariance = 0.01 * ukf.covariance
    for one in (ukf, peer):
        start(one, samples, covariance)
    for sample in samples:
        estimate, state = ukf.step(*sample), peer.step(*sample)
    np.testing.assert_allclose(state[15:18], estimate.force, atol=1e-6)
    np.testing.assert_allclose(state[12:15], estimate.torque, atol=1e-6)


@pytest.mark.parametrize("group", [filters, decisions, starts])
def test_every_contender_runs(group):
    for figure in measure(group(), rounds=1):
        assert figure.value[0] > 0, figure.contender.name
