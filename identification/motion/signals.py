"""The motion in a flight log, without a filter's delay: velocity, acceleration, angular velocity
and its derivative.

A zero-phase low-pass (a Butterworth filter run forwards and backwards) smooths the pose before it
is differentiated, wide enough (15 Hz) to leave a quadrotor's motion alone. Every quantity compared
with these signals must pass the same narrower filter afterwards, ``low_pass``: a causal filter's
output against unfiltered regressors biases drag by a quarter.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from ..logs.table import Array, Data, Rows
from .smoothing import (
    CUTOFFS,
    continuous,
    derivative,
    even_times,
    low_pass,
    resampled,
    turning,
    unbroken,
)

SHORTEST_PIECE = 3.0  # s of unbroken pose; a shorter one is all edge to the filters
LONGEST_GAP = 0.1  # s without a pose, or a reading of an IMU; nothing is interpolated over more


@dataclass(frozen=True, eq=False)
class Signals:
    """Motion (n samples, evenly spaced) over one unbroken piece of a log."""

    t: Array  # (n,) s
    period: float  # s
    position: Array  # (n, 3) m, world, of the geometric centre
    rotation: Array  # (n, 3, 3) body to world
    velocity: Array  # (n, 3) m/s, world
    acceleration: Array  # (n, 3) m/s2, world
    angular_velocity: Array  # (n, 3) rad/s, body
    angular_acceleration: Array  # (n, 3) rad/s2, body
    rotor_speeds: Array  # (n, 4) rad/s, of the interval that ends at the sample
    voltage: Array | None  # (n,) V

    def at(self, samples: slice | NDArray[np.integer[Any]]) -> "Signals":
        """Return the signals at some samples, with the period as it was."""
        sampled: Data = {
            name: x[samples]
            for name, x in vars(self).items()
            if isinstance(x, np.ndarray) and len(x) == len(self.t)
        }
        return replace(self, **sampled)


def in_body(x: Array, rotation: Array) -> Array:
    """Return world vectors (n, 3) in body axes."""
    return np.asarray(np.einsum("nji,nj->ni", rotation, x))


def log_signals(log: FlightLog, wide_hz: float = CUTOFFS.pose_hz) -> list[Signals]:
    """Return the motion over each unbroken piece of a log of sufficient length.
    Uneven time steps and single lost poses are bridged by interpolation; a gap of more than 0.1 s
    ends a piece.

    Raises:
        InputError: no piece is longer than 3 s.
    """
    return [_piece(log, piece, wide_hz) for piece in known_pieces(log)]


def known_pieces(log: FlightLog) -> list[Rows]:
    """Return the rows of each unbroken run of poses of sufficient length.

    Raises:
        InputError: none is longer than 3 s.
    """
    pieces = pose_pieces(log)
    if not pieces:
        raise InputError(
            f"{log.name}: no unbroken piece of pose is longer than {SHORTEST_PIECE:g} s"
        )
    return pieces


def pose_pieces(log: FlightLog) -> list[Rows]:
    """Return the same, or none."""
    return unbroken(log.t, np.flatnonzero(log.valid), longest_step(log), 8, SHORTEST_PIECE)


def longest_step(log: FlightLog) -> float:
    """Return the longest time step (s) without a break in a log."""
    return max(LONGEST_GAP, 3.5 * log.period)


def voltage_at(log: FlightLog, t: Array) -> Array | None:
    """Return the battery's voltage (n,) at times (n,); None without any in the log."""
    return None if log.voltage is None else np.interp(t, log.t, log.voltage)


def _piece(log: FlightLog, rows: Rows, wide_hz: float) -> Signals:
    period = log.period
    t = even_times(log.t[rows], period)
    q = resampled(t, log.t[rows], continuous(log.quaternion[rows]))
    rotation, angular_velocity = turning(low_pass(q, wide_hz, period), period)
    position = low_pass(resampled(t, log.t[rows], log.position[rows]), wide_hz, period)
    return Signals(
        t,
        period,
        position,
        rotation,
        derivative(position, period),
        derivative(position, period, 2),
        angular_velocity,
        derivative(angular_velocity, period),
        resampled(t, log.t, log.rotor_speeds),
        voltage_at(log, t),
    )
