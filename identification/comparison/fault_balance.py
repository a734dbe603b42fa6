"""The balance of torque and thrust in four channels, and the likelihood of a change.

* Angular acceleration about x, y and z: ``a (s . g) + b + d w + e w' w''``. The rotors' thrusts are
  ``g``, the signs of their moments ``s``, the angular velocity (damping) ``w`` and the product of
  the other two (gyroscopic) ``w' w''``; about z also parts of the acceleration about x and y.
* Specific force along z: ``a`` times the sum of ``g``.

The coefficients ``a`` are positive and otherwise free, so neither mass, inertia nor arm has to be
known. Filters run backwards and give the innovations of a column for all times of its beginning at
once.

The noise of a channel is correlated, and larger while the rotors work unusually. The weights are
the size of the model's own error: a share of the rotors' deviation from the mean. The correlation
is an autoregression, fitted by least squares. Its filter turns the residual into innovations
(Willsky and Jones, *A generalized likelihood ratio approach to the detection and estimation of
jumps in linear systems*, IEEE Transactions on Automatic Control 21, 1976).
"""

import math
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ...runtime.arrays import Array, Index, Mask
from .fault_channels import STEP, Samples

# signs of the rotors' moments about x, y, z; the last row is the force along z
_SIGNS: Array = np.array([[1.0, 1, -1, -1], [-1, 1, 1, -1], [1, -1, 1, -1], [1, 1, 1, 1]])
BEFORE, AFTER = 25, 4  # least intervals of usual flight before a fault, and after one
PARTS = (0.0, 0.25, 0.5, 0.75)  # starts of a fault within an interval
_AROUND = 5  # intervals around a strong acceleration: the model may be as wrong there
ORDER = 10
SHARES = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0)  # activity over the quiet level, tried in turn
_TURNING = 0.1  # activity per (rad/s)^2: the model's error while the vehicle turns


class Noise(NamedTuple):
    """Weights and whitening filter of one channel (N samples)."""

    scale: Array  # (N,) relative standard deviation
    filter: Array  # (p + 1,) the autoregression's, first 1
    whole: Mask  # (N,) the p samples before are there, without a gap
    variance: float  # fitted innovations

    def whiten(self, values: Array) -> Array:
        """Return innovations (n, ...) of values (N, ...), at the rows ``whole``."""
        return self.filtered(values)[self.whole]

    def filtered(self, values: Array) -> Array:
        """Return the filter's output (N, ...); rows outside ``whole`` mean nothing."""
        from scipy.signal import lfilter  # as late as can be: it takes .6 s

        return np.asarray(lfilter(self.filter, 1.0, (values.T / self.scale).T, axis=0))

    def log_likelihood(self, rest: Array | float) -> Array:
        """Return the log-likelihood of innovations with ``rest`` as the sum of squares, at the best
        variance.
        """
        n = self.whole.sum()
        log_scale = np.log(self.scale[self.whole]).sum()
        return np.asarray(-0.5 * n * np.log(np.maximum(rest, 1e-300) / n) - log_scale)


def fit_noise(residual: Array, activity: Array, follows: Mask) -> Noise:
    """Fit the noise to a residual.

    Args:
        residual: (N,).
        activity: (N,) relative deviation of the rotors from the mean.
        follows: (N,) the sample before is there.
    """
    whole = np.convolve(follows, np.ones(ORDER))[: len(follows)] == ORDER
    whole[:ORDER] = False
    tried = []
    for share in SHARES:
        scale = np.hypot(1.0, share * activity)
        windows = sliding_window_view(residual / scale, ORDER + 1)[whole[ORDER:], ::-1]
        present, past = windows[:, 0], windows[:, 1:]
        # a ridge keeps the filter tame where a residual is next to nothing
        gram = past.T @ past + 1e-6 * (present @ present) * np.eye(ORDER)
        poles = np.linalg.solve(gram, past.T @ present)
        rest = np.square(present - past @ poles).sum()
        noise = Noise(scale, np.append(1.0, -poles), whole, rest / len(present))
        tried.append((noise.log_likelihood(rest), noise))
    return max(tried, key=itemgetter(0))[1]


class FaultBalance:
    """The four channels with one lag and one curve of the rotors (N samples), the noise fitted
    beside the likeliest jump.

    Attributes:
        nothing, log: log-likelihoods of no jump, and of the likeliest.
        share: elapsed share (N,) of the likeliest jump.
        rows: possible starts of a fault.
        ramps: elapsed shares (J,) of a loss in each interval; 1 afterwards. A loss begins within an
            interval, at once (a propeller that breaks) or as the rotors' speed falls (a motor).
    """

    def __init__(self, samples: Samples, lag: float, bend: float, dead: float) -> None:
        from scipy.ndimage import maximum_filter1d  # as late as can be: it takes .1 s

        w = samples.angular_velocity
        turning = samples.angular_acceleration
        self.rows = np.arange(BEFORE, len(w) - AFTER)
        self.thrust = thrust = samples.thrust(lag, bend, dead)  # (N, 4)
        self.ramps = [_ramp(part, late) for late in (0.0, lag) for part in PARTS]
        gyroscopic = np.roll(w, -1, axis=1) * np.roll(w, 1, axis=1)
        free = [[np.ones(len(w)), *own] for own in zip(w.T, gyroscopic.T, strict=True)]
        # a gyro askew by a few degrees shows a part of the strong axes' motion about the weak one
        free[2].extend(turning.T[:2])
        free.append([])
        # each channel's measurement, moment and free columns
        columns = [
            np.column_stack([y, thrust @ signs, *own])
            for y, signs, own in zip(
                [*turning.T, samples.specific_force], _SIGNS, free, strict=True
            )
        ]
        away = np.abs(thrust - np.median(thrust, axis=0)).mean(axis=1)
        away += _TURNING * np.square(w).sum(axis=1) + samples.between
        # at the start of a fault the error of its shape grows with the acceleration
        strong = maximum_filter1d(np.linalg.norm(turning[:, :2], axis=1), _AROUND)
        away += strong / max(strong.max(), 1e-300)
        # a rotor late by an interval is wrong there too
        activity = np.maximum(away, np.append(away[:1], away[:-1]))
        step: list[Array] = []  # none, and then the likeliest jump beside the noise
        nothing: list[float] = []
        self.channels: list[_BalanceChannel] = []
        for _ in range(3):
            self.channels = [_BalanceChannel(x, activity, samples.follows, *step) for x in columns]
            nothing.append(sum(channel.nothing for channel in self.channels))
            self.log, self.share = self._jump()
            step = [self.share]
        self.nothing = max(nothing[0], nothing[-1])

    def _jump(self) -> tuple[float, Array]:
        """Return log-likelihood and elapsed share (N,) of the likeliest jump."""
        k = int(np.argmax(self.steps(self.rows, self.ramps[:1])))
        around = self.rows[max(k - 2, 0) : k + 3]
        logs = self.steps(around, self.ramps)
        ramp, k = divmod(int(np.argmax(logs)), len(around))
        count = len(self.thrust)
        share = np.concatenate([np.zeros(around[k]), self.ramps[ramp], np.ones(count)])[:count]
        return logs[ramp, k], share

    def steps(self, rows: Index, ramps: list[Array]) -> Array:
        """Return the log-likelihoods (R, K) of a jump by each ramp, beginning at each of rows."""
        return np.array([sum(c.steps(rows, ramp) for c in self.channels) for ramp in ramps])

    def lost(self, rotor: int) -> Array:
        """Return each channel's loss (N, 4) if rotor 0 to 3 goes as the likeliest jump does."""
        return (self.thrust[:, rotor] * self.share)[:, None] * _SIGNS[:, rotor]


def _ramp(part: float, lag: float) -> Array:
    """Return a loss from an elapsed ``part`` of the first interval on, by a lag (s)."""
    since = np.maximum(STEP * (np.arange(2 + math.ceil(4.0 * lag / STEP)) - part), 0.0)
    # integral of 1 - exp(-since / lag)
    area = since + lag * np.expm1(-since / lag) if lag > 0.0 else since
    return np.asarray(np.diff(area) / STEP)


class _BalanceChannel:
    """Innovations of a channel's measurement and moment, the free columns projected out."""

    def __init__(self, columns: Array, activity: Array, follows: Mask, *step: Array) -> None:
        y = columns[:, 0]
        x = np.column_stack([columns[:, 1:], *step])
        residual = y - x @ (beta := np.linalg.lstsq(x, y, rcond=None)[0])
        if beta[0] <= 0.0:  # a moment with a negative factor is left out
            residual = y - x[:, 1:] @ np.linalg.lstsq(x[:, 1:], y, rcond=None)[0]
        self.noise = noise = fit_noise(residual, activity, follows)
        self.white = noise.whiten(columns)
        self.basis = np.linalg.qr(self.white[:, 2:])[0]
        both = self.white[:, :2]
        self.both = both - self.basis @ (self.basis.T @ both)
        (yy, self.my), (_, mm) = (self.both.T @ self.both).tolist()
        self.mm = max(mm, 1e-300)
        # sum of squares where nothing happens, and its log-likelihood
        self.rest = yy - max(self.my, 0.0) / self.mm * self.my
        self.nothing = float(noise.log_likelihood(self.rest))

    def part(self, column: Array) -> tuple[float, float]:
        """Return the ratio, negative, of the factors of a column (N,) and of the moment, and its
        standard deviation: infinite where the channel does not follow the commands.
        """
        y = self.white[:, 0]
        x = np.insert(self.white[:, 1:], 1, self.noise.whiten(column), axis=1)
        beta = np.linalg.lstsq(x, y, rcond=None)[0]
        left = y - x @ beta
        covariance = np.linalg.pinv(x.T @ x) * (left @ left) / max(1, len(y) - len(beta))
        a, b = beta[:2].tolist()
        if a <= 2.0 * math.sqrt(covariance[0, 0]):
            return 0.0, math.inf
        slope = np.array([b / a**2, -1.0 / a])
        return -b / a, math.sqrt(max(slope @ covariance[:2, :2] @ slope, 1e-12))

    def steps(self, rows: Index, ramp: Array) -> Array:
        """Return the log-likelihoods (K,) of a step beginning at each of ``rows`` by a ramp.

        The size is the best one, at the price of a normal prior: as wide as this size, or as wide
        as a single sample's if wider.
        """
        from scipy.signal import lfilter  # as late as can be: it takes .6 s

        noise = self.noise
        # products of an impulse in each row with y, the moment and the basis
        against = np.zeros((len(noise.whole), 2 + self.basis.shape[1]))
        against[noise.whole] = np.column_stack([self.both, self.basis])
        impulse = lfilter(noise.filter, 1.0, against[::-1], axis=0) / noise.scale[::-1, None]
        # a step is a row of impulses
        growth = np.diff(ramp, prepend=0.0, append=1.0)
        sums = lfilter(growth, [1.0, -1.0], impulse, axis=0)[::-1][rows]
        sy, sm = sums[:, :2].T
        # its square: first outputs of the filter during the ramp, and later ones of a share of 1
        pad = 0, len(noise.filter) - 1 + len(ramp)
        at = rows[:, None] + np.arange(pad[1])
        begun = 1.0 / np.pad(noise.scale, pad, constant_values=np.inf)[at]
        begun[:, : len(ramp)] *= ramp
        first = lfilter(noise.filter, 1.0, begun) * np.pad(noise.whole, pad)[at]
        later = np.square(noise.whole * noise.filtered(np.ones(len(noise.whole))))
        ss = np.pad(np.cumsum(later[::-1])[::-1], pad)[rows + pad[1]]
        ss += np.square(first).sum(axis=1) - np.square(sums[:, 2:]).sum(axis=1)
        own_share = np.maximum(ss - sm * sm / self.mm, 1e-12 * ss + 1e-300)
        gain = np.square(sy - sm * self.my / self.mm) / own_share
        width = 1.0 + np.log(np.maximum(gain / noise.variance, 1.0))
        price = 0.5 * np.maximum(width, math.log(noise.whole.sum()))
        return np.asarray(noise.log_likelihood(self.rest - gain) - price)
