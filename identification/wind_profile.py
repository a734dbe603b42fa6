"""Force and torque over the place along a horizontal line through a wind, from a flight's wrench.

The estimate's samples agree with each other over a second or so. The curve is a penalised spline of
means over 1 s, whose errors have a correlation, and are larger where the wind is rougher. The
weight of the penalty is the one of the greatest restricted likelihood. The intervals are the
spline's posterior (Wahba, 1983): they hold 95 % of the places of a curve.
"""

import math
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_factor, cho_solve
from scipy.ndimage import label, median

from ..estimator.estimate import TRACKING
from ..runtime.errors import InputError
from .logs.table import Array, ArrayPair, Rows, finite_rows
from .wrench_series import WrenchSeries

MEAN = 1.0  # s, of the means that the curve is fitted to
GRID = 0.02  # m, between two places of the curve
_FASTEST = 0.3  # m/s, and m about the usual height, of the samples that count
_LEAST = 50, 0.5  # s, and m of the line, of a profile
_ROUND = 0.25  # ratio of the variances across and along a flight, above which no line is told
_BAND, _SHARE = 0.1, 0.03  # m of a bin across the line, and its least share of the flight
_KNOT, _ROUGHNESS = 0.08, 0.25  # m, between knots, and over which the errors' variance is averaged
_TOGETHER = 0.5  # least correlation of means over 1 s: the smoother alone makes it
_WEIGHTS = np.logspace(-4.0, 8.0, 37)  # of the penalty
_DRAWS = 40


class WindProfile(NamedTuple):
    """Force and torque along one line.

    Vectors have three parts: the way of the wind, at right angles to the line; along the line; up.

    Attributes:
        direction: rad, the way of the growing place, from the world's x towards y.
        beside: m, of the line from the world's origin, along the wind.
        lines: (m,) m, the same of all lines of the flight.
        place: (n,) m along the line.
        wrench: (6, n) N and Nm.
        low: (6, n), ends of the 95 % intervals.
        high: (6, n), likewise.
        torque_draws: (k, n) Nm, curves of the torque about z from its posterior.
        means: (s, 7) the means over 1 s of place and wrench.
        samples: effective number of the torque's means.
    """

    direction: float
    beside: float
    lines: Array
    place: Array
    wrench: Array
    low: Array
    high: Array
    torque_draws: Array
    means: Array
    samples: float


def ways_of(direction: float) -> Array:
    """Return the three directions (3, 3) of a line's parts."""
    c, s = math.cos(direction), math.sin(direction)
    return np.array([[s, -c, 0.0], [c, s, 0.0], [0.0, 0.0, 1.0]])


def wind_profile(
    series: WrenchSeries, axis: float | None = None, beside: float | None = None
) -> WindProfile:
    """Return the profile of a flight's wrench along one line of the flight.

    Args:
        series: the wrench, smoothed.
        axis: rad, direction of the line from the world's x; default: the flight's own, or where
            the flight has none, at right angles to the force.
        beside: m along the wind, of the line, where the flight has several; default: the one with
            the most time.

    Raises:
        InputError: no torque was estimated, or the flight is too short or too narrow.
    """
    rows = np.hstack([series.position, series.force, series.torque])
    good = finite_rows(rows) & (series.status_code == TRACKING)
    good[good] = np.abs(rows[good, 2] - np.median(rows[good, 2])) < _FASTEST
    rows, second = rows[good], ((series.t[good] - series.t[0]) / MEAN).astype(int)
    _, first, counts = np.unique(second, return_index=True, return_counts=True)
    if len(first) < _LEAST[0]:
        raise InputError(f"a torque is known over {len(first)} s; expected {_LEAST[0]} s or more")
    means = np.add.reduceat(rows, first) / counts[:, None]
    slow = np.linalg.norm(np.gradient(means[:, :3], axis=0), axis=1) < _FASTEST * MEAN
    used = means[slow]
    direction = _direction(used) if axis is None else axis
    if np.sum(used[:, 3:6] @ ways_of(direction)[0]) < 0.0:
        direction += math.pi
    ways = ways_of(direction)
    beyond = used[:, :3] @ ways[0]
    bins = np.floor((beyond - beyond.min()) / _BAND).astype(int)
    runs, count = label(np.bincount(bins) >= _SHARE * len(beyond))  # of full bins, from 1
    lines = median(beyond, runs[bins], np.arange(1, count + 1))
    nearest = np.bincount(runs[bins])[1:] if beside is None else -np.abs(lines - beside)
    line = np.argmax(nearest)
    chosen = np.zeros(len(means), dtype=bool)
    chosen[slow] = runs[bins] == line + 1
    here = np.repeat(chosen, counts)
    place = rows[here, :3] @ ways[1]
    if chosen.sum() < _LEAST[0] or np.ptp(place) < _LEAST[1]:
        raise InputError(
            f"the flight holds {chosen.sum():.0f} s over {np.ptp(place):.2g} m of a line; "
            f"expected {_LEAST[0]} s over {_LEAST[1]:g} m or more"
        )
    turned = (means[chosen].reshape(-1, 3, 3) @ ways.T).reshape(-1, 9)[:, [1, *range(3, 9)]]
    at = np.arange(place.min(), place.max(), GRID)
    curves = [_curve(place, second[here], y, at) for y in turned.T[1:]]
    wrench, std, draws, samples = zip(*curves, strict=True)
    mean, half = np.stack(wrench), 1.96 * np.stack(std)
    return WindProfile(
        math.remainder(direction, 2.0 * math.pi),
        lines[line],
        lines,
        at,
        mean,
        mean - half,
        mean + half,
        draws[5],
        turned,
        samples[5],
    )


def _direction(means: Array) -> float:
    """Return the direction (rad) of the flight's line."""
    size, axes = np.linalg.eigh(np.cov(means[:, :2].T))
    x, y = axes[:, 1]
    if size[0] > _ROUND * size[1]:  # a grid: at right angles to the force
        x, y = np.linalg.eigh(means[:, 3:5].T @ means[:, 3:5])[1][:, 0]
    return math.atan2(y, x)


def _curve(place: Array, second: Rows, y: Array, at: Array) -> tuple[Array, Array, Array, float]:
    """Return the smooth curve of means ``y`` over the places (N,) of their seconds (N,).

    Values and standard deviations stand at places ``at`` (n,), with draws of the curve (k, n) and
    the effective number of means.

    Beside a mean stands the spline's own mean over the places of its second: the smoothed wrench
    does not follow a faster change of place.
    """
    width = float(np.ptp(place))
    count = max(4, min(round(width / _KNOT), len(y) // 4))
    knots = place.min() + width / count * np.arange(-3, count + 4)
    seconds, first, counts = np.unique(second, return_index=True, return_counts=True)
    rows = np.column_stack([place, BSpline.design_matrix(place, knots, 3, True).toarray()])
    rows = np.add.reduceat(rows, first) / counts[:, None]
    middle, X = rows[:, 0], rows[:, 1:]
    # errors by a curve without a penalty: by a smooth one, the jet itself would count as error
    residual = y - X @ np.linalg.lstsq(X, y, rcond=1e-6)[0]
    residual *= math.sqrt(len(y) / max(len(y) - X.shape[1], 1.0))
    near = np.exp(-0.5 * ((middle[:, None] - middle) / _ROUGHNESS) ** 2)
    variance = near @ residual**2 / near.sum(axis=1)
    rough = np.sqrt(np.maximum(variance, 0.05 * np.mean(residual**2) + 1e-300))
    unit = residual / rough
    pairs = np.flatnonzero(np.diff(seconds) == 1)
    rho = np.clip(np.mean(unit[pairs] * unit[pairs + 1]), _TOGETHER, 0.9)
    more = (1.0 + rho) / (1.0 - rho)  # means that are worth one
    weight = 1.0 / (rough * math.sqrt(more))
    beta, covariance = _fit(X * weight[:, None], y * weight)
    B = BSpline.design_matrix(at, knots, 3, True).toarray()
    std = np.sqrt(np.einsum("ni,ij,nj->n", B, covariance, B))
    draw = np.random.default_rng(0).multivariate_normal
    draws = draw(beta, covariance, _DRAWS, method="eigh") @ B.T
    return B @ beta, std, draws, len(y) / more


def _fit(X: Array, y: Array) -> ArrayPair:
    """Return a spline's coefficients and their posterior covariance, for the penalty's weight of
    the greatest restricted likelihood of values with unit variance.
    """
    XX, Xy, size = X.T @ X, X.T @ y, X.shape[1]
    bend, scale = np.diff(np.eye(size), 2, axis=0), np.trace(XX) / size

    def fitted(weight: float) -> tuple[float, Array, Any]:
        factor = cho_factor(XX + weight * bend.T @ bend + 1e-9 * scale * np.eye(size))
        beta = cho_solve(factor, Xy)
        spread = 2.0 * np.log(np.diag(factor[0])).sum()
        # a straight line costs no penalty
        return spread - beta @ Xy - (size - 2) * math.log(weight), beta, factor

    _, beta, factor = min(map(fitted, scale * _WEIGHTS), key=itemgetter(0))
    return beta, cho_solve(factor, np.eye(size))
