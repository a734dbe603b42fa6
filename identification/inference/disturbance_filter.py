"""Disturbances as the sensors of a flight show them: a steady Kalman filter of one axis, its
innovations, and the disturbance's likelihood.

A sensor measures a disturbance's acceleration integrated twice (a pose), once (a gyro, which shows
that of an angular acceleration), or as it is (an accelerometer).
A disturbance is an Ornstein-Uhlenbeck acceleration with a strength and a correlation time: those
that minimise the innovations.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import lfilter, ss2tf

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DisturbanceSettings:
    """The grid of disturbances on which the likeliest is searched for."""

    # variances of the disturbance (acceleration squared) over that of the pose's noise
    strengths: Array = field(
        default_factory=lambda: np.asarray(2.0 ** np.arange(-10, 47), dtype=np.float64)
    )
    # s, correlation times
    times: Array = field(
        default_factory=lambda: np.asarray(0.25 * 1.5 ** np.arange(-6, 6), dtype=np.float64)
    )
    first_point: tuple[int, int] = (24, 6)  # of the grid, where the search begins
    strides: tuple[int, ...] = (4, 2, 1)  # of that search


DISTURBANCE = DisturbanceSettings()


def likeliest_disturbance(loss: Callable[[int, int], float]) -> tuple[int, int]:
    """Return the indices of the strength and correlation time that minimise a loss, by steps to the
    best neighbour, large steps first.
    """
    known = {DISTURBANCE.first_point: loss(*DISTURBANCE.first_point)}
    at = DISTURBANCE.first_point
    for stride in DISTURBANCE.strides:
        while True:
            for i, j in itertools.product((-stride, 0, stride), repeat=2):
                near = (
                    int(np.clip(at[0] + i, 0, len(DISTURBANCE.strengths) - 1)),
                    int(np.clip(at[1] + j, 0, len(DISTURBANCE.times) - 1)),
                )
                if near not in known:
                    known[near] = loss(*near)
            best = min(known, key=known.__getitem__)
            if best == at:
                break
            at = best
    return at


def innovations(
    measured: Array, drive: Array, strength: float, time: float, period: float, integrals: int = 2
) -> Array:
    """Return the innovations (n, c) of what a sensor measured (n, c) of one axis that an
    acceleration (n, c) and a disturbance drive.

    ``strength`` is the disturbance's variance, in the acceleration's unit squared, over that of the
    sensor's noise; ``time`` (s) its correlation time; ``integrals`` how often the sensor's quantity
    is the acceleration integrated: 2 a pose, 1 a gyro, 0 an accelerometer.
    """
    poles, from_pose, from_drive, _ = _filters(strength, time, period, integrals)
    if integrals == 0:
        return np.asarray(lfilter(from_pose, poles, measured - drive, axis=0))
    acting = 0.5 * (drive + np.concatenate([drive[1:], drive[-1:]]))  # until the next pose
    return np.asarray(
        lfilter(from_pose, poles, measured, axis=0) + lfilter(from_drive, poles, acting, axis=0)
    )


def disturbance_variance(
    innovation: float, strength: float, time: float, period: float, integrals: int = 2
) -> float:
    """Return the disturbance's variance, in the acceleration's unit squared, from that of the
    innovations.
    """
    return strength * innovation / _filters(strength, time, period, integrals)[-1]


@lru_cache(maxsize=4096)
def _filters(
    strength: float, time: float, period: float, integrals: int
) -> tuple[Array, Array, Array, float]:
    """Return the denominator and the numerators (integrals + 2,) of the innovations' filters, of
    what is measured and of what drives it.

    Those of the steady Kalman filter with the states (of a pose) pose, velocity (a period) and
    disturbance (a period squared). The last is the innovations' variance over that of the sensor's
    noise.
    """
    rate, n = period / time, integrals + 1
    A = np.eye(n, k=1)
    A[-1, -1] = -rate
    # C. F. Van Loan, IEEE Transactions on Automatic Control 23 (1978): the disturbance over a
    # period
    both = np.zeros((2 * n, 2 * n))
    both[:n, :n], both[n:, n:] = -A, A.T
    both[n - 1, 2 * n - 1] = 2.0 * rate * strength * period ** (2 * integrals)
    both = expm(both)
    F = both[n:, n:].T
    Q = F @ both[:n, n:]
    # what a steady drive adds in a period: 1/2, 1 of a pose and its velocity
    B = np.append(1.0 / np.cumprod(np.arange(1.0, n))[::-1], 0.0)[:, None] * period**integrals
    H = np.eye(1, n)
    P = solve_discrete_are(F.T, H.T, 0.5 * (Q + Q.T), np.eye(1))
    variance = float(P[0, 0] + 1.0)
    K = P @ H.T / variance
    after = F @ (np.eye(n) - K @ H)
    from_pose, poles = ss2tf(after, F @ K, -H, np.eye(1))
    from_drive, _ = ss2tf(after, B, -H, np.zeros((1, 1)))
    return poles, from_pose[0], from_drive[0], variance
