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
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ...runtime.arrays import Array, Mask
from ..logs.table import Pair
from ..motion.smoothing import TOGETHER
from .fault_channels import ORDER, STEP, Samples

# signs of the rotors' moments about x, y, z; the last row is the force along z
SIGNS = TOGETHER[[1, 2, 3, 0]] * [[2.0], [-2.0], [2.0], [2.0]]
BEFORE, AFTER = 25, 4  # least intervals of usual flight before a fault, and after one
# starts of a loss within an interval: at once (a broken propeller), or as the rotors' speed falls
# (a motor)
STARTS = np.tile([0.0, 0.25, 0.5, 0.75], 2)
_AT_ONCE = 1e-9  # s, a lag
_AROUND = 5  # intervals around a strong acceleration: the model may be as wrong there
SHARES = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0)  # activity over the quiet level, tried in turn
_TURNING = 0.1  # activity per (rad/s)^2: the model's error while the vehicle turns
_RIDGE = 1e-6  # keeps the filter tame where a residual is next to nothing


class FaultBalance:
    """The four channels with one lag and one curve of the rotors (N samples), the noise fitted
    beside the likeliest jump.

    Attributes:
        curve: bend and dead zone of the rotors.
        thrust: relative thrusts (N, 4).
        channels: the four.
        rows: possible starts of a jump.
        ramps: elapsed shares (R, J) of a loss in its first intervals, by ``STARTS``; 1 afterwards.
        share: elapsed share (N,) of the likeliest jump.
        nothing, log: log-likelihoods of no jump, and of the likeliest.
    """

    def __init__(self, samples: Samples, lag: float, curve: Pair) -> None:
        from scipy.ndimage import maximum_filter1d  # as late as can be: it takes .1 s

        w, turning = samples.angular_velocity.T, samples.angular_acceleration.T
        count = w.shape[1]
        self.curve = curve
        self.rows = slice(BEFORE, count - AFTER)
        lags = np.repeat([_AT_ONCE, max(lag, _AT_ONCE)], 4)[:, None]
        elapsed = np.arange(2 + math.ceil(4.0 * lag / STEP)) - STARTS[:, None]
        since = STEP * np.maximum(elapsed, 0.0)
        # integral of 1 - exp(-since / lag)
        self.ramps = np.diff(since + lags * np.expm1(-since / lags)) / STEP
        self.thrust = thrust = samples.thrust(lag, *curve)
        # free columns: a bias, damping and the gyroscopic moment
        free = [[np.ones(count), w[i], w[i - 2] * w[i - 1]] for i in range(3)]
        # a gyro askew by a few degrees shows a part of the strong axes' motion about the weak one
        free[2].extend(turning[:2])
        # each channel's moment, free columns and measurement
        columns = [
            np.array([thrust @ signs, *own, y])
            for signs, own, y in zip(
                SIGNS, [*free, []], [*turning, samples.specific_force], strict=True
            )
        ]
        away = np.abs(thrust - np.median(thrust, axis=0)).mean(axis=1)
        away += _TURNING * (w**2).sum(axis=0) + samples.between
        # at the start of a fault the error of its shape grows with the acceleration
        strong = maximum_filter1d(np.linalg.norm(turning[:2], axis=0), _AROUND)
        away += strong / max(strong.max(), 1e-300)
        activity = maximum_filter1d(away, 2)  # a rotor late by an interval is wrong there too
        nothing: list[float] = []
        self.share = np.zeros(count)  # of no jump, and then of the likeliest beside the noise
        for _ in range(3):
            self.channels = [
                _BalanceChannel(x, activity, samples.whole, self.share) for x in columns
            ]
            nothing.append(sum(channel.nothing for channel in self.channels))
            k = BEFORE + int(np.argmax(self.steps(self.rows, self.ramps[:1])))
            begin = max(k - 2, BEFORE)
            logs = self.steps(slice(begin, min(k + 3, self.rows.stop)), self.ramps)
            self.log = logs.max()
            ramp, more = np.unravel_index(np.argmax(logs), logs.shape)
            parts = np.zeros(begin + more), self.ramps[ramp], np.ones(count)
            self.share = np.concatenate(parts)[:count]
        self.nothing = max(nothing[0], nothing[-1])

    def steps(self, rows: slice, ramps: Array) -> Array:
        """Return the log-likelihoods (R, K) of a jump by each ramp, beginning at each of rows."""
        return np.array([sum(c.steps(rows, ramp) for c in self.channels) for ramp in ramps])


class _BalanceChannel:
    """A channel's moment, free columns and measurement as innovations of the noise.

    Args:
        columns: (c, N) these, in this order.
        activity: (N,) relative deviation of the rotors from the mean.
        whole: (N,) the ``ORDER`` samples before are there, without a gap.
        step: (N,) a further column in the fit of the noise.
    """

    def __init__(self, columns: Array, activity: Array, whole: Mask, step: Array) -> None:
        from scipy.signal import lfilter  # as late as can be: it takes .6 s

        y, x = columns[-1], np.vstack([columns[:-1], step])
        moment = np.linalg.lstsq(x.T, y, rcond=None)[0][0]
        x = x[int(moment <= 0.0) :]  # a moment with a negative factor is left out
        residual = y - np.linalg.lstsq(x.T, y, rcond=None)[0] @ x
        weights = 1.0 / np.hypot(1.0, np.outer(SHARES, activity))
        fits = [_fit_noise(residual, weight, whole) for weight in weights]
        _, self.variance, whitener, self.weight = max(fits, key=itemgetter(0))
        self.filtered, self.whole = partial(lfilter, whitener, 1.0), whole
        self.white = self._innovations(columns)
        directions, r = np.linalg.qr(self.white.T)
        # the last direction is the measurement, less all columns
        directions[:, -1] *= r[-1, -1]
        self.rest = r[-1, -1] ** 2
        self.nothing = _log_likelihood(self.rest, self.weight[whole])
        # products of an impulse in each row with all directions: the filter runs backwards. A step
        # is a row of impulses. Behind them the sum of squares of a step since ever
        products = self.filtered(directions.T[:, ::-1]) * self.weight[::-1]
        squares = (self._innovations(np.ones(len(whole))) ** 2)[::-1]
        sums = np.vstack([products, squares]).cumsum(axis=1)[:, ::-1]
        self.from_row_on = np.vstack([sums, self.weight, whole])

    def _innovations(self, values: Array) -> Array:
        """Return the innovations (..., N) of values; zero outside ``whole``."""
        return np.asarray(self.filtered(values * self.weight) * self.whole)

    def part(self, column: Array) -> tuple[float, float]:
        """Return the ratio, negative, of the factors of a column (N,) and of the moment, and its
        standard deviation: infinite where the channel does not follow the commands.
        """
        x, y = np.vstack([self._innovations(column), self.white[:-1]]), self.white[-1]
        inverse = np.linalg.pinv(x)
        factor, moment = (beta := y @ inverse)[:2].tolist()
        noise = np.linalg.norm(y - beta @ x) / math.sqrt(self.whole.sum() - len(beta))
        if moment <= 2.0 * noise * np.linalg.norm(inverse[:, 1]):
            return 0.0, math.inf
        ratio = factor / moment
        spread = np.linalg.norm(inverse[:, 0] - ratio * inverse[:, 1])
        return -ratio, float(noise * spread / moment)

    def steps(self, rows: slice, ramp: Array) -> Array:
        """Return the log-likelihoods (K,) of a step beginning at each of ``rows`` by a ramp.

        The size is the best one, at the price of a normal prior: as wide as this size, or as wide
        as a single sample's if wider.
        """
        # until a share of 1 fills the filter's memory
        begun = np.append(ramp, np.ones(ORDER + 1))
        padded = np.pad(self.from_row_on, [(0, 0), (0, len(begun))])
        windows = sliding_window_view(padded, len(begun), axis=1)[:, rows]
        *known, own = windows[:-3] @ np.diff(begun, prepend=0.0)
        squares, weight, whole = windows[-3:]
        outputs = whole * self.filtered(begun * weight)
        square = (outputs[:, :-1] ** 2).sum(axis=1) + squares[:, -1]
        left = square - np.square(known).sum(axis=0)
        gain = own**2 / np.maximum(left, 1e-12 * square + 1e-300)
        width = 1.0 + np.log(np.maximum(gain / self.variance, 1.0))
        price = 0.5 * np.maximum(width, math.log(self.whole.sum()))
        return np.asarray(_log_likelihood(self.rest - gain, self.weight[self.whole]) - price)


def _fit_noise(residual: Array, weight: Array, whole: Mask) -> tuple[Any, float, Array, Array]:
    """Fit an autoregression to a residual (N,) with weights (N,).

    Returns:
        The log-likelihood, the variance of the innovations, the filter (p + 1,) with them as its
        output, and the weights.
    """
    windows = sliding_window_view(residual * weight, ORDER + 1)[whole[ORDER:], ::-1]
    gram = windows.T @ windows
    ridge = _RIDGE * gram[0, 0] * np.eye(ORDER)
    poles = np.linalg.solve(gram[1:, 1:] + ridge, gram[1:, 0])
    rest = ((windows @ (whitener := np.append(1.0, -poles))) ** 2).sum()
    return _log_likelihood(rest, weight[whole]), rest / len(windows), whitener, weight


def _log_likelihood(rest: Any, weight: Array) -> Any:
    """Return the log-likelihood of innovations of ``weight`` (n,) with ``rest`` as the sum of
    squares, at the best variance.
    """
    n = len(weight)
    return np.log(weight).sum() - 0.5 * n * np.log(np.maximum(rest, 1e-300) / n)
