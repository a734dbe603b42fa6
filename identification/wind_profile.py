"""Force and torque over the place along a horizontal line through a wind, from a flight's wrench.

The estimate's samples agree with each other over a second or so. The curve is a penalised spline of
means over 1 s, whose errors have a correlation, and are larger where the wind is rougher. The
weight of the penalty is the one of the greatest restricted likelihood. The intervals are the
spline's posterior (Wahba, 1983): they hold 95 % of the places of a curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_factor, cho_solve

from ..estimator.estimate import TRACKING
from ..runtime.errors import InputError
from .logs.table import Array, Rows
from .wrench_series import WrenchSeries

BLOCK = 0.25  # s, of which the means of place and wrench are taken
MEAN = 1.0  # s, of the means that the curve is fitted to
GRID = 0.02  # m, between two places of the curve
# a hover: s at least, m from its mean, and m between the means of its halves
_HOVER_TIME, _HOVER_REACH, _HOVER_DRIFT = 3.0, 0.12, 0.06
_LEAST_REACH, _LEAST_BLOCKS = 0.5, 60  # m of the line and blocks of a profile
_ROUND = 0.25  # ratio of the variances across and along a flight, above which no line is told
_BAND, _SHARE = 0.1, 0.03  # m of a bin across the line, and a line's least share of the blocks
_KNOT = 0.08  # m
_ROUGHNESS = 0.25  # m, over which the errors' variance is averaged
_WEIGHTS = np.logspace(-4.0, 8.0, 37)  # of the penalty
_Z = 1.959964  # of a 95 % interval


@dataclass(frozen=True, eq=False)
class WindProfile:
    """Force and torque along one line.

    Vectors have three parts: the way of the wind, at right angles to the line; along the line; up.

    Attributes:
        direction: rad, the way of the growing place, from the world's x towards y.
        beside: m, of the line from the world's origin, along the wind.
        spread: m, standard deviation of the flight about the line: along the wind, and of height.
        height: m.
        place: (n,) m along the line.
        wrench: (6, n) N and Nm.
        std: (6, n) of the curve.
        torque_draws: (k, n) Nm, curves of the torque about z from its posterior.
        hovers: (h, 13) place, mean wrench and its standard deviation of each hover; h = 0: a sweep.
        samples: effective number of the torque's samples.
        seconds: of flight on the line.
        found_by: how the line was found.
        lines: (m, 2) along the wind and height of all lines of the flight, m.
    """

    direction: float
    beside: float
    spread: tuple[float, float]
    height: float
    place: Array
    wrench: Array
    std: Array
    torque_draws: Array
    hovers: Array
    samples: float
    seconds: float
    found_by: str
    lines: Array

    @property
    def torque(self) -> Array:
        """Torque about z (n,), Nm."""
        return np.asarray(self.wrench[5])

    @property
    def interval(self) -> tuple[Array, Array]:
        """Ends of the 95 % intervals, (6, n) each."""
        return self.wrench - _Z * self.std, self.wrench + _Z * self.std

    def along(self, position: Array) -> Array:
        """Return the places (N,) on the line of positions (N, 3)."""
        way = math.cos(self.direction), math.sin(self.direction)
        return np.asarray(position[:, :2] @ way)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Means over ``BLOCK`` s of a flight."""

    index: Rows  # (n,) number of the block since the start
    position: Array  # (n, 3) m
    wrench: Array  # (n, 6) world, force and torque

    def of(self, which: Any) -> _Blocks:
        return _Blocks(self.index[which], self.position[which], self.wrench[which])


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
    blocks = _blocks(series)
    hovering = _hovers(blocks)
    on_way = np.isin(np.arange(len(blocks.index)), np.concatenate([[], *hovering]).astype(int))
    swept = len(hovering) < 4 or on_way.mean() < 0.5
    used = blocks if swept else blocks.of(on_way)
    direction, found_by = _direction(used) if axis is None else (axis, "given")
    way = np.array([math.cos(direction), math.sin(direction)])
    wind = np.array([way[1], -way[0]])
    if float(np.sum(used.wrench[:, :2] @ wind)) < 0.0:
        way, wind, direction = -way, -wind, direction + math.pi
    beyond, high = used.position[:, :2] @ wind, used.position[:, 2]
    lines, on_line = _lines(beyond, high, beside)
    if axis is None and on_line.any():  # by one line alone: a whole grid's directions are rough
        fine, found_by = _direction(used.of(on_line))
        direction += math.remainder(fine - direction, math.pi)
        way = np.array([math.cos(direction), math.sin(direction)])
        wind = np.array([way[1], -way[0]])
        beyond = used.position[:, :2] @ wind
    here = used.of(on_line)
    place = here.position[:, :2] @ way
    if len(place) < _LEAST_BLOCKS or np.ptp(place) < _LEAST_REACH:
        raise InputError(
            f"the flight holds {BLOCK * len(place):.0f} s over {np.ptp(place):.2g} m of a line; "
            f"expected {BLOCK * _LEAST_BLOCKS:.0f} s and {_LEAST_REACH:g} m or more"
        )
    turn = np.vstack([np.append(wind, 0.0), np.append(way, 0.0), [0.0, 0.0, 1.0]])
    values = np.hstack([here.wrench[:, :3] @ turn.T, here.wrench[:, 3:] @ turn.T])
    at = np.arange(place.min(), place.max(), GRID)
    curves = [_curve(place, y, here.index, at) for y in values.T]
    torque = curves[5]
    dwells = [
        np.concatenate([[place[k].mean()], values[k].mean(axis=0), [c.std_of(k) for c in curves]])
        for run in ([] if swept else hovering)
        if len(k := np.flatnonzero(np.isin(here.index, blocks.index[run])))
    ]
    return WindProfile(
        math.remainder(direction, 2.0 * math.pi),
        float(np.median(beyond[on_line])),
        (float(np.std(beyond[on_line])), float(np.std(high[on_line]))),
        float(np.median(high[on_line])),
        at,
        np.stack([c.mean for c in curves]),
        np.stack([c.std for c in curves]),
        torque.draws,
        np.array(dwells).reshape(-1, 13),
        torque.samples,
        BLOCK * len(place),
        found_by,
        lines,
    )


def _blocks(series: WrenchSeries) -> _Blocks:
    """Return means of the rows in flight at about the flight's usual height."""
    wrench = np.hstack([series.force, series.torque])
    position = series.position
    good = np.isfinite(np.hstack([wrench, position])).all(axis=1)
    good &= series.status_code == TRACKING
    if not good.any():
        raise InputError(
            "no torque or no position was estimated; expected a log with poses and rotor speeds"
        )
    number = ((series.t - series.t[0]) / BLOCK).astype(int)
    index, first = np.unique(number[good], return_index=True)
    count = np.diff(np.append(first, good.sum()))
    sums = np.add.reduceat(np.hstack([position, wrench])[good], first)
    means, whole = sums / count[:, None], count > 0.5 * np.median(count)
    whole &= np.abs(means[:, 2] - np.median(means[:, 2])) < 1.0
    return _Blocks(index[whole], means[whole, :3], means[whole, 3:])


def _hovers(blocks: _Blocks) -> list[Rows]:
    """Return the rows of each hover: a stretch near its own mean, whose halves lie at one place."""
    place, found, first = blocks.position, [], 0
    gap = np.append(np.diff(blocks.index) > 1, True)
    for i in range(len(place)):
        here = place[first : i + 1]
        if np.linalg.norm(place[i] - here.mean(axis=0)) < _HOVER_REACH and not gap[i]:
            continue
        if i - first >= _HOVER_TIME / BLOCK:
            middle = (first + i) // 2
            drift = place[first:middle].mean(axis=0) - place[middle:i].mean(axis=0)
            if np.linalg.norm(drift) < _HOVER_DRIFT:
                found.append(np.arange(first, i))
        first = i + 1 if gap[i] else i
    return found


def _direction(blocks: _Blocks) -> tuple[float, str]:
    """Return the direction (rad) of the flight's line, and how it was found."""
    size, axes = np.linalg.eigh(np.cov(blocks.position[:, :2].T))
    if size[0] < _ROUND * size[1]:
        return math.atan2(axes[1, 1], axes[0, 1]), "principal direction of the flight"
    force = blocks.wrench[:, :2]
    _, axes = np.linalg.eigh(force.T @ force)
    return math.atan2(axes[1, 0], axes[0, 0]), "at right angles to the force"


def _lines(beyond: Array, high: Array, beside: float | None) -> tuple[Array, Array]:
    """Return the flight's lines (m, 2), along the wind and height, and the blocks (n,) of one."""
    both = np.column_stack([_groups(beyond), _groups(high)])
    kept = both[(both >= 0).all(axis=1)]
    kinds, counts = np.unique(kept, axis=0, return_counts=True)
    kinds = kinds[counts >= _SHARE * len(both)]
    if not len(kinds):
        return np.empty((0, 2)), np.zeros(len(both), dtype=np.bool_)
    members = [(both == kind).all(axis=1) for kind in kinds]
    lines = np.array([[np.median(beyond[m]), np.median(high[m])] for m in members])
    if beside is None:
        sizes = np.array([m.sum() for m in members])
        middle = np.abs(lines[:, 0] - np.median(lines[:, 0]))
        best = int(np.lexsort((middle, -np.round(sizes / sizes.max(), 1)))[0])
    else:
        best = int(np.argmin(np.abs(lines[:, 0] - beside)))
    return lines, members[best]


def _groups(x: Array) -> Rows:
    """Return the number (n,) of the run of full bins that holds each value; -1: of none."""
    bins = np.floor((x - x.min()) / _BAND).astype(int)
    full = np.bincount(bins) >= _SHARE * len(x)
    number = np.cumsum(np.diff(full.astype(int), prepend=0) > 0) - 1
    return np.asarray(np.where(full, number, -1)[bins])


@dataclass(frozen=True, eq=False)
class _Curve:
    mean: Array  # (n,) over the places
    std: Array
    draws: Array  # (k, n)
    samples: float  # effective number
    rough: Array  # (N,) standard deviation of the errors of each block's mean over ``MEAN``
    more: float  # how many such means have one sample's worth

    def std_of(self, rows: Rows) -> float:
        """Return the standard deviation of the mean of consecutive blocks."""
        means = max(1.0, len(rows) * BLOCK / MEAN / self.more)
        return float(self.rough[rows].mean()) / math.sqrt(means)


def _curve(place: Array, y: Array, index: Rows, at: Array) -> _Curve:
    """Return the smooth curve of values (N,) over places (N,), at places ``at`` (n,).

    Means over ``MEAN`` s stand beside the spline's own means over the places of this time: the
    smoothed wrench does not follow a faster change of place.
    """
    low, high = float(place.min()), float(place.max())
    count = max(6, round((high - low) / _KNOT))
    step = (high - low) / count
    knots = low + step * np.arange(-3, count + 4)

    def basis(x: Array) -> Array:
        inside = np.clip(x, low, high)
        return np.asarray(BSpline.design_matrix(inside, knots, 3, extrapolate=True).toarray())

    stretch = np.cumsum(np.diff(index, prepend=index[0]) > 1)
    which = stretch * (index[-1] + 1) + index // round(MEAN / BLOCK)
    _, first, sizes = np.unique(which, return_index=True, return_counts=True)
    rows = np.add.reduceat(np.column_stack([place, y, basis(place)]), first) / sizes[:, None]
    middle, values, X = rows[:, 0], rows[:, 1], rows[:, 2:]
    full = np.sqrt(sizes * BLOCK / MEAN)  # of a short mean's weight
    # errors by a curve without a penalty: by a smooth one, the jet itself would count as error
    residual = values - X @ np.linalg.lstsq(X, values, rcond=1e-6)[0]
    residual *= math.sqrt(len(values) / max(len(values) - X.shape[1], 1.0))
    rough = _roughness(middle, residual * full)
    unit = residual * full / rough
    joined = np.diff(first, append=len(y)) == sizes
    pairs = np.flatnonzero(joined[:-1] & (np.diff(stretch[first]) == 0))
    rho = float(unit[pairs] @ unit[pairs + 1]) / max(float(unit[pairs] @ unit[pairs]), 1e-300)
    more = (1.0 + rho) / (1.0 - rho) if 0.0 < rho < 0.95 else 1.0 + 38.0 * (rho >= 0.95)
    weight = full / rough / math.sqrt(more)
    bend = np.diff(np.eye(X.shape[1]), 2, axis=0)
    beta, covariance = _fit(X * weight[:, None], values * weight, bend.T @ bend)
    B = basis(at)
    root = np.linalg.cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(len(beta)))
    normals = np.random.default_rng(0).standard_normal((400, len(beta)))
    std = np.sqrt(np.einsum("ni,ij,nj->n", B, covariance, B))
    at_blocks = np.interp(place, *(v[np.argsort(middle)] for v in (middle, rough)))
    draws = (beta + normals @ root.T) @ B.T
    return _Curve(B @ beta, std, draws, len(values) / more, at_blocks, more)


def _fit(X: Array, y: Array, penalty: Array) -> tuple[Array, Array]:
    """Return the spline's coefficients and their posterior covariance, for the penalty's weight of
    the greatest restricted likelihood of values with unit variance.
    """
    XX, Xy, yy = X.T @ X, X.T @ y, float(y @ y)
    scale = float(np.trace(XX)) / len(XX)
    best: tuple[float, Array, Array] | None = None
    for weight in scale * _WEIGHTS:
        factor = cho_factor(XX + weight * penalty + 1e-9 * scale * np.eye(len(XX)))
        beta = cho_solve(factor, Xy)
        spread = 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
        left = yy - float(beta @ Xy)
        # a straight line costs no penalty
        deviance = left + spread - (len(XX) - 2) * math.log(weight)
        if best is None or deviance < best[0]:
            best = deviance, beta, cho_solve(factor, np.eye(len(XX)))
    assert best is not None
    return best[1], best[2]


def _roughness(place: Array, residual: Array) -> Array:
    """Return the residual's standard deviation (N,) in the neighbourhood of each place."""
    near = np.exp(-0.5 * ((place[:, None] - place) / _ROUGHNESS) ** 2)
    local = near @ residual**2 / near.sum(axis=1)
    floor = 0.05 * float(np.mean(residual**2)) + 1e-300
    return np.asarray(np.sqrt(np.maximum(local, floor)))
