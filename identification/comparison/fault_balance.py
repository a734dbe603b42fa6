"""The balance of torque and thrust in four channels, and the likelihood of a change.

* Angular acceleration about x, y and z: ``a (s . g) + b + d w + e w' w''``. The rotors' thrusts are
  ``g``, the signs of their moments ``s``, the angular velocity (damping) ``w`` and the product of
  the other two (gyroscopic) ``w' w''``; about z also parts of the acceleration about x and y.
* Specific force along z: ``a`` times the sum of ``g``.

The coefficients ``a`` are positive and otherwise free, so neither mass, inertia nor arm has to be
known. Innovations of a column beginning at some time are worked out for all times at once, from
sums that run backwards.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import toeplitz
from scipy.ndimage import maximum_filter1d

from ...runtime.arrays import Array, Index
from .fault_channels import STEP, Samples
from .fault_noise import Noise, fit_noise

# signs of the rotors' moments about x, y, z; the last row is the force along z
_SIGNS = np.array([[1, 1, -1, -1], [-1, 1, 1, -1], [1, -1, 1, -1], [1, 1, 1, 1]], dtype=np.float64)
_AROUND = 5  # intervals around a strong acceleration: the model may be as wrong there
_TURNING = 0.1  # activity per (rad/s)^2: the model's error while the vehicle turns


class Begin(NamedTuple):
    """The course of a loss."""

    part: float  # elapsed part of the first interval
    # as the rotors' speed falls (a motor that fails), or at once (a propeller that breaks)
    lagged: bool


class FaultBalance:
    """The columns of the four channels with one lag and one curve of the rotors (N samples)."""

    def __init__(self, samples: Samples, thrust: Array, lag: float) -> None:
        w, turning = samples.angular_velocity, samples.angular_acceleration
        ones = np.ones((len(w), 1))
        self.follows = samples.follows
        self.thrust = thrust  # (N, 4)
        self.lag = lag  # s
        free = [
            np.column_stack([ones, w[:, [i]], (w[:, (i + 1) % 3] * w[:, (i + 2) % 3])[:, None]])
            for i in range(3)
        ] + [np.zeros((len(w), 0))]
        # a gyro askew by a few degrees shows a part of the strong axes' motion about the weak one
        free[2] = np.column_stack([free[2], turning[:, :2]])
        y, moment = np.column_stack([turning, samples.specific_force]), thrust @ _SIGNS.T
        # each channel's measurement, moment and free columns
        self.columns = [
            np.column_stack([y[:, c], moment[:, c], each]) for c, each in enumerate(free)
        ]
        away = np.abs(thrust - np.median(thrust, axis=0)).mean(axis=1)
        away += _TURNING * np.square(w).sum(axis=1) + samples.between
        # at the start of a fault the error of its shape grows with the acceleration
        strong = maximum_filter1d(np.linalg.norm(turning[:, :2], axis=1), _AROUND)
        away += strong / max(float(strong.max()), 1e-300)
        # a rotor late by an interval is wrong there too
        self.activity = np.maximum(away, np.concatenate([away[:1], away[:-1]]))

    def ramp(self, begin: Begin) -> Array:
        """Return the elapsed share (J,) of a loss in each interval; 1 afterwards."""
        lag = self.lag if begin.lagged else 0.0
        count = 1 + math.ceil(4.0 * lag / STEP)
        x = STEP * np.arange(count + 1)
        since = np.maximum(x - begin.part * STEP, 0.0)
        # integral of 1 - exp(-since / lag)
        area = since + lag * np.expm1(-since / lag) if lag > 0.0 else since
        share: Array = np.diff(area) / STEP
        return share

    def share(self, row: int, begin: Begin) -> Array:
        """Return the elapsed share (N,) of a change beginning at a row."""
        share = np.zeros(len(self.thrust))
        ramp = self.ramp(begin)
        share[row:] = 1.0
        share[row : row + len(ramp)] = ramp[: len(share) - row]
        return share

    def channels(self, *step: Array) -> "list[BalanceChannel]":
        """Return the channels, each with noise fitted to the residual of no change, or beside a
        ``step`` (N,).
        """
        fitted = []
        for columns in self.columns:
            y, x = columns[:, 0], np.column_stack([columns[:, 1:], *step])
            beta = np.linalg.lstsq(x, y, rcond=None)[0]
            if beta[0] <= 0.0:  # a moment with a negative factor is left out
                x = x[:, 1:]
                beta = np.linalg.lstsq(x, y, rcond=None)[0]
            noise = fit_noise(y - x @ beta, self.activity, self.follows)
            fitted.append(BalanceChannel(columns, noise))
        return fitted

    def lost(self, rotor: int, share: Array) -> Array:
        """Return each channel's loss (N, 4) if a ``share`` (N,) of rotor 0 to 3 goes."""
        return (self.thrust[:, rotor] * share)[:, None] * _SIGNS[:, rotor]


class BalanceChannel:
    """Innovations of a channel's measurement and moment, the free columns projected out."""

    def __init__(self, columns: Array, noise: Noise) -> None:
        self.noise, self.white = noise, noise.whiten(columns)
        self.basis = np.linalg.qr(self.white[:, 2:])[0]
        both = self.white[:, :2]
        self.both = both - self.basis @ (self.basis.T @ both)
        (self.yy, self.my), (_, self.mm) = (self.both.T @ self.both).tolist()
        self.mm = max(self.mm, 1e-300)
        self.gain = max(self.my, 0.0) / self.mm

    def nothing(self) -> float:
        """Return the log-likelihood where nothing happens."""
        return float(self.noise.log_likelihood(np.array(self.yy - self.gain * self.my)))

    def part(self, column: Array) -> tuple[float, float]:
        """Return the ratio, negative, of the factors of a column (N,) and of the moment, and its
        standard deviation: infinite where the channel does not follow the commands.
        """
        y, x = self.white[:, 0], np.insert(self.white[:, 1:], 1, self.noise.whiten(column), axis=1)
        beta, *_ = np.linalg.lstsq(x, y, rcond=None)
        left = y - x @ beta
        covariance = np.linalg.pinv(x.T @ x) * float(left @ left) / max(1, len(y) - len(beta))
        a, b = float(beta[0]), float(beta[1])
        if a <= 2.0 * math.sqrt(covariance[0, 0]):
            return 0.0, math.inf
        slope = np.array([b / a**2, -1.0 / a])
        return -b / a, math.sqrt(max(float(slope @ covariance[:2, :2] @ slope), 1e-12))

    def steps(self, rows: Index, ramp: Array) -> Array:
        """Return the log-likelihoods (K,) of a step beginning at each of ``rows`` by a ramp.

        The size is the best one, at the price of a normal prior: as wide as this size, or as wide
        as a single sample's if wider.
        """
        sy, sm, ss = self._beginning(rows, ramp)
        own_share = np.maximum(ss - sm * sm / self.mm, 1e-12 * ss + 1e-300)
        gain = np.square(sy - sm * self.my / self.mm) / own_share
        width = np.log(np.maximum(gain / self.noise.variance, 1.0))
        price = 0.5 * np.maximum(1.0 + width, math.log(self.noise.whole.sum()))
        logs: Array = self.noise.log_likelihood(self.yy - self.gain * self.my - gain) - price
        return logs

    def _beginning(self, rows: Index, ramp: Array) -> Array:
        """Return products (3, K) of a share of 1 beginning at each of ``rows`` (K,) by a ramp: with
        y, with the moment, with itself; after projection.
        """
        noise, early = self.noise, len(self.noise.filter) - 1 + len(ramp)

        def padded(x: Array) -> Array:
            return np.concatenate([x, np.zeros((early + 1, *x.shape[1:]))])

        against = np.zeros((len(noise.whole), 2 + self.basis.shape[1]))
        against[noise.whole] = np.column_stack([self.both, self.basis])
        full = np.where(noise.whole, noise.filtered(np.ones(len(against))), 0.0)
        late = np.column_stack([full[:, None] * against, full**2])
        sums = padded(np.cumsum(late[::-1], axis=0)[::-1])[rows + early]
        # the first outputs of the filter after each beginning, during the ramp
        at = rows[:, None] + np.arange(early)
        begun = padded(1.0 / noise.scale)[at]
        begun[:, : len(ramp)] *= ramp
        taps = toeplitz(np.append(noise.filter, np.zeros(len(ramp) - 1)), np.zeros(early))
        values = begun @ taps.T * padded(noise.whole.astype(float))[at]
        sums[:, :-1] += np.einsum("kj,kjq->kq", values, padded(against)[at])
        p = sums[:, 2:-1]
        own = sums[:, -1] + np.square(values).sum(axis=1) - np.square(p).sum(axis=1)
        return np.array([sums[:, 0], sums[:, 1], own])
