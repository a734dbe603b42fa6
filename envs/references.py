"""References to fly: a point held, figures of eight, and random splines, a row a tick."""

import math

import numpy as np
from scipy.interpolate import CubicSpline

from ..runtime.arrays import Array
from .plant import TICK

REFERENCE_FADE = 1.5  # s, over which a moving reference gets up to speed


def hold(position: Array, yaw: float, seconds: float) -> Array:
    """Return a reference (n, 10) at rest at ``position`` (3,) m."""
    return along(np.tile(position, (round(seconds / TICK) + 1, 1)), yaw)


def along(position: Array, yaw: float) -> Array:
    """Return a reference (n, 10) from places (n, 3) m a tick apart, with velocity and acceleration
    by central differences.
    """
    rows = np.zeros((len(position), 10))
    rows[:, :3], rows[:, 9] = position, yaw
    if len(position) > 1:
        rows[:, 3:6] = np.gradient(position, TICK, axis=0)
        rows[:, 6:9] = np.gradient(rows[:, 3:6], TICK, axis=0)
    return rows


def _warped(seconds: float) -> Array:
    """Return times of the ticks in ``seconds``, slow at first and then less half the fade; twice
    smooth.
    """
    t = TICK * np.arange(round(seconds / TICK) + 1, dtype=np.float64)
    u = np.clip(t / REFERENCE_FADE, 0.0, 1.0)
    # integral of the smooth step 10 u^3 - 15 u^4 + 6 u^5
    return REFERENCE_FADE * (2.5 * u**4 - 3.0 * u**5 + u**6) + np.maximum(t - REFERENCE_FADE, 0.0)


def figure_of_eight(
    centre: Array, yaw: float, seconds: float, size: tuple[float, float], period: float, turn: float
) -> Array:
    """Return a lying figure of eight (n, 10): ``size`` m along and across, in ``period`` s, turned
    by ``turn`` rad about the vertical.

    ``along = a sin(w t)``, ``across = b sin(2 w t)``.
    """
    t = _warped(seconds)
    phase = 2.0 * math.pi / period * t
    far, side = size[0] * np.sin(phase), size[1] * np.sin(2.0 * phase)
    c, s = math.cos(turn), math.sin(turn)
    position = centre + np.column_stack([c * far - s * side, s * far + c * side, 0.0 * t])
    return along(position, yaw)


def random_spline(
    rng: np.random.Generator, centre: Array, yaw: float, seconds: float, size: Array, every: float
) -> Array:
    """Return a cubic spline (n, 10) that begins at ``centre`` at rest. Every ``every`` s it passes
    a point drawn from a box of half ``size`` (3,) m about the centre.
    """
    count = math.ceil(seconds / every) + 2
    points = centre + size * rng.uniform(-1.0, 1.0, (count, 3))
    points[0] = centre
    spline = CubicSpline(every * np.arange(count), points, bc_type=((1, np.zeros(3)), "not-a-knot"))
    return along(spline(_warped(seconds)), yaw)
