"""What a flight log says about motion, without a filter's delay: velocity, acceleration, body rate
and its derivative.

A zero-phase low-pass (a Butterworth filter run forwards and backwards) smooths the pose before it
is differentiated, wide enough (15 Hz) to leave a quadrotor's motion alone. Whatever is compared
with these signals must pass the same narrower filter afterwards, ``low_pass``: a causal filter's
output against unfiltered regressors biases drag by a quarter.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, savgol_filter, sosfiltfilt
from scipy.spatial.transform import Rotation

from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from .cutoffs import CUTOFFS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SignalSettings:
    """Which pieces of a log have signals."""

    shortest_piece: float = 3.0  # s of unbroken pose


SIGNALS = SignalSettings()


@dataclass(frozen=True, eq=False)
class Signals:
    """Motion (n samples, evenly spaced) over one unbroken piece of a log."""

    t: Array  # (n,) s
    period: float  # s
    position: Array  # (n, 3) m, world, of the geometric centre
    rotation: Array  # (n, 3, 3) body to world
    velocity: Array  # (n, 3) m/s, world
    acceleration: Array  # (n, 3) m/s2, world
    rate: Array  # (n, 3) rad/s, body
    angular_acceleration: Array  # (n, 3) rad/s2, body
    rotor_speeds: Array  # (n, 4) rad/s, of the interval that ends at the sample
    voltage: Array | None  # (n,) V


def low_pass(x: Array, cutoff_hz: float, period: float) -> Array:
    """Return ``x`` (n, ...) through a zero-phase fourth-order low-pass along its first axis."""
    if cutoff_hz >= 0.49 / period:
        return x
    rows = np.ascontiguousarray(np.moveaxis(x, 0, -1))  # which the filter runs along faster
    return np.moveaxis(
        np.asarray(sosfiltfilt(_sections(2.0 * cutoff_hz * period), rows), dtype=np.float64), -1, 0
    )


@lru_cache(maxsize=64)
def _sections(share_of_nyquist: float) -> Array:
    return np.asarray(butter(2, share_of_nyquist, output="sos"))


def log_signals(log: FlightLog, wide_hz: float = CUTOFFS.pose_hz) -> list[Signals]:
    """Return the motion over each unbroken piece of a log that is long enough to say something.

    Uneven time steps and single lost poses are bridged by interpolation; a gap of more than 0.1 s
    ends a piece.

    Raises:
        InputError: no piece is longer than 3 s.
    """
    seen = np.flatnonzero(log.valid)
    breaks = np.flatnonzero(np.diff(log.t[seen]) > max(0.1, 3.5 * log.period)) + 1
    pieces = [piece for piece in np.split(seen, breaks) if len(piece) > 8]
    out = [
        _piece(log, piece, wide_hz)
        for piece in pieces
        if log.t[piece[-1]] - log.t[piece[0]] > SIGNALS.shortest_piece
    ]
    if not out:
        raise InputError(
            f"{log.name}: no unbroken piece of pose is longer than {SIGNALS.shortest_piece:g} s"
        )
    return out


def _piece(log: FlightLog, rows: NDArray[np.intp], wide_hz: float) -> Signals:
    period = log.period
    t = np.arange(log.t[rows[0]], log.t[rows[-1]] + 0.5 * period, period)
    t = t[t <= log.t[rows[-1]]]

    def even(x: Array) -> Array:
        return np.column_stack([np.interp(t, log.t[rows], column) for column in x[rows].T])

    q = log.quaternion[rows]
    # a quaternion and its negative are one attitude: make the sequence continuous before it is
    # smoothed
    signs = np.sign(np.sum(q[1:] * q[:-1], axis=1))
    q = q * np.concatenate([[1.0], np.cumprod(np.where(signs == 0, 1.0, signs))])[:, None]
    q = low_pass(
        np.column_stack([np.interp(t, log.t[rows], column) for column in q.T]), wide_hz, period
    )
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    dq = _derivative(q, period)
    w, v, dw, dv = q[:, :1], q[:, 1:], dq[:, :1], dq[:, 1:]
    rate = 2.0 * (w * dv - dw * v - np.cross(v, dv))
    position = low_pass(even(log.position), wide_hz, period)
    voltage = None if log.voltage is None else np.interp(t, log.t, log.voltage)
    speeds = np.column_stack([np.interp(t, log.t, column) for column in log.rotor_speeds.T])
    return Signals(
        t,
        period,
        position,
        Rotation.from_quat(q, scalar_first=True).as_matrix(),
        _derivative(position, period),
        _derivative(position, period, 2),
        rate,
        _derivative(rate, period),
        speeds,
        voltage,
    )


def _derivative(x: Array, period: float, order: int = 1) -> Array:
    """Return a derivative of ``x`` (n, k) along its first axis, true to the fourth power of the
    period.

    Central differences, applied twice, take a third of (omega period)^2 from an acceleration. The
    direction of thrust loses nothing, and the difference, 0.08 mm times the angular acceleration at
    200 Hz, would be a centre of mass that is off.
    """
    return np.asarray(savgol_filter(x, 5, 4, deriv=order, delta=period, axis=0))
