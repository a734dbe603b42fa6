"""Statistics over score matrices, against definitions written out and against scipy."""

import itertools

import numpy as np
import pytest
import scipy.stats

from windwrench.dynamics import InputError
from windwrench.evaluation.statistics import (
    hierarchical_bootstrap,
    hierarchical_draws,
    holm,
    interquartile_mean,
    interval_of,
    mean,
    optimality_gap,
    paired_wins,
    performance_profile,
    probability_of_improvement,
    relative_change,
    sign_probability,
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


def test_hierarchical_draws_have_the_variance_of_crossed_policies_and_episodes():
    """Policies that differ and episodes that differ, with nothing beside: variances add up."""
    policies = np.array([0.0, 1.0, 2.0, 3.0, 4.0])[:, None]
    episodes = np.linspace(-3.0, 3.0, 40)[None]
    draws = hierarchical_draws(mean, policies + episodes, resamples=20_000)
    # of means of n - 1 draws: the unbiased variance of n, over n
    expected = policies.var(ddof=1) / 5 + episodes.var(ddof=1) / 40
    assert draws.var() == pytest.approx(expected, rel=0.05)
    assert draws.mean() == pytest.approx(2.0, abs=0.02)


def test_what_differs_between_policies_is_not_averaged_away_over_episodes():
    # five policies, each the same on all episodes: five numbers are known, not two hundred
    scores = np.repeat(np.arange(5.0)[:, None], 40, axis=1)
    low, high = hierarchical_bootstrap(mean, scores)
    narrow = stratified_bootstrap(mean, scores, tasks=True)
    assert high - low > 4.0 * (narrow[1] - narrow[0])


def test_the_hierarchical_interval_covers_other_policies_and_other_episodes():
    inside = 0
    for k in range(150):
        rng = np.random.default_rng(k)
        scores = (
            2.0
            + rng.normal(0.0, 0.3, (8, 1))
            + rng.normal(0.0, 1.0, (1, 40))
            + rng.normal(0.0, 0.5, (8, 40))
        )
        low, high = hierarchical_bootstrap(mean, scores, resamples=400, seed=k, level=0.9)
        inside += low <= 2.0 <= high
    assert 0.82 <= inside / 150 <= 0.97


def test_a_single_policy_stays_and_a_pair_is_drawn_together():
    hard = np.linspace(0.1, 5.0, 30)[None]
    assert hierarchical_bootstrap(relative_change, 0.9 * hard, hard) == pytest.approx((-0.1, -0.1))
    one = hierarchical_draws(mean, [[3.0]], resamples=10)
    np.testing.assert_array_equal(one, np.full(10, 3.0))


def test_the_same_episodes_are_drawn_in_every_world():
    # what one world gives an episode the other takes: only with the same ones drawn nothing is left
    gains = np.random.default_rng(1).normal(size=(1, 20))
    both = np.concatenate([gains, -gains], axis=1)
    assert hierarchical_bootstrap(mean, both, blocks=2) == pytest.approx((0.0, 0.0), abs=1e-12)
    low, high = hierarchical_bootstrap(mean, both)
    assert high - low > 0.3


def test_holm_on_an_example_done_by_hand():
    # 4 x 0.01, 3 x 0.02 = 0.06, 2 x 0.03 = 0.06, 1 x 0.04 -> not below 0.06
    np.testing.assert_allclose(holm([0.03, 0.01, 0.04, 0.02]), [0.06, 0.04, 0.06, 0.06])
    np.testing.assert_allclose(holm([0.6, 0.7]), [1.0, 1.0])
    np.testing.assert_allclose(holm([0.02]), [0.02])
    assert holm([]).shape == (0,)


def test_the_sign_s_probability_is_that_of_a_normal_draw():
    draws = np.random.default_rng(2).normal(1.0, 0.5, 200_000)
    assert sign_probability(draws) == pytest.approx(2 * scipy.stats.norm.sf(2.0), rel=0.1)
    assert sign_probability(-draws) == pytest.approx(sign_probability(draws))
    assert sign_probability(np.full(99, 1.0)) == pytest.approx(0.02)
    assert sign_probability(np.zeros(50)) == 1.0
    assert interval_of(draws, 0.5) == pytest.approx((1.0 - 0.337, 1.0 + 0.337), abs=0.01)


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
        (lambda: hierarchical_bootstrap(mean, [[1.0]], level=0.0), "level"),
        (lambda: hierarchical_bootstrap(relative_change, [[1.0]], [[1.0, 2.0]]), "same tasks"),
        (lambda: hierarchical_bootstrap(mean, [[1.0, 2.0, 3.0]], blocks=2), "equal blocks"),
        (lambda: holm([0.5, 1.5]), "probabilities"),
    ],
)
def test_scores_that_mean_nothing_are_refused(call, words):
    with pytest.raises(InputError, match=words):
        call()
