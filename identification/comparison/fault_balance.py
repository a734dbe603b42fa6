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

import numpy as np

from ...runtime.arrays import Array, Index, Mask
from .fault_channels import STEP, Samples
from .fault_noise import fit_noise

# signs of the rotors' moments about x, y, z; the last row is the force along z
_SIGNS: Array = np.array([[1.0, 1, -1, -1], [-1, 1, 1, -1], [1, -1, 1, -1], [1, 1, 1, 1]])
PARTS = (0.0, 0.25, 0.5, 0.75)  # starts of a fault within an interval
_AROUND = 5  # intervals around a strong acceleration: the model may be as wrong there
_TURNING = 0.1  # activity per (rad/s)^2: the model's error while the vehicle turns


class FaultBalance:
    """The four channels with one lag and one curve of the rotors (N samples).

    Attributes:
        channels: with the noise of the last fit.
        ramps: elapsed shares (J,) of a loss in each interval; 1 afterwards. A loss begins within an
            interval, at once (a propeller that breaks) or as the rotors' speed falls (a motor).
    """

    def __init__(self, samples: Samples, lag: float, bend: float, dead: float) -> None:
        from scipy.ndimage import maximum_filter1d  # as late as can be: it takes .1 s

        w = samples.angular_velocity
        turning = samples.angular_acceleration
        self.follows = samples.follows
        self.thrust = thrust = samples.thrust(lag, bend, dead)  # (N, 4)
        self.ramps = [_ramp(part, late) for late in (0.0, lag) for part in PARTS]
        gyroscopic = np.roll(w, -1, axis=1) * np.roll(w, 1, axis=1)
        free = [[np.ones(len(w)), *own] for own in zip(w.T, gyroscopic.T, strict=True)]
        # a gyro askew by a few degrees shows a part of the strong axes' motion about the weak one
        free[2].extend(turning.T[:2])
        free.append([])
        # each channel's measurement, moment and free columns
        self.columns = [
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
        self.activity = np.maximum(away, np.append(away[:1], away[:-1]))
        self.fit()

    def fit(self, *step: Array) -> None:
        """Fit the channels' noise to the residual of no change, or beside a ``step`` (N,)."""
        self.channels = [
            _BalanceChannel(columns, self.activity, self.follows, *step) for columns in self.columns
        ]

    def nothing(self) -> float:
        """Return the log-likelihood where nothing happens."""
        return sum(channel.nothing for channel in self.channels)

    def steps(self, rows: Index, ramps: list[Array]) -> Array:
        """Return the log-likelihoods (R, K) of a jump by each ramp, beginning at each of rows."""
        return np.array([sum(c.steps(rows, ramp) for c in self.channels) for ramp in ramps])

    def share(self, row: int, ramp: int) -> Array:
        """Return the elapsed share (N,) of a change beginning at a row, by one of the ramps."""
        count = len(self.thrust)
        return np.concatenate([np.zeros(row), self.ramps[ramp], np.ones(count)])[:count]

    def lost(self, rotor: int, share: Array) -> Array:
        """Return each channel's loss (N, 4) if a ``share`` (N,) of rotor 0 to 3 goes."""
        return (self.thrust[:, rotor] * share)[:, None] * _SIGNS[:, rotor]


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
        beta = np.linalg.lstsq(x, y, rcond=None)[0]
        if beta[0] <= 0.0:  # a moment with a negative factor is left out
            x = x[:, 1:]
            beta = np.linalg.lstsq(x, y, rcond=None)[0]
        self.noise = noise = fit_noise(y - x @ beta, activity, follows)
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
        count = len(noise.whole)
        # behind the last row nothing happens
        whole = np.append(noise.whole, False)
        scale = np.append(noise.scale, np.inf)
        against = np.zeros((count + 1, 2 + self.basis.shape[1]))
        against[whole] = np.column_stack([self.both, self.basis])
        # a share of 1 from each row on: its products with y, the moment, the basis, and itself
        full = whole * np.append(noise.filtered(np.ones(count)), 0.0)
        late = np.column_stack([full[:, None] * against, full**2])
        # before them the first outputs of the filter after each beginning, during the ramp
        early = len(noise.filter) - 1 + len(ramp)
        at = np.minimum(rows[:, None] + np.arange(early + 1), count)
        sums = np.cumsum(late[::-1], axis=0)[::-1][at[:, -1]]
        at = at[:, :-1]
        begun = 1.0 / scale[at]
        begun[:, : len(ramp)] *= ramp
        values = lfilter(noise.filter, 1.0, begun) * whole[at]
        sums[:, :-1] += np.einsum("kj,kjq->kq", values, against[at])
        sy, sm, ss = sums[:, [0, 1, -1]].T
        ss = ss + np.square(values).sum(axis=1) - np.square(sums[:, 2:-1]).sum(axis=1)
        own_share = np.maximum(ss - sm * sm / self.mm, 1e-12 * ss + 1e-300)
        gain = np.square(sy - sm * self.my / self.mm) / own_share
        width = 1.0 + np.log(np.maximum(gain / noise.variance, 1.0))
        price = 0.5 * np.maximum(width, math.log(noise.whole.sum()))
        return np.asarray(noise.log_likelihood(self.rest - gain) - price)
