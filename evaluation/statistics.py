"""Statistics of scores over runs and tasks, as small functions of a matrix.

A score matrix has a row for each run (training seed) and a column for each task (a test episode in
a world). Every statistic also takes a stack of matrices (..., runs, tasks) and then returns (...).
The definitions are those of Agarwal, Schwarzer, Castro, Courville and Bellemare, *Deep
reinforcement learning at the edge of the statistical precipice*, NeurIPS 2021.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..runtime.errors import InputError

Array = NDArray[np.float64]
_RESAMPLES = 2_000
_AT_ONCE = 1_000_000  # numbers drawn at a time
_LAST_TWO = (-2, -1)


def score_matrix(scores: ArrayLike) -> Array:
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
    return score_matrix(scores).mean(axis=_LAST_TWO)


def interquartile_mean(scores: ArrayLike) -> Any:
    """Return the mean of the middle half of all scores, runs and tasks together; a quarter is cut
    off at either end.

    Of n scores, ``floor(n / 4)`` go at either end.
    """
    matrix = score_matrix(scores)
    flat = np.sort(matrix.reshape(*matrix.shape[:-2], -1), axis=-1)
    cut = flat.shape[-1] // 4
    return flat[..., cut : flat.shape[-1] - cut].mean(axis=-1)


def optimality_gap(scores: ArrayLike, target: float = 1.0) -> Any:
    """Return by how much scores fall short of ``target`` on average; what is above counts as the
    target.
    """
    return target - np.minimum(score_matrix(scores), target).mean(axis=_LAST_TWO)


def performance_profile(scores: ArrayLike, thresholds: ArrayLike) -> Array:
    """Return, for each of ``thresholds`` (n,), the share (..., n) of all scores
    that are above it.
    """
    matrix = score_matrix(scores)
    limits = np.atleast_1d(np.asarray(thresholds, dtype=np.float64))
    return np.stack([(matrix > limit).mean(axis=_LAST_TWO) for limit in limits], axis=-1)


def probability_of_improvement(x: ArrayLike, y: ArrayLike) -> Any:
    """Return the probability that a run of X beats a run of Y on a task drawn at random; a tie
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
    """Return by which share the mean of X lies above that of Y; -0.1: ten per cent below."""
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


def stratified_bootstrap(
    statistic: Callable[..., Any],
    *matrices: ArrayLike,
    resamples: int = _RESAMPLES,
    seed: int = 0,
    level: float = 0.95,
    tasks: bool = False,
) -> tuple[float, float]:
    """Return the percentile bootstrap interval of a statistic of one or more score matrices.

    Runs are drawn anew with replacement for each task by itself (stratified by task). With
    ``tasks``, which a paired comparison needs, tasks are drawn anew first, the same ones in every
    matrix: the interval then speaks of other episodes, too, and not of other training seeds alone.

    Args:
        statistic: takes as many stacks (k, runs, tasks) as there are matrices; returns (k,).
        *matrices: (runs, tasks).
        resamples: how often everything is drawn.
        seed: of the draws.
        level: share of the draws inside the interval.
        tasks: whether tasks are drawn, too.

    Raises:
        InputError: a level that is no share, or matrices that do not have the same tasks.
    """
    given = [score_matrix(m) for m in matrices]
    if not 0.0 < level < 1.0:
        raise InputError(f"bootstrap: level must lie between 0 and 1, got {level}")
    if tasks:
        _same_tasks(*given)
    rng = np.random.default_rng(seed)
    count = given[0].shape[1]
    step = max(_AT_ONCE // max(m.size for m in given), 1)
    values = []
    for first in range(0, resamples, step):
        k = min(step, resamples - first)
        columns = rng.integers(count, size=(k, 1, count)) if tasks else None
        drawn = []
        for m in given:
            rows = rng.integers(len(m), size=(k, *m.shape))
            drawn.append(m[rows, np.arange(m.shape[1]) if columns is None else columns])
        values.append(np.asarray(statistic(*drawn)))
    low, high = np.quantile(np.concatenate(values), [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
    return float(low), float(high)


def _same_tasks(*matrices: ArrayLike) -> list[Array]:
    given = [score_matrix(m) for m in matrices]
    if len({m.shape[-1] for m in given}) > 1:
        raise InputError(
            f"scores: expected the same tasks, got {' and '.join(str(m.shape[-1]) for m in given)}"
        )
    return given
