"""The inner loop of the trackers: how likely each particle makes what the filter shows."""

import math

import numpy as np

from ..dynamics.motion import Array
from ..runtime.compiled import compiled
from .jet_map import AXES, COUNT, FIRST, STEP
from .wrench_lag import ORDER

# a particle's memory: the jet's mean that it felt last, the filter's error, residuals, newest first
FELT, ERROR, PAST = 0, AXES, 4 * AXES
MEMORY = 4 * AXES + ORDER * AXES
_SMALLEST = 1e-12  # variance of particles of a kind


@compiled
def weigh(
    place: Array,
    level: Array,
    memory: Array,
    own: float,
    motion: Array,
    seen: Array,
    tables: Array,
    keep: Array,
    enter: Array,
    regression: Array,
    variance: Array,
    first: bool,
    out: Array,
) -> None:
    """Write the log-likelihood of an observation for each particle into ``out`` (n,), and carry
    its memory on.

    Args:
        place: (n,) m, of the fan.
        level: (n,) of the noise, 1: as expected.
        memory: (n, MEMORY).
        own: m, place of the vehicle.
        motion: (2,) its own velocity in m/s and its yaw rate in rad/s.
        seen: (AXES,) the estimated torque and forces.
        tables: (COUNT, 4, AXES) over the offset: mean, slopes with velocity and yaw rate, standard
            deviation.
        keep: (AXES, 3, 3), of the filter's error.
        enter: (AXES, 3).
        regression: (AXES, ORDER) of the residual, in standard deviations, on those before.
        variance: (AXES,) of what they leave.
        first: whether the filter has settled on the jet where it is now.
        out: (n,).
    """
    for i in range(len(place)):
        m = memory[i]
        column = (own - place[i] - FIRST) / STEP
        column = min(max(column, 0.0), COUNT - 1.001)
        j = int(column)
        b = column - j
        left, right = tables[j], tables[j + 1]
        total = 0.0
        for a in range(AXES):
            mean = (1 - b) * left[0, a] + b * right[0, a]
            mean += motion[0] * ((1 - b) * left[1, a] + b * right[1, a])
            turning = motion[1] * ((1 - b) * left[2, a] + b * right[2, a])
            deviation = level[i] * ((1 - b) * left[3, a] + b * right[3, a])
            e = ERROR + 3 * a
            if first:
                m[e] = m[e + 1] = m[e + 2] = 0.0
            else:
                change = mean - m[FELT + a]
                e0, e1, e2 = m[e], m[e + 1], m[e + 2]
                for k in range(3):
                    m[e + k] = (
                        keep[a, k, 0] * e0
                        + keep[a, k, 1] * e1
                        + keep[a, k, 2] * e2
                        + enter[a, k] * change
                    )
            m[FELT + a] = mean
            residual = (seen[a] - turning - mean + m[e + 2]) / deviation
            p = PAST + ORDER * a
            innovation = residual
            for k in range(ORDER):
                innovation -= regression[a, k] * m[p + k]
            for k in range(ORDER - 1, 0, -1):
                m[p + k] = m[p + k - 1]
            m[p] = residual
            total -= 0.5 * innovation * innovation / variance[a] + math.log(deviation)
        out[i] = total


@compiled
def resample(weights: Array, shift: float, chosen: np.ndarray) -> None:
    """Write which particle each place is given to into ``chosen`` (n,), systematically: ``shift``
    in [0, 1).
    """
    n, i = len(weights), 0
    reached = weights[0]
    for k in range(n):
        level = (k + shift) / n
        while level > reached and i < n - 1:
            i += 1
            reached += weights[i]
        chosen[k] = i


@compiled
def respread(
    motion: Array,
    kind: np.ndarray,
    sign: Array,
    side: Array,
    free: np.ndarray,
    kinds: int,
    fewest: int,
    spread: float,
    noise: Array,
    low: Array,
    high: Array,
) -> None:
    """Shrink particles of a kind of motion towards their mean and spread them again, in place, so
    that mean and covariance stay; speed and offset count with the sign that they are flown with.

    Args:
        motion: (n, 3) speed, travel and offset.
        kind: (n,) of each, below ``kinds``.
        sign: (n,) of the speed.
        side: (n,) sign of the offset.
        free: (n,) those that stay as they are.
        kinds: how many there are.
        fewest: particles of a kind that are spread.
        spread: share of their standard deviation.
        noise: (n, 3) standard normal.
        low: (3,) bounds at which they are reflected.
        high: (3,).
    """
    n = len(motion)
    keep = math.sqrt(1.0 - spread * spread)
    count = np.zeros(kinds)
    mean, root = np.zeros((kinds, 3)), np.zeros((kinds, 3, 3))
    for i in range(n):
        motion[i, 2] *= side[i]
        if not free[i]:
            motion[i, 0] *= sign[i]
            count[kind[i]] += 1.0
            for a in range(3):
                mean[kind[i], a] += motion[i, a]
    for k in range(kinds):
        if count[k] > 0.0:
            mean[k] /= count[k]
    for i in range(n):
        if not free[i]:
            k = kind[i]
            for a in range(3):
                for b in range(a + 1):
                    root[k, a, b] += (motion[i, a] - mean[k, a]) * (motion[i, b] - mean[k, b])
    for k in range(kinds):
        if count[k] >= fewest:
            _factorise(root[k], count[k])
    for i in range(n):
        if not free[i]:
            k = kind[i]
            if count[k] >= fewest:
                for a in range(3):
                    drawn = 0.0
                    for b in range(a + 1):
                        drawn += noise[i, b] * root[k, a, b]
                    apart = motion[i, a] - mean[k, a]
                    motion[i, a] = mean[k, a] + keep * apart + spread * drawn
                sign[i] = -1.0 if motion[i, 0] < 0.0 else 1.0
            motion[i, 0] = abs(motion[i, 0])
        side[i] = -1.0 if motion[i, 2] < 0.0 else 1.0
        motion[i, 2] = abs(motion[i, 2])
        for a in range(3):
            x = motion[i, a]
            x = 2.0 * high[a] - x if x > high[a] else x
            x = 2.0 * low[a] - x if x < low[a] else x
            motion[i, a] = min(max(x, low[a]), high[a])


@compiled
def _factorise(sums: Array, count: float) -> None:
    """Replace the lower half of sums of products (3, 3) by the Cholesky factor of the covariance,
    which is made at least the smallest.
    """
    for a in range(3):
        for b in range(a + 1):
            left = sums[a, b] / count + (_SMALLEST if a == b else 0.0)
            for c in range(b):
                left -= sums[a, c] * sums[b, c]
            sums[a, b] = math.sqrt(left) if a == b else left / sums[b, b]
