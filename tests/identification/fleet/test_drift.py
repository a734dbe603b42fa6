"""Drifts from flight to flight: intervals that hold the truth, and few that are told by chance."""

import numpy as np
import pytest
from scipy.stats import linregress, t

from tests.support.diagnoses import fleet_row
from windwrench.identification.fleet.drift import (
    LEAST_FLIGHTS,
    Coefficient,
    appearance_of,
    fleet_of,
    meta_regression,
    trend_of,
)


def trend(values, stds, among, sure=None):
    n = len(values)
    points = np.column_stack(
        [np.arange(1, n + 1), values, stds, np.ones(n) if sure is None else sure]
    )
    return trend_of(Coefficient("a", "mass", "dm", "kg"), points, among)


def test_flights_of_a_named_session_count_as_one():
    """Sessions of four flights scatter, and nothing drifts: some 5 of 100 pass by chance."""
    rng, names = np.random.default_rng(6), {i + 1.0: f"day {i // 4}" for i in range(24)}
    told = {"named": 0, "not named": 0}
    for _ in range(200):
        values = np.repeat(rng.standard_normal(6), 4) + 0.3 * rng.standard_normal(24)
        points = np.column_stack([np.arange(1, 25), values, np.full(24, 0.3), np.ones(24)])
        of = Coefficient("a", "mass", "dm", "kg")
        told["named"] += trend_of(of, points, 24, names).p < 0.05
        told["not named"] += trend_of(of, points, 24).p < 0.05
    assert told["named"] <= 20
    assert told["not named"] > 60


def test_with_equal_deviations_it_is_ordinary_regression():
    rng = np.random.default_rng(0)
    y = 1.0 + 0.2 * np.arange(8) + rng.standard_normal(8)
    for std in (0.01, 1.0, 100.0):  # wrong deviations cancel
        found = trend(y, [std] * 8, 8)
        line = linregress(np.arange(8), y)
        half = t.ppf(0.975, 6) * line.stderr
        assert found.per_flight == pytest.approx(line.slope)
        assert found.per_flight_ci95 == pytest.approx((line.slope - half, line.slope + half))
        assert found.p == pytest.approx(line.pvalue)


def test_the_variance_between_values_is_that_of_paule_and_mandel():
    """Its equation, put in: the deviance equals the degrees of freedom."""
    rng = np.random.default_rng(1)
    s = 10 ** rng.uniform(-4.5, -3.5, 15)
    y = 3e-4 + s * rng.standard_normal(15) + 4e-4 * rng.standard_normal(15)
    (mean,), (error,), between = meta_regression(np.ones((15, 1)), y, s, True)
    weight = 1.0 / (s**2 + between**2)
    assert weight @ (y - mean) ** 2 == pytest.approx(14.0, rel=1e-6)
    assert mean == pytest.approx(weight @ y / weight.sum())
    assert error**2 == pytest.approx(1.0 / weight.sum())


@pytest.mark.parametrize("between", [0.0, 2.0])
def test_intervals_hold_the_truth(between):
    rng = np.random.default_rng(2)
    held = {"slope": 0, "mean": 0}
    for _ in range(300):
        s = 10 ** rng.uniform(-0.5, 0.5, 9)
        y = 2.0 + 0.1 * np.arange(9) + s * rng.standard_normal(9)
        y += between * rng.standard_normal(9)
        found = trend(y, s, 9)
        held["slope"] += found.per_flight_ci95[0] <= 0.1 <= found.per_flight_ci95[1]
        y -= 0.1 * np.arange(9)
        low, high = trend(y, s, 9).mean_ci95
        held["mean"] += low <= 2.0 <= high
    assert 0.91 <= held["slope"] / 300 <= 0.99
    assert held["mean"] / 300 >= 0.91


def test_few_flights_have_no_trend_and_bad_numbers_do_not_count():
    few = trend([1.0] * (LEAST_FLIGHTS - 1), [0.1] * (LEAST_FLIGHTS - 1), 9)
    assert (few.per_flight, few.p, few.mean) == (None, None, pytest.approx(1.0))
    one = trend([1.0], [0.1], 9)
    assert one.mean_ci95 == pytest.approx((0.804, 1.196))
    spoiled = trend([1.0, np.nan, 2.0], [np.nan, 1.0, 0.0], 9)
    assert spoiled.per_flight is None
    same = trend([1.0] * 9, [0.1] * 9, 9)  # at a bound
    assert (same.p, same.per_flight) == (1.0, pytest.approx(0.0))


def test_flights_that_are_sure_count_alone_where_they_are_enough():
    y, s = [1.0, 1.01, 0.99, 1.0, 1.02, 50.0], [0.01] * 6
    sure = trend(y, s, 6, [True] * 5 + [False])
    assert sure.mean == pytest.approx(1.0, abs=0.02)
    assert not sure.tentative
    assert trend(y, s, 6, [True] * 4 + [False] * 2).tentative
    line = trend([1.0, 2.0, 3.0, 4.0, 5.0, 9.0], s, 6, [True] * 5 + [False])
    assert line.ends == pytest.approx((1.0, 6.0))  # at the first and last flight that names it


def test_an_effect_that_comes_is_told_though_its_coefficient_is_constant():
    rows = [fleet_row("a", i, *[(1.0, 0.1)] * (i > 8)) for i in range(1, 17)]
    rows += [fleet_row("b", i, *[(1.0, 0.1)] * (i % 2)) for i in range(1, 17)]
    rows.append(fleet_row("b", 17) | {"status": "refused", "kind": "input"})
    fleet = fleet_of(rows)
    told = {one.id: one.told for one in fleet.appearances}
    assert told == {"a": True, "b": False}
    assert next(one for one in fleet.appearances if one.id == "a").later
    assert fleet.individuals["b"] == {"diagnosed": 16, "refused": 1}
    assert (fleet.refused, fleet.verdicts) == (
        {"input": 1},
        {"explained": 16, "nothing to explain": 16},
    )
    assert appearance_of("a", "mass", [1, 2], [1, 2, 3, 4]) is None


def test_drifts_are_told_and_chance_is_not():
    rng = np.random.default_rng(3)
    rows, individuals = [], 60
    for who in range(individuals):
        slope = 0.2 if who < 6 else 0.0
        for flight in range(1, 13):
            s = float(rng.uniform(0.1, 0.3))
            value = 1.0 + slope * flight + s * float(rng.standard_normal())
            rows.append(fleet_row(f"v{who}", flight, (value, s)))
    fleet = fleet_of(rows)
    told = [int(one.of.id[1:]) for one in fleet.trends if one.told]
    assert set(told) >= set(range(6))
    assert len(told) <= 8
    assert [one.told for one in fleet.trends[: len(told)]] == [True] * len(told)
