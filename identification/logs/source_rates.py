"""How often a channel was measured, whatever the rate of the rows in which it stands.

A log that holds its slow channels between their samples, or that was resampled along straight
lines, has rows that no sensor measured.
"""

from dataclasses import dataclass

import numpy as np

from ..motion.smoothing import resampled
from .table import Array, Rows, finite_rows, median_step


@dataclass(frozen=True)
class MotorRates:
    """How often rotor speeds or commands must be measured.

    Between samples they are taken along a straight line, which passes 0.9 of an oscillation's
    amplitude up to 0.18 of their rate. Forces are judged up to 3.5 Hz. Torques turn a vehicle
    within a tenth of a second: they need what a pose and a gyro need.
    """

    force_hz: float = 20.0
    torque_hz: float = 45.0
    jitter: float = 1.1  # times too slow that a rate may be

    def serves(self, rate: float, least: float) -> bool:
        """Return whether a rate is as high as it must be, Hz."""
        return rate * self.jitter >= least


MOTOR_RATES = MotorRates()


@dataclass(frozen=True)
class SourceRateSettings:
    """When values repeat because nothing was measured, and not because they were rounded."""

    # of the median spacing of changes: rounded values change at any spacing, held ones at their own
    least_spacing: float = 0.6
    least_rows: float = 2.0  # of the median spacing; below, each row is a sample
    early: float = 0.05  # quantile of spacings that is compared with the median
    # of the RMS distance from the line between both neighbours: on the line
    on_line: float = 1e-3
    most_corners: float = 2 / 3  # of the rows; with more no two corners can be told apart
    least_changes: int = 8  # that tell a spacing


SOURCE_RATE = SourceRateSettings()


def source_rate(t: Array, values: Array) -> float:
    """Return how often a channel was measured, Hz; 0 where it holds less than two samples.

    Args:
        t: (N,) s, increasing.
        values: (N, K); a row with NaN is no sample.
    """
    good = finite_rows(values)
    t, values = t[good], values[good]
    if len(t) < 2:
        return 0.0
    changes = np.flatnonzero(np.any(np.diff(values, axis=0) != 0.0, axis=1))
    step = median_step(t)
    return 1.0 / (step * max(_spacing(changes), _spacing(_corners(t, values))))


def between_samples(t: Array, values: Array, rate: float) -> Array:
    """Return by how much a channel (N, K) leaves the line between its samples (K,), one standard
    deviation: at most as much as a sample leaves the line between its neighbours.

    Args:
        t: (N,) s, increasing.
        values: (N, K), finite, of a channel that was measured less often.
        rate: at which it was, Hz.
    """
    beats = np.arange(t[0], t[-1], 1.0 / rate)
    off = 0.5 * np.diff(resampled(beats, t, values), n=2, axis=0)
    return np.asarray(np.sqrt(np.mean(np.square(off), axis=0))) if len(off) else np.zeros(4)


def _corners(t: Array, values: Array) -> Rows:
    """Return where values (N, K) leave the straight line between their neighbours: of two or more
    rows in a row the first, since a sample between rows bends the line in both.
    """
    if len(t) < 3:
        return np.empty(0, dtype=np.intp)
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    off = np.abs(values[1:-1] - (values[:-2] + share * (values[2:] - values[:-2])))
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    is_corner = (off > SOURCE_RATE.on_line * rms).any(axis=1)
    if np.mean(is_corner) > SOURCE_RATE.most_corners:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(is_corner & ~np.append(False, is_corner[:-1]))


def _spacing(events: Rows) -> float:
    """Return the usual number of rows between events that come in a beat of their own; else 1."""
    use, spacing = SOURCE_RATE, np.diff(events)
    if len(spacing) < use.least_changes:
        return 1.0
    median = float(np.median(spacing))
    beat = float(np.quantile(spacing, use.early)) >= use.least_spacing * median
    usual = spacing[spacing < median / use.least_spacing]  # no gap
    return float(np.mean(usual)) if beat and median >= use.least_rows else 1.0
