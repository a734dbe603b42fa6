"""The balance of torque and thrust in four channels, and how likely a change makes it.

* Angular acceleration about x, y and z: ``a (s . g) + b + d w + e w' w''``, where ``g`` are the
  rotors' thrusts, ``s`` the signs of their moments, ``w`` the angular velocity (damping) and
  ``w' w''`` the product of the other two (gyroscopic).
* Specific force along z: ``a`` times the sum of ``g``.

The coefficients ``a`` are positive and otherwise free, so neither mass, inertia nor arm has to be
known. Innovations of a column that begins at some time are worked out for all times at once, from
sums that run backwards.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ...runtime.compiled import compiled
from .channels import STEP, Samples
from .noise import Noise, fit_noise

Array = NDArray[np.float64]

# signs of the rotors' moments about x, y, z; the last row is the force along z
_SIGNS = np.array([[1, 1, -1, -1], [-1, 1, 1, -1], [1, -1, 1, -1], [1, 1, 1, 1]], dtype=np.float64)
CHANNELS = 4
_TURNING = 0.1  # of activity, per (rad/s)^2: what the model lacks when the vehicle turns


class Balance:
    """The four channels' regressions with one lag and one curve of the rotors."""

    def __init__(self, samples: Samples, thrust: Array, lag: float) -> None:
        w = samples.angular_velocity
        ones = np.ones((len(w), 1))
        self.follows = samples.follows
        self.thrust = thrust  # (N, 4)
        self.lag = lag  # s
        self.y = np.column_stack([samples.angular_acceleration, samples.specific_force])
        self.others = [
            np.column_stack([ones, w[:, [i]], (w[:, (i + 1) % 3] * w[:, (i + 2) % 3])[:, None]])
            for i in range(3)
        ] + [np.zeros((len(w), 0))]
        self.moment = thrust @ _SIGNS.T  # (N, 4)
        away = np.abs(thrust - np.median(thrust, axis=0)).mean(axis=1)
        away += _TURNING * np.square(w).sum(axis=1) + samples.between
        # a rotor that is late by an interval is wrong there too
        self.activity = np.maximum(away, np.concatenate([away[:1], away[:-1]]))

    def ramp(self, part: float) -> Array:
        """Return the share (J,) by which a loss that began ``part`` of an interval after the first
        one's start has come, as the rotors' lag lets it; 1 after that.
        """
        count = 1 + math.ceil(4.0 * self.lag / STEP)
        x = STEP * np.arange(count + 1)
        begin = part * STEP
        since = np.maximum(x - begin, 0.0)
        # integral of 1 - exp(-since / lag)
        area = since + self.lag * np.expm1(-since / self.lag) if self.lag > 0.0 else since
        share: Array = np.diff(area) / STEP
        return share

    def residuals(self, rotors: Array, row: int, loss: float, part: float = 0.0) -> Array:
        """Return residuals (N, 4) where ``rotors`` (4,) lose a share from a row on."""
        lost = np.zeros(len(self.y))
        ramp = self.ramp(part)
        lost[row:] = 1.0
        lost[row : row + len(ramp)] = ramp[: len(lost) - row]
        g = self.thrust * (1.0 - loss * lost[:, None] * rotors)
        return np.column_stack([self._left(c, g @ _SIGNS[c]) for c in range(CHANNELS)])

    def step_residuals(self, row: int) -> Array:
        """Return residuals (N, 4) with a step in each channel."""
        step = (np.arange(len(self.y)) >= row).astype(np.float64)
        return np.column_stack(
            [self._left(c, self.moment[:, c], step[:, None]) for c in range(CHANNELS)]
        )

    def _left(self, c: int, moment: Array, *more: Array) -> Array:
        """Return the residual (N,) of a channel."""
        rest = [*more, self.others[c]]
        x = np.column_stack([moment, *rest])
        beta = np.linalg.lstsq(x, self.y[:, c], rcond=None)[0]
        if beta[0] <= 0.0:
            x = np.column_stack(rest)
            beta = np.linalg.lstsq(x, self.y[:, c], rcond=None)[0]
        left: Array = self.y[:, c] - x @ beta
        return left

    def noises(self, residuals: Array) -> list[Noise]:
        """Return each channel's noise, fitted to residuals (N, 4)."""
        return [fit_noise(residuals[:, c], self.activity, self.follows) for c in range(CHANNELS)]

    def nothing(self, noises: list[Noise]) -> float:
        """Return the log-likelihood where nothing happens."""
        total = 0.0
        for c, noise in enumerate(noises):
            fixed = _Fixed(noise, self.others[c], self.y[:, c], self.moment[:, c])
            gain = max(fixed.my, 0.0) ** 2 / fixed.mm
            total += float(_log_likelihood(np.array(fixed.yy - gain), noise))
        return total

    def losses(
        self,
        noises: list[Noise],
        rotors: Array,
        rows: Array,
        losses: Array,
        part: float,
        error: float,
    ) -> Array:
        """Return the log-likelihoods (K, E) of a loss of ``rotors`` (4,) from each of ``rows`` (K,)
        on, by each of ``losses`` (E,).

        What the model gets wrong of a loss is a step in each channel that begins with it, of
        standard deviation ``error`` times what is lost.
        """
        total = np.zeros((len(rows), len(losses)))
        ramp = self.ramp(part)
        for c, noise in enumerate(noises):
            fixed = _Fixed(noise, self.others[c], self.y[:, c], self.moment[:, c])
            lost = self.thrust @ (rotors * _SIGNS[c])
            h = fixed.beginning(np.column_stack([lost, np.ones_like(lost)]), rows, ramp)
            hy, sy, hm, sm, hh, ss, hs = (v[:, None] for v in h)
            mm = np.maximum(fixed.mm - 2.0 * losses * hm + np.square(losses) * hh, 1e-300)
            my = fixed.my - losses * hy
            ms = sm - losses * hs
            a = np.maximum(my, 0.0) / mm
            rest = fixed.yy - a * my
            used = a > 0.0
            against = np.where(used, sy - ms * a, sy)
            own = np.maximum(np.where(used, ss - ms * ms / mm, ss), 0.0)
            prior = np.square(error * a * losses * np.abs(rotors).sum()) / noise.variance
            gain = np.square(against) * prior / (1.0 + prior * own)
            total += _log_likelihood(rest - gain, noise) - 0.5 * np.log1p(prior * own)
        return total

    def steps(self, noises: list[Noise], rows: Array) -> Array:
        """Return the log-likelihoods (K,) of a step in each channel from each of ``rows`` on, of
        whatever size explains it best, at the price of a normal prior as wide as that size.
        """
        total = np.zeros(len(rows))
        for c, noise in enumerate(noises):
            fixed = _Fixed(noise, self.others[c], self.y[:, c], self.moment[:, c])
            one = np.ones((len(self.y), 2))
            _, sy, _, sm, _, ss, _ = fixed.beginning(one, rows, np.ones(1))
            a = max(fixed.my, 0.0) / fixed.mm
            own = np.maximum(ss - sm * sm / fixed.mm, 1e-12 * ss + 1e-300)
            gain = np.square(sy - sm * fixed.my / fixed.mm) / own
            price = 0.5 * (1.0 + np.log(np.maximum(gain / noise.variance, 1.0)))
            total += _log_likelihood(fixed.yy - a * fixed.my - gain, noise) - price
        return total


class _Fixed:
    """Innovations of a channel and of its moment, with the free columns projected out."""

    def __init__(self, noise: Noise, others: Array, y: Array, moment: Array) -> None:
        self.noise = noise
        white = noise.whiten(others)
        self.basis = np.linalg.qr(white)[0] if white.shape[1] else white
        both = noise.whiten(np.column_stack([y, moment]))
        self.both = both - self.basis @ (self.basis.T @ both)
        (self.yy, self.my), (_, self.mm) = (self.both.T @ self.both).tolist()
        self.mm = max(self.mm, 1e-300)

    def beginning(self, columns: Array, rows: Array, ramp: Array) -> Array:
        """Return products (7, K) of two columns (N, 2) that begin at each of ``rows`` (K,) by a
        ramp: first and second with y, with the moment, with themselves, and with each other; after
        projection.
        """
        noise = self.noise
        n, order = len(columns), len(noise.filter) - 1
        weighted = columns / noise.scale[:, None]
        against = np.zeros((n, 2 + self.basis.shape[1]))
        against[noise.whole] = np.column_stack([self.both, self.basis])
        full = np.where(noise.whole[:, None], noise.filtered(columns), 0.0)
        early = order + len(ramp)  # intervals in which the ramp still shows
        pairs = np.column_stack([full**2, full[:, 0] * full[:, 1]])
        with_all = np.einsum("nd,nk->ndk", full, against).reshape(n, -1)
        late = np.column_stack([with_all, pairs])
        late = np.cumsum(late[::-1], axis=0)[::-1]
        late = np.concatenate([late, np.zeros((early + 1, late.shape[1]))])
        sums = late[rows + early].copy()
        weight = np.concatenate([ramp, np.ones(early)])
        _add_beginnings(sums, rows, weight, early, weighted, noise.filter, noise.whole, against)
        both = sums[:, : with_all.shape[1]].reshape(len(rows), 2, -1)
        first, second = both[:, 0], both[:, 1]
        p, q = first[:, 2:], second[:, 2:]
        own = sums[:, -3:]
        return np.array(
            [
                *(first[:, 0], second[:, 0], first[:, 1], second[:, 1]),
                own[:, 0] - (p * p).sum(axis=1),
                own[:, 1] - (q * q).sum(axis=1),
                own[:, 2] - (p * q).sum(axis=1),
            ]
        )


@compiled
def _add_beginnings(
    sums: Array,
    rows: NDArray[np.int64],
    weight: Array,
    early: int,
    weighted: Array,
    taps: Array,
    whole: NDArray[np.bool_],
    against: Array,
) -> None:
    """Add to ``sums`` (K, 2 q + 3) what the first ``early`` outputs of the filter bring after each
    beginning: there the column has begun in part only.
    """
    count, width = weighted.shape[0], against.shape[1]
    for r in range(len(rows)):
        for j in range(early):
            at = rows[r] + j
            if at >= count or not whole[at]:
                continue
            one, two = 0.0, 0.0
            for k in range(min(j, len(taps) - 1) + 1):
                share = taps[k] * weight[j - k]
                one += share * weighted[at - k, 0]
                two += share * weighted[at - k, 1]
            for q in range(width):
                sums[r, q] += one * against[at, q]
                sums[r, width + q] += two * against[at, q]
            sums[r, 2 * width] += one * one
            sums[r, 2 * width + 1] += two * two
            sums[r, 2 * width + 2] += one * two


def _log_likelihood(rest: Array, noise: Noise) -> Array:
    """Return the log-likelihood of a channel whose innovations' squares sum to ``rest``, with their
    variance at its best.
    """
    n = int(noise.whole.sum())
    found: Array = -0.5 * n * np.log(np.maximum(rest, 1e-300) / n) - noise.log_scale
    return found
