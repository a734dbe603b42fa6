"""The likeliest noise of a flight's pose, by Fisher's method of scoring.

Searched are four numbers of each axis, and linear gains beside them: of what else than the pose
says something of its states. Each pair of axes has a search of its own.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...runtime.compiled import compiled_for_vectors
from .evidence import bounded_mode
from .steady_filter import PAIRS, PARTNER, PULL, PoseNoise, SteadyFilter, steady_filter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseSettings:
    """Where the likeliest noise is searched for."""

    settling_time: float = 1.0  # s, from the start of a piece to the first innovation that counts
    first_time: float = 0.4  # s, correlation time at which a search begins
    # s, correlation times: gusts last 0.1 to 2 s; what lasts longer is no disturbance
    times: tuple[float, float] = (0.03, 2.0)
    tolerance: float = 0.1  # nats, by which the last step of the search changes the likelihood


NOISE = NoiseSettings()
STEPS = 20  # of the search, at most
STEP = 1e-4  # of what is searched, for derivatives
LEAST_POSE = 1e-9  # m and rad: below the last digit of any log
SEARCHED = 8  # numbers of the noise of a pair


@dataclass(frozen=True, eq=False)
class Seen:
    """A piece as a filter sees it."""

    innovations: Array  # (n, 6)
    disturbance: Array  # (n, 6)
    fit: NDArray[np.bool_]  # (n,) which of them count


@compiled_for_vectors
def _respond(
    period: float,
    pull: Array,
    gain: Array,
    jumps: Array,
    jump_state: np.ndarray,
    slopes: Array,
    innovations: Array,
    disturbance: Array,
    keep: Array,
    out: Array,
) -> None:
    """Write by how much the predictions of the innovations (6, n, c) change with a unit of each
    gain of a pair, of which each is on ``jumps`` (n, 6, e), and of each number of its noise, of
    which ``slopes`` (6, 7, m) is what it does to the filter's gains and to ``keep``. The vehicle is
    near level flight, and keeps its heading.
    """
    n, e, m = len(innovations), jumps.shape[2], slopes.shape[2]
    c = e + m
    half = 0.5 * period * period
    state, say = np.zeros((6, 3, c)), np.empty((6, 3, c))
    for k in range(n):
        for i in range(6):
            for j in range(e):
                state[i, jump_state[j], j] += jumps[k, i, j]
            for j in range(c):
                out[i, k, j] = state[i, 0, j]
        for i in range(6):
            o = PARTNER[i]
            x, y = innovations[k, i], innovations[k, o]
            for s in range(3):
                own, other = gain[i, s, 0], gain[i, s, 1]
                for j in range(c):
                    say[i, s, j] = state[i, s, j] - own * out[i, k, j] - other * out[o, k, j]
                for j in range(m):
                    say[i, s, e + j] += slopes[i, 2 * s, j] * x + slopes[i, 2 * s + 1, j] * y
        for i in range(6):
            o = PARTNER[i]
            for j in range(c):
                g = say[i, 2, j]
                if i < 3:
                    g += pull[i] * (say[o, 0, j] + 0.5 * period * say[o, 1, j])
                state[i, 0, j] = say[i, 0, j] + period * say[i, 1, j] + half * g
                state[i, 1, j] = say[i, 1, j] + period * g
                state[i, 2, j] = keep[i] * say[i, 2, j]
            for j in range(m):
                state[i, 2, e + j] += slopes[i, 6, j] * disturbance[k, i]


@dataclass(frozen=True, eq=False)
class NoiseSearch:
    """A search.

    Attributes:
        see: returns the pieces of a flight as a filter with gains (3, e) of each pair sees them.
        jumps: (n, 6, e) of each piece, what a unit of each gain adds to one state of an axis before
            the pose of sample k is read.
        jump_state: (e,) the state: 0 the pose, 1 its rate, 2 the disturbance.
        held: (e,) standard deviations of the gains' prior. Rotor speeds that are nearly predicted
            would have gains without limit.
        period: s.
        gravity: m/s2.
    """

    see: Callable[[SteadyFilter, Array], Sequence[Seen]]
    jumps: Sequence[Array]
    jump_state: NDArray[np.intp]
    held: Array
    period: float
    gravity: float

    def likeliest(self, near: PoseNoise, gains: Array) -> tuple[PoseNoise, Array]:
        """Return the noise and the gains (3, e) at maximum likelihood, by damped steps.

        Args:
            near: the noise at which the search begins.
            gains: (3, e) at which it begins.
        """
        x = _free(near)
        low, high = x - 16.0, x + 16.0
        # the last is at most some ten thousand, where a white acceleration alone acts
        low[:, 0] = math.log(LEAST_POSE)
        low[:, 2:], high[:, 2:] = (math.log(NOISE.times[0]), 0.0), (math.log(NOISE.times[1]), 1e4)
        x = np.clip(x, low, high)
        none = np.full(gains.shape, np.inf)
        low, high = (np.column_stack([y, _pairs(z)]) for y, z in ((-none, low), (none, high)))
        at = np.column_stack([gains, _pairs(x)])
        height, normal, right = self._slopes(at)
        damping, moving = np.full(len(at), 1e-3), np.ones(len(at), dtype=np.bool_)
        for _ in range(STEPS):
            step = np.zeros_like(at)
            for i in np.flatnonzero(moving):
                damped = normal[i] + np.diag(damping[i] * np.diagonal(normal[i]) + 1e-9)
                step[i] = bounded_mode(damped, right[i], low[i] - at[i], high[i] - at[i])
                moving[i] = 0.5 * float(right[i] @ step[i]) >= NOISE.tolerance
                step[i] *= moving[i]
            if not moving.any():
                break
            better = self._height(at + step) < height
            damping *= np.where(better, 0.2, 8.0)
            if better.any():
                at = at + better[:, None] * step
                height, normal, right = self._slopes(at)
        return self._noise(at), at[:, :-SEARCHED]

    def _innovations(self, steady: SteadyFilter, gains: Array) -> Array:
        return np.concatenate([seen.innovations[seen.fit] for seen in self.see(steady, gains)])

    def _noise(self, at: Array) -> PoseNoise:
        x = np.empty((6, 4))
        x[PAIRS] = at[:, -SEARCHED:].reshape(-1, 2, 4)
        return _noise(x)

    def _filter(self, at: Array) -> SteadyFilter:
        return steady_filter(self._noise(at), self.period, self.gravity)

    def _height(self, at: Array) -> Array:
        """Return minus the logarithm of each pair's likelihood and prior (3,), up to a constant."""
        steady, gains = self._filter(at), at[:, :-SEARCHED]
        e = self._innovations(steady, gains)
        return self._deviance(
            (e.T @ e)[PAIRS[:, :, None], PAIRS[:, None, :]], _covariance(steady), gains, len(e)
        )

    def _deviance(self, products: Array, covariance: Array, gains: Array, n: int) -> Array:
        square = np.einsum("pij,pij->p", np.linalg.inv(covariance), products)
        square += np.square(gains / self.held).sum(axis=1)
        return np.asarray(0.5 * (square + n * np.linalg.slogdet(covariance)[1]))

    def _slopes(self, at: Array) -> tuple[Array, Array, Array]:
        """Return the height (3,), Fisher's information (3, c, c), and minus the height's gradient
        (3, c), of the gains and the noise of each pair.
        """
        steady, gains = self._filter(at), at[:, :-SEARCHED]
        slopes, change = self._filter_slopes(at, steady)
        g, c, n = gains.shape[1], at.shape[1], 0
        products = np.zeros((3, 2, 2, c + 1, c + 1))
        for seen, jumps in zip(self.see(steady, gains), self.jumps, strict=True):
            out = np.empty((6, len(jumps), c + 1))
            _respond(
                self.period,
                self.gravity * PULL,
                steady.gain,
                jumps,
                self.jump_state,
                slopes,
                seen.innovations,
                seen.disturbance,
                steady.keep,
                out,
            )
            out[:, :, -1] = seen.innovations.T
            rows = out[:, seen.fit]
            n += rows.shape[1]
            for p, i, j in np.ndindex(products.shape[:3]):
                products[p, i, j] += rows[PAIRS[p, i]].T @ rows[PAIRS[p, j]]
        covariance = _covariance(steady)
        inverse = np.linalg.inv(covariance)
        whole = np.einsum("pij,pijkl->pkl", inverse, products)
        normal, right = whole[:, :-1, :-1], whole[:, :-1, -1]
        normal[:, range(g), range(g)] += self.held**-2
        right[:, :g] -= gains / self.held**2
        # of the innovations' covariance
        own = products[..., -1, -1]
        share = inverse @ change  # (m, 3, 2, 2)
        normal[:, g:, g:] += 0.5 * n * np.einsum("mpij,lpji->pml", share, share)
        right[:, g:] += 0.5 * np.einsum("mpij,pji->pm", share, inverse @ own - n * np.eye(2))
        return self._deviance(own, covariance, gains, n), normal, right

    def _filter_slopes(self, at: Array, here: SteadyFilter) -> tuple[Array, Array]:
        """Return what a unit of each number of a pair's noise adds to the gains and to ``keep`` of
        its axes (6, 7, m), and to the covariance of its innovations (m, 3, 2, 2).
        """
        numbers = range(SEARCHED)
        noise = [self._noise(at + STEP * np.eye(at.shape[1])[i - SEARCHED]) for i in numbers]
        fields = ("pose", "disturbance", "time", "white")
        moved = PoseNoise(*(np.stack([getattr(x, f) for x in noise]) for f in fields))
        there = steady_filter(moved, self.period, self.gravity)
        gain = (there.gain - here.gain).reshape(SEARCHED, 6, 6)
        slopes = np.concatenate([gain, (there.keep - here.keep)[..., None]], axis=2) / STEP
        change = (_covariance(there) - _covariance(here)) / STEP
        return np.ascontiguousarray(np.moveaxis(slopes, 0, -1)), change


def _pairs(x: Array) -> Array:
    return np.asarray(x[PAIRS].reshape(len(PAIRS), -1))


def _covariance(steady: SteadyFilter) -> Array:
    """Return the covariance of each pair's innovations (..., 3, 2, 2)."""
    return np.asarray(steady.covariance[..., PAIRS[:, :, None], PAIRS[:, None, :]])


def _free(noise: PoseNoise) -> Array:
    """Return a noise as what is searched (6, 4): logarithms of the pose's standard deviation, the
    disturbance's and its correlation time, and the white acceleration's variance over the
    disturbance's.
    """
    logs = [np.log(x) for x in (noise.pose, noise.disturbance, noise.time)]
    return np.stack([*logs, np.square(noise.white / noise.disturbance)], axis=-1)


def _noise(x: Array) -> PoseNoise:
    pose, disturbance, time = np.moveaxis(np.exp(x[..., :3]), -1, 0)
    return PoseNoise(pose, disturbance, time, disturbance * np.sqrt(x[..., 3]))
