"""Statistics over score matrices, against definitions written out and against scipy."""

import itertools

import numpy as np
import pytest
import scipy.stats
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from windwrench.evaluation.statistics import (
    episode_bootstrap,
    hierarchical_bootstrap,
    hierarchical_draws,
    holm,
    interquartile_mean,
    interval_of,
    mean,
    paired_wins,
    probability_of_improvement,
    relative_change,
    sign_probability,
)

RNG = default_rng(5)
X = RNG.normal(1.0, 0.3, (5, 12))
Y = RNG.normal(0.8, 0.3, (4, 12))


def covered(intervals):
    """Share of the intervals around 2."""
    return np.mean([low <= 2.0 <= high for low, high in intervals])


def test_probability_of_improvement_counts_all_pairs_of_runs_task_by_task():
    a = X.round(1)
    b = Y.round(1)  # with ties
    pairs = [
        (a[i, k] > b[j, k]) + 0.5 * (a[i, k] == b[j, k])
        for i, j, k in itertools.product(range(5), range(4), range(12))
    ]
    assert probability_of_improvement(a, b) == pytest.approx(np.mean(pairs))
    u = [scipy.stats.mannwhitneyu(a[:, k], b[:, k]).statistic / 20 for k in range(12)]
    assert probability_of_improvement(a, b) == pytest.approx(np.mean(u))
    assert probability_of_improvement(a, b) + probability_of_improvement(b, a) == pytest.approx(1.0)
    assert probability_of_improvement(a, a) == 0.5


def test_paired_wins_are_of_an_episode_and_changes_of_the_means():
    assert relative_change([[0.9, 0.9]], [[1.0, 1.0]]) == pytest.approx(-0.1)
    assert paired_wins([[1.0, 5.0], [3.0, 5.0]], [[2.0, 5.0]]) == (1 + 0.5 + 0 + 0.5) / 4
    # a rival of several runs is their mean, neither the best of them nor the worst
    assert paired_wins([[1.9], [2.1]], [[1.0], [3.0]]) == 0.5


def test_the_interquartile_mean_is_that_of_the_middle_half_of_all():
    assert interquartile_mean([[0.0, 1.0], [2.0, 99.0]]) == 1.5
    flat = np.sort(X.ravel())
    assert interquartile_mean(X) == pytest.approx(flat[15:45].mean())
    assert_allclose(
        interquartile_mean(np.stack([X, 2.0 * X])), np.array([1.0, 2.0]) * flat[15:45].mean()
    )
    lost = np.append(X.ravel()[:-1], 1e3)  # one lost episode
    assert interquartile_mean(lost) < flat.max()


def test_strata_are_drawn_among_themselves():
    """Between strata that differ, and hold equal numbers, nothing varies."""
    scores = np.repeat([1.0, 5.0], [6, 6])[None]
    apart = hierarchical_draws(mean, scores, resamples=50, strata=(6, 6))
    assert_array_equal(apart, np.full(50, 3.0))
    assert hierarchical_draws(mean, scores, resamples=50).std() > 0.1
    uneven = [1.0, 2.0, 7.0, 9.0, 5.0]
    draws = hierarchical_draws(lambda x: x.max(axis=(1, 2)), [uneven], strata=(2, 3))
    assert set(draws) == {5.0, 7.0, 9.0}


def test_the_bootstrap_covers_the_truth_as_often_as_it_says():
    samples = [default_rng(k).normal(2.0, 1.0, 40) for k in range(120)]
    assert 0.87 <= covered(episode_bootstrap(mean, s, resamples=300) for s in samples) <= 0.99
    assert episode_bootstrap(mean, [[3.0]]) == (3.0, 3.0)


@pytest.mark.parametrize(("policies", "episodes"), [(5, 40), (40, 4)])
def test_hierarchical_draws_have_the_variance_of_crossed_policies_and_episodes(policies, episodes):
    """Policies that differ and episodes that differ, with nothing beside: variances add up. Few of
    either are enough.
    """
    of_policies = np.linspace(0.0, 4.0, policies)[:, None]
    of_episodes = np.linspace(-3.0, 3.0, episodes)[None]
    draws = hierarchical_draws(mean, of_policies + of_episodes, resamples=20_000)
    # of means of n - 1 draws: the unbiased variance of n, over n
    expected = of_policies.var(ddof=1) / policies + of_episodes.var(ddof=1) / episodes
    assert draws.var() == pytest.approx(expected, rel=0.05)
    assert draws.mean() == pytest.approx(2.0, abs=0.05)


def test_the_hierarchical_interval_covers_other_policies_and_other_episodes():
    def interval(k):
        rng = default_rng(k)
        sizes = {(8, 1): 0.3, (1, 40): 1.0, (8, 40): 0.5}
        scores = 2.0 + sum(rng.normal(0.0, sigma, shape) for shape, sigma in sizes.items())
        return hierarchical_bootstrap(mean, scores, resamples=400, seed=k)

    assert 0.88 <= covered(map(interval, range(150))) <= 0.99


def test_a_single_policy_stays_and_a_pair_is_drawn_together():
    hard = np.linspace(0.1, 5.0, 30)[None]
    assert hierarchical_bootstrap(relative_change, 0.9 * hard, hard) == pytest.approx((-0.1, -0.1))
    one = hierarchical_draws(mean, [[3.0]], resamples=10)
    assert_array_equal(one, np.full(10, 3.0))


def test_holm_on_an_example_done_by_hand():
    # 4 x 0.01, 3 x 0.02 = 0.06, 2 x 0.03 = 0.06, 1 x 0.04 -> not below 0.06
    assert_allclose(holm([0.03, 0.01, 0.04, 0.02]), [0.06, 0.04, 0.06, 0.06])
    assert_allclose(holm([0.6, 0.7]), [1.0, 1.0])
    assert_allclose(holm([0.02]), [0.02])
    assert holm([]).shape == (0,)


def test_the_sign_s_probability_is_that_of_a_normal_draw():
    draws = default_rng(2).normal(1.0, 0.5, 200_000)
    assert sign_probability(draws) == pytest.approx(2 * scipy.stats.norm.sf(2.0), rel=0.1)
    assert sign_probability(-draws) == pytest.approx(sign_probability(draws))
    assert sign_probability(np.full(99, 1.0)) == pytest.approx(0.02)
    assert sign_probability(np.zeros(50)) == 1.0
    assert interval_of(draws) == pytest.approx((1.0 - 0.98, 1.0 + 0.98), abs=0.01)
