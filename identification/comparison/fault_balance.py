"""The balance of torque and thrust in four channels, and how likely a change makes it.

* Angular acceleration about x, y and z: ``a (s . g) + b + d w + e w' w''``, where ``g`` are the
  rotors' thrusts, ``s`` the signs of their moments, ``w`` the angular velocity (damping) and
  ``w' w''`` the product of the other two (gyroscopic); about z also parts of what x and y do.
* Specific force along z: ``a`` times the sum of ``g``.

The coefficients ``a`` are positive and otherwise free, so neither mass, inertia nor arm has to be
known. Innovations of a column that begins at some time are worked out for all times at once, from
sums that run backwards.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.ndimage import maximum_filter1d

from .fault_channels import STEP, Samples
from .fault_noise import Noise, fit_noise

Array = NDArray[np.float64]

# signs of the rotors' moments about x, y, z; the last row is the force along z
_SIGNS = np.array([[1, 1, -1, -1], [-1, 1, 1, -1], [1, -1, 1, -1], [1, 1, 1, 1]], dtype=np.float64)
CHANNELS = 4
_AROUND = 5  # intervals, around a strong acceleration in which the model may be as wrong
_TURNING = 0.1  # of activity, per (rad/s)^2: what the model lacks when the vehicle turns


class Begin(NamedTuple):
    """How a loss comes."""

    part: float  # of the first interval that is over when it begins
    # as the rotors' speed falls (a motor that fails), or at once (a propeller that breaks)
    lagged: bool


AT_ONCE = Begin(0.0, False)


class FaultBalance:
    """The four channels' regressions with one lag and one curve of the rotors."""

    def __init__(self, samples: Samples, thrust: Array, lag: float) -> None:
        w = samples.angular_velocity
        ones = np.ones((len(w), 1))
        self.follows = samples.follows
        self.thrust = thrust  # (N, 4)
        self.lag = lag  # s
        self.y = np.column_stack([samples.angular_acceleration, samples.specific_force])
        self.free_columns = [
            np.column_stack([ones, w[:, [i]], (w[:, (i + 1) % 3] * w[:, (i + 2) % 3])[:, None]])
            for i in range(3)
        ] + [np.zeros((len(w), 0))]
        # a gyro that is mounted askew by a few degrees shows a part of what the strong axes do
        # about the weak one
        self.free_columns[2] = np.column_stack(
            [self.free_columns[2], samples.angular_acceleration[:, :2]]
        )
        self.moment = thrust @ _SIGNS.T  # (N, 4)
        away = np.abs(thrust - np.median(thrust, axis=0)).mean(axis=1)
        away += _TURNING * np.square(w).sum(axis=1) + samples.between
        # where a fault begins, what is wrong of its shape grows with what it does
        strong = np.linalg.norm(samples.angular_acceleration[:, :2], axis=1)
        strong = maximum_filter1d(strong, _AROUND)
        away += strong / max(float(strong.max()), 1e-300)
        # a rotor that is late by an interval is wrong there too
        self.activity = np.maximum(away, np.concatenate([away[:1], away[:-1]]))

    def ramp(self, begin: Begin) -> Array:
        """Return the share (J,) of a loss that has come in each interval; 1 after that."""
        lag = self.lag if begin.lagged else 0.0
        count = 1 + math.ceil(4.0 * lag / STEP)
        x = STEP * np.arange(count + 1)
        since = np.maximum(x - begin.part * STEP, 0.0)
        # integral of 1 - exp(-since / lag)
        area = since + lag * np.expm1(-since / lag) if lag > 0.0 else since
        share: Array = np.diff(area) / STEP
        return share

    def noises(self, row: int | None = None, begin: Begin = AT_ONCE) -> list[Noise]:
        """Return each channel's noise, fitted to what is left where nothing happens, or beside a
        step.
        """
        step = [] if row is None else [self._share(row, begin)]
        left = [self._left(c, *step) for c in range(CHANNELS)]
        return [fit_noise(x, self.activity, self.follows) for x in left]

    def _share(self, row: int, begin: Begin) -> Array:
        """Return the share (N,) of something that begins at a row that has come."""
        share = np.zeros(len(self.y))
        ramp = self.ramp(begin)
        share[row:] = 1.0
        share[row : row + len(ramp)] = ramp[: len(share) - row]
        return share

    def _left(self, c: int, *more: Array) -> Array:
        """Return the residual (N,) of a channel; a moment with a negative factor is left out."""
        x, y = np.column_stack([self.moment[:, c], *more, self.free_columns[c]]), self.y[:, c]
        beta = np.linalg.lstsq(x, y, rcond=None)[0]
        if beta[0] <= 0.0:
            x = x[:, 1:]
            beta = np.linalg.lstsq(x, y, rcond=None)[0]
        return np.asarray(y - x @ beta)

    def nothing(self, noises: list[Noise]) -> float:
        """Return the log-likelihood where nothing happens."""
        total = 0.0
        for c, noise in enumerate(noises):
            fixed = _Fixed(noise, self.free_columns[c], self.y[:, c], self.moment[:, c])
            gain = max(fixed.my, 0.0) ** 2 / fixed.mm
            total += float(noise.log_likelihood(np.array(fixed.yy - gain)))
        return total

    def losses(
        self, noises: list[Noise], rotor: int, row: int, begin: Begin
    ) -> tuple[Array, Array]:
        """Return the share that a rotor (0 to 3) seems to have lost by each channel alone (4,), and
        the standard deviations (4,), infinite where a channel does not show it.
        """
        lost = self.thrust[:, rotor] * self._share(row, begin)
        return self._shares(noises, [lost * sign for sign in _SIGNS[:, rotor]])

    def jumps(self, noises: list[Noise], row: int, begin: Begin) -> tuple[Array, Array]:
        """Return by how much each channel jumps (4,), downwards and in parts of what one rotor's
        usual thrust does there, and the standard deviations (4,).
        """
        return self._shares(noises, [self._share(row, begin)] * CHANNELS)

    def _shares(self, noises: list[Noise], columns: list[Array]) -> tuple[Array, Array]:
        """Return ratios (4,) of the coefficients of a column and of the moment, negative, and their
        standard deviations.
        """
        ratio, std = np.zeros(CHANNELS), np.full(CHANNELS, np.inf)
        for c, noise in enumerate(noises):
            x = noise.whiten(np.column_stack([self.moment[:, c], columns[c], self.free_columns[c]]))
            y = noise.whiten(self.y[:, c])
            beta, *_ = np.linalg.lstsq(x, y, rcond=None)
            left = y - x @ beta
            covariance = np.linalg.pinv(x.T @ x) * float(left @ left) / max(1, len(y) - len(beta))
            a, b = float(beta[0]), float(beta[1])
            if a > 2.0 * math.sqrt(covariance[0, 0]):  # the channel follows the commands
                slope = np.array([b / a**2, -1.0 / a])
                ratio[c] = -b / a
                std[c] = math.sqrt(max(float(slope @ covariance[:2, :2] @ slope), 1e-12))
        return ratio, std

    def steps(self, noises: list[Noise], rows: NDArray[np.int64], begin: Begin) -> Array:
        """Return the log-likelihoods (K,) of a step in each channel from each of ``rows`` on, of
        whatever size explains it best, at the price of a normal prior as wide as that size, or of
        one that is worth a single sample where that is wider.
        """
        total = np.zeros(len(rows))
        for c, noise in enumerate(noises):
            fixed = _Fixed(noise, self.free_columns[c], self.y[:, c], self.moment[:, c])
            sy, sm, ss = fixed.beginning(rows, self.ramp(begin))
            a = max(fixed.my, 0.0) / fixed.mm
            own_share = np.maximum(ss - sm * sm / fixed.mm, 1e-12 * ss + 1e-300)
            gain = np.square(sy - sm * fixed.my / fixed.mm) / own_share
            n = int(noise.whole.sum())
            width = np.log(np.maximum(gain / noise.variance, 1.0))
            price = 0.5 * np.maximum(1.0 + width, math.log(n))
            total += noise.log_likelihood(fixed.yy - a * fixed.my - gain) - price
        return total


class _Fixed:
    """Innovations of a channel and of its moment, with the free columns projected out."""

    def __init__(self, noise: Noise, free_columns: Array, y: Array, moment: Array) -> None:
        self.noise = noise
        white = noise.whiten(free_columns)
        self.basis = np.linalg.qr(white)[0] if white.shape[1] else white
        both = noise.whiten(np.column_stack([y, moment]))
        self.both = both - self.basis @ (self.basis.T @ both)
        (self.yy, self.my), (_, self.mm) = (self.both.T @ self.both).tolist()
        self.mm = max(self.mm, 1e-300)

    def beginning(self, rows: NDArray[np.int64], ramp: Array) -> Array:
        """Return products (3, K) of a share of 1 that begins at each of ``rows`` (K,) by a ramp:
        with y, with the moment, with itself; after projection.
        """
        noise, early = self.noise, len(self.noise.filter) - 1 + len(ramp)

        def padded(x: Array) -> Array:
            return np.concatenate([x, np.zeros((early + 1, *x.shape[1:]))])

        against = np.zeros((len(noise.whole), 2 + self.basis.shape[1]))
        against[noise.whole] = np.column_stack([self.both, self.basis])
        full = np.where(noise.whole, noise.filtered(np.ones(len(against))), 0.0)
        late = np.column_stack([full[:, None] * against, full**2])
        sums = padded(np.cumsum(late[::-1], axis=0)[::-1])[rows + early]
        # the first outputs of the filter after each beginning, while it has begun in part only
        at = rows[:, None] + np.arange(early)
        begun = padded(1.0 / noise.scale)[at]
        begun[:, : len(ramp)] *= ramp
        taps = toeplitz(np.append(noise.filter, np.zeros(len(ramp) - 1)), np.zeros(early))
        values = begun @ taps.T * padded(noise.whole.astype(np.float64))[at]
        sums[:, :-1] += np.einsum("kj,kjq->kq", values, padded(against)[at])
        p = sums[:, 2:-1]
        own = sums[:, -1] + np.square(values).sum(axis=1) - np.square(p).sum(axis=1)
        return np.array([sums[:, 0], sums[:, 1], own])
