"""The steady Kalman filter of one axis of the pose, and the disturbance that makes its innovations
likeliest.

The states of an axis are its pose, the pose's rate, and a disturbance: an Ornstein-Uhlenbeck
acceleration with a standard deviation and a correlation time. The rotors' rounding, and whatever
else changes from sample to sample, is a white acceleration beside it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ...runtime.compiled import compiled, compiled_for_vectors

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AxisSettings:
    """Where the likeliest disturbance of an axis is searched for."""

    settling_time: float = 1.0  # s, from the start of a piece to the first innovation that counts
    first_time: float = 0.4  # s, correlation time at which a search begins
    # s, correlation times: gusts last 0.1 to 2 s; what lasts longer is no disturbance
    times: tuple[float, float] = (0.03, 2.0)


AXIS = AxisSettings()


@dataclass(frozen=True)
class AxisNoise:
    """The noise of one axis. Units: m or rad, and s."""

    pose: float  # standard deviation of one sample
    disturbance: float  # standard deviation, an acceleration
    time: float  # s, correlation time
    white: float  # standard deviation of an acceleration that lasts one period
    innovation: float  # standard deviation of an innovation
    gain: tuple[float, float, float]  # of pose, rate and disturbance, per unit of innovation


@compiled
def steady(strength: float, time: float, white: float, period: float, gain: Array) -> float:
    """Write the gain (3,) of the steady filter; return the innovations' variance over the pose's.

    ``strength`` and ``white`` are variances of accelerations over that of the pose's noise.
    """
    keep = math.exp(-period / time)
    half = 0.5 * period * period
    p00, p01, p02, p11, p12, p22 = 1.0, 0.0, 0.0, 1.0, 0.0, strength
    last = 0.0
    variance = 2.0
    for _ in range(4000):
        # F P F' with F = [[1, T, T2/2], [0, 1, T], [0, 0, keep]], and the noise of a period
        a0 = p00 + period * p01 + half * p02
        a1 = p01 + period * p11 + half * p12
        a2 = p02 + period * p12 + half * p22
        b1 = p11 + period * p12
        b2 = p12 + period * p22
        n00 = a0 + period * a1 + half * a2 + white * half * half
        n01 = a1 + period * a2 + white * half * period
        n02 = keep * a2
        n11 = b1 + period * b2 + white * period * period
        n12 = keep * b2
        n22 = keep * keep * p22 + strength * (1.0 - keep * keep)
        variance = n00 + 1.0
        gain[0], gain[1], gain[2] = n00 / variance, n01 / variance, n02 / variance
        p00 = n00 - gain[0] * n00
        p01 = n01 - gain[0] * n01
        p02 = n02 - gain[0] * n02
        p11 = n11 - gain[1] * n01
        p12 = n12 - gain[1] * n02
        p22 = n22 - gain[2] * n02
        if abs(variance - last) < 1e-9 * variance:
            break
        last = variance
    return variance


@compiled_for_vectors
def _products(
    measured: Array,
    drive: Array,
    rate: float,
    jumps: Array,
    jump_state: np.ndarray,
    keep: float,
    period: float,
    gain: Array,
    skip: int,
    out: Array,
) -> None:
    """Add to ``out`` (c + 1, c + 1) the products of what ``jumps`` (n, c) change in the predictions
    of one axis' pose, and of its innovations (last), from sample ``skip`` on.

    ``jump_state`` (c,) says which state a unit of each adds to before the pose of sample k is read:
    0 the pose, 1 its rate, 2 the disturbance.
    """
    c = jumps.shape[1]
    state, row = np.zeros((3, c + 1)), np.empty(c + 1)
    state[0, c], state[1, c] = measured[0], rate
    half = 0.5 * period * period
    for k in range(1, len(measured)):
        a = drive[k - 1]
        for j in range(c + 1):
            g = state[2, j] + (a if j == c else 0.0)
            state[0, j] += period * state[1, j] + half * g
            state[1, j] += period * g
            state[2, j] *= keep
        for j in range(c):
            state[jump_state[j], j] += jumps[k, j]
        for j in range(c):
            row[j] = state[0, j]
        row[c] = measured[k] - state[0, c]
        for j in range(c):
            state[0, j] -= gain[0] * row[j]
            state[1, j] -= gain[1] * row[j]
            state[2, j] -= gain[2] * row[j]
        state[0, c] += gain[0] * row[c]
        state[1, c] += gain[1] * row[c]
        state[2, c] += gain[2] * row[c]
        if k >= skip:
            for i in range(c + 1):
                for j in range(c + 1):
                    out[i, j] += row[i] * row[j]


def likeliest_noise(
    measured: Sequence[Array],
    drive: Sequence[Array],
    rate: Sequence[float],
    period: float,
    white: float,
    pose: float,
    disturbance: float,
    jumps: Sequence[Array],
    jump_state: NDArray[np.intp],
    time: float | None = None,
) -> tuple[AxisNoise, Array]:
    """Return the noise of one axis at maximum likelihood, and the gains (c,) of the jumps beside
    it.

    Args:
        measured: pose of each piece (n,), m or rad.
        drive: acceleration (n,) that the model says acts from each sample to the next.
        rate: the pose's rate at the start of each piece.
        period: s.
        white: standard deviation of the white acceleration that is known: the rotors' rounding.
        pose: standard deviation of the pose at which the search begins.
        disturbance: that of the disturbance.
        jumps: (n, c) of each piece, what a unit of each gain adds to the state before the pose of
            sample k is read. What else is known of a disturbance leaves less of it to the pose.
        jump_state: (c,) the state: 0 the pose, 1 its rate, 2 the disturbance.
        time: s, correlation time of the disturbance at which the search begins, where the noise is
            roughly known; default: it is not.
    """
    skip = round(AXIS.settling_time / period)
    count = max(sum(len(x) - skip for x in measured), 1)
    gain = np.empty(3)

    def sums(strength: float, time: float, shaken: float) -> tuple[float, Array]:
        steady(strength, time, shaken, period, gain)
        keep = math.exp(-period / time)
        total = np.zeros((len(jump_state) + 1,) * 2)
        for y, a, v, x in zip(measured, drive, rate, jumps, strict=True):
            _products(y, a, v, x, jump_state, keep, period, gain, skip, total)
        # against gains that do the same
        normal = total[:-1, :-1] + 1e-9 * np.diag(np.diagonal(total)[:-1] + 1e-300)
        gains: Array = np.asarray(np.linalg.solve(normal, total[:-1, -1]))
        return float(total[-1, -1] - total[-1, :-1] @ gains), gains

    def loss(x: Array) -> float:
        inside = np.clip(x, low, high)
        beyond = float(np.abs(x - inside).sum())
        return count * (math.log(max(sums(*np.exp(inside).tolist())[0], 1e-300)) + beyond)

    begun = np.array(
        [
            2.0 * math.log(disturbance / pose),
            math.log(time or AXIS.first_time),
            2.0 * math.log(max(white, 1e-3 * disturbance) / pose),
        ]
    )
    low, high = begun - 16.0, begun + 16.0
    low[1], high[1] = np.log(AXIS.times)
    begun = np.clip(begun, low, high)
    best = minimize(
        loss,
        begun,
        method="Nelder-Mead",
        options={
            "initial_simplex": begun
            + (0.7 if time else 2.0)
            * np.vstack([np.zeros(3), np.diag(np.where(begun >= high, -1.0, 1.0))]),
            # a white noise that is far below the rest has no likeliest value
            "xatol": 0.3,
            "fatol": 0.2,  # nats
            "maxfev": 160,
        },
    )
    strength, lasting, shaken = np.exp(np.clip(best.x, low, high)).tolist()
    left, gains = sums(strength, lasting, shaken)
    innovation = math.sqrt(left / count)
    noise = innovation / math.sqrt(steady(strength, lasting, shaken, period, gain))
    found = steady_noise(
        noise, noise * math.sqrt(strength), lasting, noise * math.sqrt(shaken), period
    )
    return found, gains


def steady_noise(
    pose: float, disturbance: float, time: float, white: float, period: float
) -> AxisNoise:
    """Return the noise of an axis with these standard deviations and correlation time."""
    gain = np.empty(3)
    ratio = steady((disturbance / pose) ** 2, time, (white / pose) ** 2, period, gain)
    innovation = pose * math.sqrt(ratio)
    gains = (float(gain[0]), float(gain[1]), float(gain[2]))
    return AxisNoise(pose, disturbance, time, white, innovation, gains)
