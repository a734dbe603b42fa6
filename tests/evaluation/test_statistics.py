"""Statistics over score matrices, against definitions written out and against scipy."""

import itertools

import numpy as np
import pytest
import scipy.stats

from windwrench.dynamics import InputError
from windwrench.evaluation.statistics import (
    interquartile_mean,
    mean,
    optimality_gap,
    paired_wins,
    performance_profile,
    probability_of_improvement,
    relative_change,
    stratified_bootstrap,
)

RNG = np.random.default_rng(5)
X, Y = RNG.normal(1.0, 0.3, (5, 12)), RNG.normal(0.8, 0.3, (4, 12))


@pytest.mark.parametrize("shape", [(5, 12), (3, 7), (1, 5), (1, 1)])
def test_the_interquartile_mean_is_scipy_s_trimmed_mean(shape):
    scores = RNG.normal(size=shape)
    assert interquartile_mean(scores) == pytest.approx(
        scipy.stats.trim_mean(scores, 0.25, axis=None)
    )


def test_one_wild_run_does_not_move_the_interquartile_mean():
    wild = X.copy()
    wild[wild.argmax() // 12, wild.argmax() % 12] = 1e9
    assert interquartile_mean(wild) == interquartile_mean(X)
    assert wild.mean() > 1e6


def test_probability_of_improvement_counts_all_pairs_of_runs_task_by_task():
    a, b = X.round(1), Y.round(1)  # with ties
    pairs = [
        (a[i, k] > b[j, k]) + 0.5 * (a[i, k] == b[j, k])
        for i, j, k in itertools.product(range(5), range(4), range(12))
    ]
    assert probability_of_improvement(a, b) == pytest.approx(np.mean(pairs))
    u = [scipy.stats.mannwhitneyu(a[:, k], b[:, k]).statistic / 20 for k in range(12)]
    assert probability_of_improvement(a, b) == pytest.approx(np.mean(u))
    assert probability_of_improvement(a, b) + probability_of_improvement(b, a) == pytest.approx(1.0)
    assert probability_of_improvement(a, a) == 0.5


def test_a_performance_profile_is_the_share_above_each_threshold():
    scores = [[0.0, 1.0], [2.0, 3.0]]
    np.testing.assert_array_equal(
        performance_profile(scores, [-1.0, 0.0, 1.5, 3.0]), [1.0, 0.75, 0.5, 0.0]
    )


def test_optimality_gap_and_relative_change():
    assert optimality_gap([[0.5, 2.0]]) == 0.25
    assert relative_change([[0.9, 0.9]], [[1.0, 1.0]]) == pytest.approx(-0.1)


def test_paired_wins_compare_errors_on_the_same_episode():
    assert paired_wins([[1.0, 5.0], [3.0, 5.0]], [[2.0, 5.0]]) == (1 + 0.5 + 0 + 0.5) / 4


def test_the_bootstrap_covers_the_truth_as_often_as_it_says():
    inside = 0
    for k in range(120):
        sample = np.random.default_rng(k).normal(2.0, 1.0, (40, 1))
        low, high = stratified_bootstrap(mean, sample, resamples=300, seed=k, level=0.9)
        inside += low <= 2.0 <= high
    assert 0.80 <= inside / 120 <= 0.97


def test_runs_are_drawn_within_their_task():
    # every task has one value in all runs: whichever runs are drawn, nothing changes
    scores = np.tile(np.arange(6.0), (4, 1))
    assert stratified_bootstrap(mean, scores) == (2.5, 2.5)
    low, high = stratified_bootstrap(mean, scores, tasks=True)
    assert low < 2.0 < 3.0 < high


def test_a_paired_bootstrap_draws_the_same_episodes_for_both():
    hard = np.linspace(0.1, 5.0, 30)[None]
    low, high = stratified_bootstrap(relative_change, 0.9 * hard, hard, tasks=True)
    assert (low, high) == pytest.approx((-0.1, -0.1))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: interquartile_mean([]), "finite numbers"),
        (lambda: interquartile_mean([[np.nan]]), "finite numbers"),
        (lambda: probability_of_improvement([[1.0]], [[1.0, 2.0]]), "same tasks"),
        (lambda: paired_wins([[1.0]], [[1.0, 2.0]]), "same tasks"),
        (
            lambda: stratified_bootstrap(relative_change, [[1.0]], [[1.0, 2.0]], tasks=True),
            "same tasks",
        ),
        (lambda: stratified_bootstrap(interquartile_mean, [[1.0]], level=1.5), "level"),
    ],
)
def test_scores_that_mean_nothing_are_refused(call, words):
    with pytest.raises(InputError, match=words):
        call()
