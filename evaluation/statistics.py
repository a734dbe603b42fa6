"""Statistics of scores over runs and tasks, as small functions of a matrix.

A score matrix has a row for each run (training seed) and a column for each task (a test episode in
a world). Every statistic also takes a stack of matrices (..., runs, tasks) and then returns (...).
Definitions: Agarwal, Schwarzer, Castro, Courville and Bellemare, *Deep reinforcement learning at
the edge of the statistical precipice*, NeurIPS 2021.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import bootstrap, trim_mean

from ..runtime.arrays import Array
from ..runtime.errors import InputError

_RESAMPLES = 2_000
_LEVEL = 0.95  # probability of an interval
_AT_ONCE = 1_000_000  # numbers per draw
_LAST_TWO = (-2, -1)


def _score_matrix(scores: ArrayLike) -> Array:
    """Return scores as a matrix (..., runs, tasks); a single run may come as (tasks,).

    Raises:
        InputError: no matrix, empty, or not finite.
    """
    matrix = np.atleast_2d(np.asarray(scores, dtype=np.float64))
    if matrix.size == 0 or not np.all(np.isfinite(matrix)):
        raise InputError(
            f"scores: expected a matrix (runs, tasks) of finite numbers, got shape {matrix.shape}"
        )
    return matrix


def mean(scores: ArrayLike) -> Any:
    """Return the mean over runs and tasks."""
    return _score_matrix(scores).mean(axis=_LAST_TWO)


def interquartile_mean(scores: ArrayLike) -> Any:
    """Return the mean over the middle half of all runs and tasks together."""
    matrix = _score_matrix(scores)
    return trim_mean(matrix.reshape(*matrix.shape[:-2], -1), 0.25, axis=-1)


def probability_of_improvement(x: ArrayLike, y: ArrayLike) -> Any:
    """Return the probability of a run of X beating a run of Y on a task drawn at random; a tie
    counts half.

    The Mann-Whitney statistic over all pairs of runs, task by task: scores where more is better.

    Raises:
        InputError: the matrices have different tasks.
    """
    a, b = _same_tasks(x, y)
    above = a[..., :, None, :] > b[..., None, :, :]
    equal = a[..., :, None, :] == b[..., None, :, :]
    return (above + 0.5 * equal).mean(axis=(-3, -2, -1))


def relative_change(x: ArrayLike, y: ArrayLike) -> Any:
    """Return the relative excess of X's mean over Y's; -0.1: ten per cent below."""
    return mean(x) / mean(y) - 1.0


def paired_wins(x: ArrayLike, y: ArrayLike) -> Any:
    """Return the share of runs and tasks where X is smaller than Y's mean over its runs on the same
    task; a tie is half.

    For errors, where less is better.

    Raises:
        InputError: the matrices have different tasks.
    """
    a, b = _same_tasks(x, y)
    rival = b.mean(axis=-2, keepdims=True)
    return ((a < rival) + 0.5 * (a == rival)).mean(axis=_LAST_TWO)


def episode_bootstrap(
    statistic: Callable[..., Any], scores: ArrayLike, resamples: int = _RESAMPLES
) -> tuple[float, float]:
    """Return the 95 % percentile bootstrap interval of a statistic over the tasks of one run.

    Args:
        statistic: takes a stack (k, tasks) of scores; returns (k,).
        scores: (tasks,), or (1, tasks).
        resamples: number of draws.
    """
    (run,) = _score_matrix(scores)
    if len(run) == 1:  # scipy refuses a single number
        return float(run[0]), float(run[0])
    drawn = bootstrap(
        (run,),
        lambda x, axis: statistic(np.expand_dims(x, -2)),
        n_resamples=resamples,
        vectorized=True,
        method="percentile",
        rng=np.random.default_rng(0),
    )
    return interval_of(drawn.bootstrap_distribution)


def hierarchical_draws(
    statistic: Callable[..., Any],
    *matrices: ArrayLike,
    resamples: int = _RESAMPLES,
    seed: int = 0,
    strata: Sequence[int] = (),
) -> Array:
    """Return a statistic of one or more score matrices over many draws of policies and episodes.

    Both levels are drawn anew, each as a whole: the pigeonhole bootstrap of Owen (2007) for two
    crossed factors. A policy keeps all its episodes together, and an episode is the same for all
    policies of all matrices. So differences between policies count once a policy, not once an
    episode. From n policies or episodes n - 1 are drawn: the variance of a mean is then unbiased
    for small n (Rao and Wu, 1988). A single policy, as a designed law, stays as it is.

    Args:
        statistic: takes as many stacks (k, runs, tasks) as there are matrices; returns (k,).
        *matrices: (runs, tasks).
        resamples: number of draws.
        seed: for the draws.
        strata: numbers of episodes that are drawn among themselves, as of each scenario; they add
            up to ``tasks``. Default: all.

    Returns:
        (resamples,).

    Raises:
        InputError: the matrices have different tasks.
    """
    scores = _same_tasks(*matrices)
    rng, count = np.random.default_rng(seed), scores[0].shape[1]
    step = max(_AT_ONCE // max(m.size for m in scores), 1)
    values = []
    for first in range(0, resamples, step):
        k = min(step, resamples - first)
        columns = np.hstack(
            [
                end - size + rng.integers(size, size=(k, max(size - 1, 1)))
                for size, end in zip(strata or (count,), np.cumsum(strata or (count,)), strict=True)
            ]
        )
        drawn = []
        for m in scores:
            rows = rng.integers(len(m), size=(k, max(len(m) - 1, 1)))
            drawn.append(m[rows[:, :, None], columns[:, None, :]])
        values.append(np.asarray(statistic(*drawn), dtype=np.float64))
    return np.concatenate(values)


def interval_of(draws: ArrayLike) -> tuple[float, float]:
    """Return the percentile interval of 95 % of the draws (n,)."""
    low, high = np.quantile(np.asarray(draws), [(1.0 - _LEVEL) / 2.0, (1.0 + _LEVEL) / 2.0])
    return float(low), float(high)


def hierarchical_bootstrap(
    statistic: Callable[..., Any], *matrices: ArrayLike, **given: Any
) -> tuple[float, float]:
    """Return the 95 % percentile interval of ``hierarchical_draws``, with its arguments."""
    return interval_of(hierarchical_draws(statistic, *matrices, **given))


def sign_probability(draws: ArrayLike) -> float:
    """Return the two-sided p-value of a statistic being zero, from its bootstrap draws (n,).

    The value is twice the share on the rarer side, and never below the resolution of n draws.
    """
    values = np.asarray(draws, dtype=np.float64)
    rarer = min(int(np.sum(values >= 0.0)), int(np.sum(values <= 0.0)))
    return min(1.0, 2.0 * (rarer + 1) / (len(values) + 1))


def holm(p_values: ArrayLike) -> Array:
    """Return adjusted p-values (n,) of n claims: all claims below 0.05 hold together with 95 %.

    Holm (1979): the k-th smallest times (n - k + 1), never less than one before.

    Raises:
        InputError: a number is no probability.
    """
    p = np.asarray(p_values, dtype=np.float64)
    if p.ndim != 1 or not np.all((p >= 0.0) & (p <= 1.0)):
        raise InputError("holm: expected probabilities (n,) between 0 and 1")
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    stepped = (len(p) - np.arange(len(p))) * p[order]
    adjusted[order] = np.minimum(np.maximum.accumulate(stepped), 1.0)
    return adjusted


def _same_tasks(*matrices: ArrayLike) -> list[Array]:
    scores = [_score_matrix(m) for m in matrices]
    if len({m.shape[-1] for m in scores}) > 1:
        raise InputError(
            f"scores: expected the same tasks, got {' and '.join(str(m.shape[-1]) for m in scores)}"
        )
    return scores
