"""Fig. 5 in short: few seeds, a small budget for the optimiser."""

import json

import numpy as np
import pytest

from windwrench.paper import fig5
from windwrench.paper.fig5_flights import FLIGHTS, NOISES, PLANTS, TICK, fly


@pytest.fixture(scope="module")
def result():
    shares = []
    outcome = fig5.run(2, shares.append, evaluations=5)
    assert shares == sorted(shares)
    assert 0 < shares[0] <= shares[-1] <= 1
    return outcome


def ratios(result, pair, noise, error):
    """All ratios of a pair, over plants and flights."""
    return [
        row["ratio"]
        for row in result.figures["rmse_ratio"]
        if (row["pair"], row["noise"], row["error"]) == (pair, noise, error)
    ]


def test_an_ekf_on_the_same_model_is_as_good(result):
    for noise in NOISES:
        for error in fig5.ERRORS:
            np.testing.assert_allclose(
                ratios(result, "EKF / UKF, both set to 1 s", noise, error), 1.0, atol=0.05
            )


def test_every_figure_is_finite_and_all_columns_are_of_one_length(result):
    text = json.dumps(result.figures, allow_nan=False)
    assert "timing" not in text
    second = [row for row in result.figures["rmse"] if row["estimator"].endswith("1 s")]
    assert all(row["force_steady"] < 0.12 and row["torque_steady"] < 0.03 for row in second)
    assert all(
        row["ci95"][0] <= row["ratio"] <= row["ci95"][1] for row in result.figures["rmse_ratio"]
    )
    assert {len(column) for column in result.data.values()} == {
        2 * len(PLANTS) * len(FLIGHTS) * len(NOISES) * 7
    }
    filters = [row["nis"] for row in result.figures["rmse"] if row["estimator"] == "UKF 1 s"]
    np.testing.assert_allclose(filters, 6.0, atol=0.5)


def test_the_wrench_sets_in_at_seven_seconds_and_the_same_seed_gives_the_same_flight():
    one, again = fly("yawing", "high", "exact", [3])[0], fly("yawing", "high", "exact", [3])[0]
    np.testing.assert_array_equal(one.samples, again.samples)
    before = round(7.0 / TICK)
    assert not one.wrench[: before + 1].any()
    np.testing.assert_allclose(
        one.wrench[before + 1 :],
        np.tile([0, 0, -0.52, 0.067, 0, 0], (len(one.wrench) - before - 1, 1)),
    )


def test_a_ratio_of_paired_errors_has_a_tight_interval_where_the_errors_go_together():
    hard = np.linspace(1.0, 5.0, 20)
    assert fig5.ratio(2.0 * hard, hard) == pytest.approx((2.0, 2.0, 2.0))
