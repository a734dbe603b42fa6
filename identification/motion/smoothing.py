"""Smoothing and differentiation of a flight's signals, and the cut-off of every filter.

All filters are of zero phase: a Butterworth filter run forwards and backwards. Compared quantities
pass the same filter: a causal filter's output against unfiltered regressors biases drag by a
quarter.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ... import _core
from ...runtime.arrays import Array, Mask


class _Cutoffs(NamedTuple):
    """Cut-off frequencies (Hz), of low-passes unless stated."""

    # a log's pose before it is differentiated, and rotor speeds from commands: wide enough to leave
    # a quadrotor's motion alone
    pose_hz: float = 15.0
    # the residual and every column regressed on it
    residual_hz: float = 5.0
    # the residual, in the search for transient disturbances: they last as long, and sensor noise is
    # weakest below these
    transient_hz: tuple[float, float] = (1.5, 3.0)
    # a disturbance in the verdict; faster parts hold noise of the pose and of the rounding of rotor
    # speeds
    calm_hz: float = 2.0
    # the motion in the checks of a log's conventions: well above a trajectory, well below the noise
    # of a differentiated pose
    convention_hz: float = 3.0
    # the thrust that tells flight from the ground
    flying_hz: float = 1.0
    # share of the sampling rate, of the high-pass that leaves a pose nothing but its noise
    noise_share_of_rate: float = 0.25


CUTOFFS = _Cutoffs()


def low_pass(x: Array, cutoff_hz: float, period: float) -> Array:
    """Return ``x`` (n, ...) through a zero-phase fourth-order low-pass along its first axis.

    The numbers are those of ``scipy.signal.sosfiltfilt``, to rounding; all columns at once take a
    tenth of its time.
    """
    if cutoff_hz >= 0.49 / period:
        return x
    return _both_ways(x, 2, 2.0 * cutoff_hz * period)


def high_pass(x: Array, share_of_rate: float) -> Array:
    """Return ``x`` (n, ...) through a zero-phase eighth-order high-pass along its first axis, with
    the cut-off as a share of the sampling rate. White noise keeps its standard deviation.
    """
    filters = 4, 2.0 * share_of_rate, True
    white = np.eye(201)[100]
    return _both_ways(x, *filters) / np.linalg.norm(_both_ways(white, *filters))


def _both_ways(x: Array, order: int, share_of_nyquist: float, high: bool = False) -> Array:
    out = x.reshape(len(x), -1).copy()
    _core.filter_both_ways(out, order, share_of_nyquist, high)
    return out.reshape(x.shape)


def filtered(x: Array, section: Sequence[float], steady: bool = False) -> Array:
    """Return ``x`` (n, ...) through a second-order section b0, b1, b2, 1, a1, a2 along its first
    axis; ``steady``: as if the first sample had lasted, else from rest.
    """
    out = x.reshape(len(x), -1).copy()
    _core.run_sections(out, np.array([section]), steady, 1)
    return out.reshape(x.shape)


def mean_square(x: Array) -> Array:
    """Return the mean squares of the columns of ``x`` (n, ...)."""
    return np.asarray(np.mean(np.square(x), axis=0))


def robust_std(x: Array) -> float:
    """Return the standard deviation of normal noise about zero, whatever the outliers."""
    return float(np.median(np.abs(x)) / 0.6745)


def lagged(x: Array, lag: float, period: float) -> Array:
    """Return ``x`` (n, ...) through a first-order lag (s), at rest before the first sample. As in
    the library's effect, each sample is held over the step before it.
    """
    if lag <= 1e-9:
        return x
    keep = np.exp(-period / lag)
    return filtered(x, (1.0 - keep, 0.0, 0.0, 1.0, -keep, 0.0), steady=True)


def even_times(t: Array, period: float) -> Array:
    """Return times (n,) from the first of ``t`` (m,) to the last, ``period`` s apart."""
    times = np.arange(t[0], t[-1] + 0.5 * period, period)
    return np.asarray(times[times <= t[-1]])


def resampled(t: Array, times: Array, x: Array) -> Array:
    """Return ``x`` (m, k), measured at ``times`` (m,), linear between them, at ``t`` (n,)."""
    return np.column_stack([np.interp(t, times, column) for column in x.T])


def second_difference(at: Array, step: float, t: Array, x: Array) -> Array:
    """Return the second differences (n, k), over ``step`` s, of ``x`` (m, k) around times (n,)."""
    before, middle, after = (resampled(at + k * step, t, x) for k in (-1, 0, 1))
    return before - 2.0 * middle + after


def unbroken(
    t: Array, rows: NDArray[np.intp], gap: float, count: int = 0, seconds: float = -1.0
) -> list[NDArray[np.intp]]:
    """Return the runs of ``rows`` with gaps of at most ``gap`` s, of more than ``count`` rows and
    more than ``seconds`` s.
    """
    runs = np.split(rows, np.flatnonzero(np.diff(t[rows]) > gap) + 1)
    return [run for run in runs if len(run) > count and np.ptp(t[run]) > seconds]


def runs_of(rows: Mask) -> list[tuple[int, int]]:
    """Return the first row, and the one after the last, of each run of true rows (n,)."""
    edges = np.flatnonzero(np.diff(rows, prepend=False, append=False))
    return [(a, b) for a, b in edges.reshape(-1, 2).tolist()]


def derivative(x: Array, period: float, order: int = 1) -> Array:
    """Return a derivative of ``x`` (n, k) along its first axis, true to the fourth power of the
    period.

    Central differences, applied twice, take a third of (omega period)^2 from an acceleration. The
    direction of thrust loses nothing. The difference, 0.08 mm times the angular acceleration at 200
    Hz, would look like an offset of the centre of mass.
    """
    out = np.empty_like(x)
    _core.differentiate(x, period, order, out)
    return out


def running_integral(x: Array, t: Array) -> Array:
    """Return the integrals (n, ...) of ``x`` (n, ...) over times (n,), from the first on, by the
    trapezoidal rule.
    """
    steps = np.diff(t).reshape(-1, *[1] * (x.ndim - 1))
    return np.concatenate([0.0 * x[:1], np.cumsum(steps * (x[1:] + x[:-1]) / 2.0, axis=0)])


def power_spectrum(x: Array, period: float, length: int) -> tuple[Array, Array]:
    """Return frequencies (f,), Hz, and the one-sided power per hertz (f, k) of ``x`` (n, k) by
    half-overlapping segments (P. D. Welch, IEEE Transactions on Audio and Electroacoustics 15
    (1967), 70-73), without their means.
    """
    length = min(length, len(x))
    parts = sliding_window_view(x, length, axis=0)[:: length - length // 2]
    window = np.hanning(length + 1)[:-1]
    parts = window * (parts - parts.mean(axis=-1, keepdims=True))
    power = 2.0 * period * mean_square(np.abs(np.fft.rfft(parts))).T / np.sum(window**2)
    power[[0, -1] if length % 2 == 0 else 0] /= 2.0
    return np.arange(length // 2 + 1) / (length * period), power


def turning(quaternion: Array, period: float) -> tuple[Array, Array]:
    """Return the rotations (n, 3, 3), body to world, of smoothed quaternions (n, 4) of about length
    1, and the angular velocity (n, 3) rad/s, body.
    """
    q = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    dq = derivative(q, period)
    w, v, dw, dv = q[:, :1], q[:, 1:], dq[:, :1], dq[:, 1:]
    rotation = Rotation.from_quat(q, scalar_first=True).as_matrix()
    return rotation, 2.0 * (w * dv - dw * v - np.cross(v, dv))


def turn_between(before: Array, after: Array) -> Array:
    """Return the rotations (n, 3) rad, body, from attitudes (n, 4) to others, each by at most half
    a turn.
    """
    start, end = (Rotation.from_quat(q, scalar_first=True) for q in (before, after))
    return np.asarray((start.inv() * end).as_rotvec())


def turned(quaternion: Array) -> Array:
    """Return the sum (n - 1, 3) of the rotations (rad, body) between quaternions (n, 4). White
    noise stays white in this sum, except for a small share turned by the motion.
    """
    return np.cumsum(turn_between(quaternion[:-1], quaternion[1:]), axis=0)


def continuous(quaternion: Array) -> Array:
    """Return quaternions (n, 4) with the signs of a continuous sequence, ready for smoothing: a
    quaternion and its negative are one attitude.
    """
    signs = np.sign(np.sum(quaternion[1:] * quaternion[:-1], axis=1))
    signs = np.cumprod(np.where(signs == 0, 1.0, signs))
    return np.asarray(quaternion * np.concatenate([[1.0], signs])[:, None])


# thrust and torques of four rotors, each of length 1
TOGETHER = 0.5 * np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1]])
_WELCH = 256  # samples of a spectrum, and held beyond either end


def likeliest_speeds(speeds: Array, period: float) -> Array:
    """Return the likeliest true rotor speeds (n, 4) behind measured ones, rad/s, without a delay.

    Wiener's filter of the sums and differences of their squares, which make thrust and torques. The
    noise is white, as high as the highest quarter of the spectrum: no rotor follows there.
    """
    squares = np.square(speeds) @ TOGETHER
    frequency, power = power_spectrum(squares, period, _WELCH)
    noise = power[-len(power) // 4 :].mean(axis=0)
    share = np.maximum(1.0 - noise / np.maximum(power, np.finfo(float).tiny), 0.0)
    share[0] = 1.0  # of the mean, which the spectrum is without
    longer = np.pad(squares, ((_WELCH, _WELCH), (0, 0)), mode="edge")
    every = np.fft.rfftfreq(len(longer), period)
    gains = np.column_stack([np.interp(every, frequency, x) for x in share.T])
    smooth = np.fft.irfft(gains * np.fft.rfft(longer, axis=0), len(longer), axis=0)
    return np.sqrt(np.maximum(smooth[_WELCH:-_WELCH] @ TOGETHER, 0.0))
