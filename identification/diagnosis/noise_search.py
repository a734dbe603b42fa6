"""The likeliest noise of a flight's pose, by Fisher's method of scoring.

The search is over four numbers of each axis, and over linear gains beside them: the gains on other
signals of the axis' states than the pose.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..logs.table import Array, ArrayPair
from .evidence import bounded_mode
from .steady_filter import PAIRS, PoseNoise, SteadyFilter, steady_filter

SETTLING_TIME = 1.0  # s, from the start of a piece to the first innovation in the likelihood
FIRST_TIME = 0.4  # s, correlation time at the start of a search
# s, correlation times: gusts last 0.1 to 2 s; a longer force is no disturbance
TIMES = (0.03, 2.0)
TOLERANCE = 0.1  # nats, by which the last step of the search changes the likelihood
STEPS = 20  # of the search, at most
# growth of the information's diagonal for the first step. For 15 flights and a hundredth of this
# share, the search ended 9 and 17 nats short on two; ten times the share took a fifth more steps
DAMPING = 0.1
STEP = 1e-4  # of the searched numbers, for derivatives
LEAST_POSE = 1e-9  # m and rad: below the last digit of any log
SEARCHED = 24  # numbers of the noise: four of each axis


@dataclass(frozen=True, eq=False)
class NoiseSearch:
    """A search.

    Attributes:
        see: returns the innovations (n, 6) of the flights through a filter with gains (3, e) of
            each pair.
        products: returns sums of products (c + 1, c + 1) for the filter of the last ``see``. The
            columns are whitened changes of the predictions: by the 3 e gains of each pair in turn,
            and by slopes (6, 7, m) of the filter's gains and ``keep``. The innovations stand last.
        held: (e,) standard deviations of the gains' prior. Without it nearly predicted rotor speeds
            would have unlimited gains.
        period: s.
        gravity: m/s2.
    """

    see: Callable[[SteadyFilter, Array], Array]
    products: Callable[[Array], Array]
    held: Array
    period: float
    gravity: float

    @np.errstate(over="ignore", invalid="ignore")  # a filter that diverges has no mode: an error
    def likeliest(self, near: PoseNoise, gains: Array) -> tuple[PoseNoise, Array]:
        """Return the noise and the gains (3, e) at maximum likelihood, by damped steps.

        Args:
            near: the noise at the start of the search.
            gains: (3, e) at its start.
        """
        x = _free(near)
        ends = np.array([x - 16.0, x + 16.0])
        ends[0, :, 0] = math.log(LEAST_POSE)
        ends[:, :, 2:] = np.transpose([np.log(TIMES), [0.0, 1e4]])[:, None]
        none = np.full(gains.size, np.inf)
        low, high = np.hstack([[-none, none], ends.reshape(2, -1)])
        at = np.clip(np.append(gains, x), low, high)
        height, seen = self._height(at)
        normal, right = self._slopes(at, seen)
        damping = DAMPING
        for _ in range(STEPS):
            damped = normal + np.diag(damping * np.diagonal(normal) + 1e-9)
            step = bounded_mode(damped, right, low - at, high - at)
            if 0.5 * right @ step < TOLERANCE:
                break
            there, seen = self._height(at + step)
            better = there < height
            damping *= 0.2 if better else 8.0
            if better:
                at = at + step
                height = there
                normal, right = self._slopes(at, seen)
        return _noise(at), self._gains(at)

    def _gains(self, at: Array) -> Array:
        return at[:-SEARCHED].reshape(len(PAIRS), -1)

    def _filter(self, at: Array) -> SteadyFilter:
        return steady_filter(_noise(at), self.period, self.gravity)

    def _height(self, at: Array) -> tuple[float, Array]:
        """Return minus the logarithm of the likelihood and the prior, up to a constant, and the
        innovations (n, 6).
        """
        steady = self._filter(at)
        seen = self.see(steady, self._gains(at))
        square = np.trace(np.linalg.solve(steady.covariance, seen.T @ seen))
        square += np.square(self._gains(at) / self.held).sum()
        size = np.linalg.slogdet(steady.covariance)[1]
        return float(0.5 * (square + len(seen) * size)), seen

    def _slopes(self, at: Array, seen: Array) -> ArrayPair:
        """Return Fisher's information (c, c), and minus the height's gradient (c,), at the
        innovations ``seen`` last. The filter's derivatives are differences.
        """
        steady = self._filter(at)
        there = self._filter(at + STEP * np.eye(len(at))[-SEARCHED:])
        gain = (there.gain - steady.gain).reshape(SEARCHED, 6, 6)
        slopes = np.concatenate([gain, (there.keep - steady.keep)[..., None]], axis=2) / STEP
        change = (there.covariance - steady.covariance) / STEP  # (m, 6, 6)
        whole = self.products(np.moveaxis(slopes, 0, -1))
        normal = whole[:-1, :-1]
        right = whole[:-1, -1]
        prior = np.append(np.tile(self.held**-2, len(PAIRS)), np.zeros(SEARCHED))
        normal += np.diag(prior)
        right -= prior * at
        # by the innovations' covariance
        share = np.linalg.solve(steady.covariance, change)  # (m, 6, 6)
        left = np.linalg.solve(steady.covariance, seen.T @ seen) - len(seen) * np.eye(6)
        normal[-SEARCHED:, -SEARCHED:] += 0.5 * len(seen) * np.einsum("mij,lji->ml", share, share)
        right[-SEARCHED:] += 0.5 * np.einsum("mij,ji->m", share, left)
        return normal, right


def _free(noise: PoseNoise) -> Array:
    """Return the searched numbers of a noise (6, 4): logarithms of the pose's standard deviation,
    the disturbance's and its correlation time, and the ratio of the variances of the white
    acceleration and the disturbance.
    """
    logs = [np.log(x) for x in (noise.pose, noise.disturbance, noise.time)]
    return np.stack([*logs, np.square(noise.white / noise.disturbance)], axis=-1)


def _noise(at: Array) -> PoseNoise:
    """Return the noise whose searched numbers are the last of each row (..., c)."""
    pose, disturbance, time, share = np.moveaxis(
        at[..., -SEARCHED:].reshape(*at.shape[:-1], 6, 4), -1, 0
    )
    white = np.exp(disturbance) * np.sqrt(share)
    return PoseNoise(np.exp(pose), np.exp(disturbance), np.exp(time), white)
