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

from ...runtime.compiled import compiled, compiled_for_vectors
from .evidence import bounded_mode

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AxisSettings:
    """Where the likeliest disturbance of an axis is searched for."""

    settling_time: float = 1.0  # s, from the start of a piece to the first innovation that counts
    first_time: float = 0.4  # s, correlation time at which a search begins
    # s, correlation times: gusts last 0.1 to 2 s; what lasts longer is no disturbance
    times: tuple[float, float] = (0.03, 2.0)
    tolerance: float = 0.02  # nats, by which the last step of the search changes the likelihood


AXIS = AxisSettings()
STEPS = 40  # of the search, at most
STEP = 1e-3  # of what is searched, for derivatives
LEAST_INNOVATION = 1e-9  # m and rad: below the last digit of any log


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
def _respond(
    measured: Array,
    drive: Array,
    rate: float,
    jumps: Array,
    jump_state: np.ndarray,
    gains: Array,
    keep: float,
    period: float,
    gain: Array,
    out: Array,
) -> None:
    """Write to ``out`` (n, c + 5) what changes the predictions of one axis' pose: a unit of each
    of ``gains`` (c,) on ``jumps`` (n, c), of each of the filter's ``gain`` (3,), and of ``keep``;
    and the innovations (last).

    ``jump_state`` (c,) says which state a unit of each adds to before the pose of sample k is read:
    0 the pose, 1 its rate, 2 the disturbance.
    """
    c = jumps.shape[1]
    last = c + 4
    state = np.zeros((3, c + 5))
    state[0, last], state[1, last] = measured[0], rate
    half = 0.5 * period * period
    for k in range(1, len(measured)):
        state[2, last] += drive[k - 1]
        for j in range(c + 5):
            g = state[2, j]
            state[0, j] += period * state[1, j] + half * g
            state[1, j] += period * g
        state[2, last] -= drive[k - 1]
        for j in range(c + 5):
            state[2, j] *= keep
        state[2, c + 3] += state[2, last] / keep
        for j in range(c):
            state[jump_state[j], j] += jumps[k, j]
            state[jump_state[j], last] += gains[j] * jumps[k, j]
        for j in range(c + 4):
            out[k, j] = state[0, j]
        e = measured[k] - state[0, last]
        out[k, last] = e
        for i in range(3):
            for j in range(c + 4):
                state[i, j] -= gain[i] * out[k, j]
            state[i, c + i] += e
            state[i, last] += gain[i] * e


@dataclass(frozen=True, eq=False)
class AxisFlight:
    """One axis of the pieces of a flight.

    Attributes:
        measured: pose of each piece (n,), m or rad.
        drive: acceleration (n,) that the model says acts from each sample to the next.
        rate: the pose's rate at the start of each piece.
        period: s.
        jumps: (n, c) of each piece, what a unit of each gain adds to the state before the pose of
            sample k is read. What else is known of a disturbance leaves less of it to the pose.
        jump_state: (c,) the state: 0 the pose, 1 its rate, 2 the disturbance.
        held: (c,) an innovation's standard deviation over that of each gain before the flight is
            seen. Rotor speeds that are nearly predicted would have gains without limit.
    """

    measured: Sequence[Array]
    drive: Sequence[Array]
    rate: Sequence[float]
    period: float
    jumps: Sequence[Array]
    jump_state: NDArray[np.intp]
    held: Array

    def fit(self, x: Array, gains: Array) -> "_Fit":
        """Return the fit of a noise ``x`` (3,), with derivatives at ``gains`` (c,) of the jumps."""
        noise = _noise(x, 1.0, self.period)
        found = _filter_of(noise, self.period)
        skip = round(AXIS.settling_time / self.period)
        total = np.zeros((len(gains) + 5,) * 2)
        count = 0
        for y, a, v, jumps in zip(self.measured, self.drive, self.rate, self.jumps, strict=True):
            rows = np.zeros((len(y), len(total)))
            _respond(y, a, v, jumps, self.jump_state, gains, found[3], self.period, found[:3], rows)
            total += rows[skip:].T @ rows[skip:]
            count += max(len(rows) - skip, 0)
        c = len(gains)
        # of the filter by its noise
        steps = [_filter_of(_noise(y, 1.0, self.period), self.period) for y in x + STEP * np.eye(3)]
        slope = np.zeros((c + 5, c + 4))
        slope[:c, :c], slope[-1, -1] = np.eye(c), 1.0
        slope[c:-1, c:-1] = (np.array(steps) - found).T / STEP
        total = slope.T @ total @ slope
        # the prior of the gains is one more measurement of each
        known = np.column_stack([np.eye(c), np.zeros((c, 3)), -gains]) * self.held[:, None]
        total += known.T @ known
        # the gains are linear, so they are fitted at once
        beside = np.linalg.solve(total[:c, :c], total[:c, c:])
        left = total[c:, c:] - total[:c, c:].T @ beside
        count = max(count, 1)
        square = float(left[-1, -1]) + count * LEAST_INNOVATION**2
        return _Fit(square, count, gains + beside[:, -1], left)


@dataclass(frozen=True, eq=False)
class _Fit:
    square: float  # of the innovations
    count: int
    gains: Array  # (c,) of the jumps, the likeliest ones
    # (4, 4) of what a unit of each part of the noise changes, and of the innovations
    products: Array


def likeliest_noise(flight: AxisFlight, near: AxisNoise, begun: bool) -> tuple[AxisNoise, Array]:
    """Return the noise of one axis at maximum likelihood, and the gains (c,) of the jumps beside
    it, by Levenberg and Marquardt's method.

    Args:
        flight: the axis.
        near: the noise at which the search begins.
        begun: whether that noise is roughly known.
    """
    x = _free(near)
    # the last is at most some ten thousand, where a white acceleration alone acts
    low = np.array([x[0] - 16.0, math.log(AXIS.times[0]), 0.0])
    high = np.array([x[0] + 16.0, math.log(AXIS.times[1]), 1e4])
    tried = [[0.0, 0.0, 0.0]]
    if not begun:
        tried = [[y, z, 0.0] for y in (-4.0, 0.0, 4.0) for z in (-1.6, 0.0, 1.6)]
    none = np.zeros(len(flight.jump_state))
    starts = [np.clip(x + step, low, high) for step in tried]
    fits = [flight.fit(start, none) for start in starts]
    best = min(range(len(fits)), key=lambda i: fits[i].square)
    x, damping = starts[best], 1e-2
    fit = flight.fit(x, fits[best].gains)  # derivatives are those at the gains
    for _ in range(STEPS):
        normal, right = fit.products[:-1, :-1], fit.products[:-1, -1]
        normal = normal + np.diag(damping * np.diagonal(normal) + 1e-12 * fit.square)
        step = bounded_mode(normal, right, low - x, high - x)
        if 0.5 * fit.count * float(right @ step) < AXIS.tolerance * fit.square:
            break
        other = flight.fit(x + step, fit.gains)
        damping *= 0.2 if other.square < fit.square else 8.0
        if other.square < fit.square:
            x, fit = x + step, other
    pose = math.sqrt(fit.square / fit.count) / _noise(x, 1.0, flight.period).innovation
    return _noise(x, pose, flight.period), fit.gains


def _filter_of(noise: AxisNoise, period: float) -> Array:
    """Return the gain of a steady filter, and how much of a disturbance one period keeps (4,)."""
    return np.array([*noise.gain, math.exp(-period / noise.time)])


def _free(noise: AxisNoise) -> Array:
    """Return a noise as what is searched (3,): the logarithms of the disturbance's variance over
    the pose's and of its correlation time, and the white acceleration's variance over the
    disturbance's.
    """
    ratios = noise.disturbance / noise.pose, noise.white / noise.disturbance
    return np.array([2.0 * math.log(ratios[0]), math.log(noise.time), ratios[1] ** 2])


def _noise(x: Array, pose: float, period: float) -> AxisNoise:
    disturbance = pose * math.exp(0.5 * x[0])
    return steady_noise(pose, disturbance, math.exp(x[1]), disturbance * math.sqrt(x[2]), period)


def steady_noise(
    pose: float, disturbance: float, time: float, white: float, period: float
) -> AxisNoise:
    """Return the noise of an axis with these standard deviations and correlation time."""
    gain = np.empty(3)
    ratio = steady((disturbance / pose) ** 2, time, (white / pose) ** 2, period, gain)
    innovation = pose * math.sqrt(ratio)
    gains = (float(gain[0]), float(gain[1]), float(gain[2]))
    return AxisNoise(pose, disturbance, time, white, innovation, gains)
