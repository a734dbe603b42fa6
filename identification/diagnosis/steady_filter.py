"""The steady Kalman filter of a pose near level flight, from the noise of its six axes.

The axes are the world's: position along them, and turns about them. The states of an axis are its
pose, the pose's rate, and a disturbance: an Ornstein-Uhlenbeck acceleration. A white acceleration
beside it stands for the rotors' rounding, and for any other change from sample to sample. A pitch
pulls the vehicle along x and a roll against y: x and pitch are one filter, y and roll another,
whatever the yaw. Up and yaw are a pair without a link.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..logs.table import Array

PAIRS = np.array([[0, 4], [1, 3], [2, 5]])  # a position, and the turn pulling it
# (6, 3) whether an axis is of a pair
OWN = np.equal(np.arange(6)[:, None, None], PAIRS).any(axis=2)
_LAST = [2, 5]  # the disturbances among the states of a pair
PULL = np.array([1.0, -1.0, 0.0])  # of a turn on its position's acceleration, over gravity


@dataclass(frozen=True, eq=False)
class PoseNoise:
    """The noise of the axes (..., 6). Units: m or rad, and s."""

    pose: Array  # standard deviation of one sample
    disturbance: Array  # standard deviation, an acceleration
    time: Array  # s, correlation time
    white: Array  # standard deviation of an acceleration over one period


@dataclass(frozen=True, eq=False)
class SteadyFilter:
    """A filter of a pose, or several of them.

    Attributes:
        gain: (..., 6, 3, 2) of pose, rate and disturbance of each axis, per unit of its own
            innovation and of its partner's.
        keep: (..., 6) share of a disturbance left after a period.
        covariance: (..., 6, 6) of the innovations.
    """

    gain: Array
    keep: Array
    covariance: Array

    @cached_property
    def whitening(self) -> Array:
        """The inverse (6, 6) of the root of the covariance, a lower triangle."""
        return np.linalg.inv(np.linalg.cholesky(self.covariance))


def steady_filter(noise: PoseNoise, period: float, gravity: float) -> SteadyFilter:
    """Return the steady filter of poses, every ``period`` s, with this noise."""
    keep = np.exp(-period / noise.time)
    # in units of the pose's noise and of a period
    pose = noise.pose[..., PAIRS]
    decay = keep[..., PAIRS]
    unit = period * period / pose
    half = np.array([0.5, 1.0, 0.0])
    white = np.square(noise.white[..., PAIRS] * unit)
    Q = np.repeat(white, 3, axis=-1)[..., None] * np.kron(np.eye(2), np.outer(half, half))
    Q[..., _LAST, _LAST] = np.square(noise.disturbance[..., PAIRS] * unit) * (1.0 - decay**2)
    F = np.zeros_like(Q) + np.kron(np.eye(2), [[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    F[..., _LAST, _LAST] = decay
    pull = gravity * PULL * unit[..., 0] * pose[..., 1]
    F[..., :3, 3:6] = pull[..., None, None] * np.outer(half, [1.0, 0.5, 0.0])
    P = _riccati(F, Q)
    S = P[..., ::3, ::3] + np.eye(2)
    K = P[..., ::3] @ np.linalg.inv(S)
    one, other = pose[..., :, None], pose[..., None, :]
    units = period ** -np.arange(3.0)
    gain = K.reshape(*pose.shape, 3, 2) * (one / other)[..., None, :] * units[:, None]
    gain[..., 1, :, :] = gain[..., 1, :, ::-1].copy()  # its own first
    gain = gain.reshape(*keep.shape, 3, 2).take(np.argsort(PAIRS.ravel()), axis=-3)
    covariance = np.zeros((*keep.shape, 6))
    covariance[..., PAIRS[:, :, None], PAIRS[:, None]] = S * one * other
    return SteadyFilter(gain, keep, covariance)


def _riccati(F: Array, Q: Array) -> Array:
    """Return the steady covariance of the prediction, for poses with unit noise, by doubling
    (B. D. O. Anderson, International Journal of Control 28 (1978), 295-306).
    """
    A = np.swapaxes(F, -1, -2)
    X = Q
    G = np.broadcast_to(np.diag([1.0, 0.0, 0.0] * 2), F.shape)
    for _ in range(40):
        W = np.linalg.inv(np.eye(F.shape[-1]) + G @ X)
        transposed = np.swapaxes(A, -1, -2)
        further = transposed @ X @ W @ A
        G = G + A @ W @ G @ transposed
        A = A @ W @ A
        X = X + further
        if np.abs(further).max() <= 1e-10 * np.abs(X).max():
            break
    return X
