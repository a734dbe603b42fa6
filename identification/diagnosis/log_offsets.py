"""Errors of a log's signals: time offsets, rotor speeds too rough or too even, and a bias of the
accelerometer. All are fitted beside effects.

A fusion takes out most of an accelerometer's bias; three numbers a flight are left. So a steady
force along the body differs from a bias only where attitude, thrust or the force itself changes.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import Vehicle
from ..logs.table import Pair, Values
from ..motion.signals import Signals
from ..motion.smoothing import lagged, resampled
from .column import Column, Part


def _error(name: str) -> Column:
    return Column("", name, Part.OFFSET)


# time offsets (s) of a log: of the rotor speeds' action behind their log, of the attitude ahead of
# the position, and of the acting velocity behind the position's (as in a simulator with forces held
# over a step)
ROTOR_TIME_OFFSET = _error("rotor_time_offset")
ATTITUDE_TIME_OFFSET = _error("attitude_time_offset")
VELOCITY_TIME_OFFSET = _error("velocity_time_offset")
# variance (s2) of the time over which rotor speeds are averaged, to both sides. An IMU hardly has
# noise, so the rotor speeds' noise and rounding show; and the IMU has a low-pass of its own.
# Without this average the fit finds an averaging lag, with an offset to bring the rotors forward
# again
ROTOR_SPREAD = _error("rotor_spread")
# s by which lagging rotors speed up sooner and slow down later than the lag. Their mean thrust is
# larger by as much, and without this offset looks like a smaller mass
LAG_ASYMMETRY = _error("lag_asymmetry")


class Offset(NamedTuple):
    """Typical size and range, in its unit."""

    size: float
    range: Pair = (-math.inf, math.inf)


_SECONDS = Offset(0.0025, (-0.006, 0.006))
TIMINGS = {
    ROTOR_TIME_OFFSET: _SECONDS,
    ATTITUDE_TIME_OFFSET: _SECONDS,
    VELOCITY_TIME_OFFSET: _SECONDS,
    ROTOR_SPREAD: Offset(2.5e-5, (0.0, 1.6e-3)),  # 5 ms, and at most 40
    LAG_ASYMMETRY: Offset(0.005, (-0.02, 0.02)),  # rotors are driven up, and drag slows them down
}
# for a pose filtered before the log was written: a causal low-pass of 5 Hz is 45 ms late, an
# estimator some more
BEHIND_A_FILTER = Offset(0.02, (-0.1, 0.1))
_NEAR = 0.98  # share of a bound: the last step of a search


def bias_column(log: int, axis: int) -> Column:
    """Return the column of a bias (m/s2) along an axis of the body."""
    return _error(f"accelerometer bias {'xyz'[axis]} {log}")


def delays_at_bound(setting: Mapping[str, Values]) -> Iterator[str]:
    """Yield the delays of a setting, coefficients by effect, whose search ended at its bound."""
    for effect in playing(Role.DELAY, among=filter(None, setting)):
        for c in get(effect).coefficients:
            value = setting[effect].get(c.name, 0.0)
            bound = c.maximum if value > 0.0 else c.minimum
            if bound and value / bound > _NEAR:
                yield (
                    f"{effect}: the search ends at {1000.0 * bound:.3g} ms, and the delay may be "
                    "longer. Compare the clocks of pose and rotor speeds"
                )


def with_uneven_lag(signals: Signals, vehicle: Vehicle, asymmetry: float) -> Signals:
    """Return the signals with rotors that speed up sooner, by ``asymmetry`` s, and slow down later
    than a vehicle's lag; unchanged without a lag.

    To first order: behind a lag of ``tau -+ asymmetry``, rotor speeds follow ``u + asymmetry
    |dW/dt|`` with the lag ``tau``, where W follows u.
    """
    every = ((get(e.name), e.coefficients) for e in vehicle.effects)
    lag = max((e.vector(given)[0] for e, given in every if e.role == Role.LAG), default=0.0)
    if asymmetry == 0.0 or lag == 0.0:
        return signals
    followed = lagged(signals.rotor_speeds, lag, signals.period)
    rate = np.abs(np.diff(followed, axis=0, prepend=followed[:1])) / signals.period
    return replace(signals, rotor_speeds=signals.rotor_speeds + asymmetry * rate)


def with_time_offsets(signals: Signals, offsets: Values) -> Signals:
    """Return the signals with the time offsets of rotor speeds, velocity and attitude applied."""
    if rotors := offsets.get(ROTOR_TIME_OFFSET.coefficient):
        n = np.arange(len(signals.t), dtype=np.float64)
        speeds = resampled(n - rotors / signals.period, n, signals.rotor_speeds)
        signals = replace(signals, rotor_speeds=speeds)
    if spread := offsets.get(ROTOR_SPREAD.coefficient):
        from scipy.ndimage import gaussian_filter1d  # needed without a pose alone

        over = np.sqrt(spread) / signals.period
        smooth = gaussian_filter1d(signals.rotor_speeds, over, axis=0, mode="nearest")
        signals = replace(signals, rotor_speeds=smooth)
    if velocity := offsets.get(VELOCITY_TIME_OFFSET.coefficient):
        signals = replace(signals, velocity=signals.velocity - velocity * signals.acceleration)
    if attitude := offsets.get(ATTITUDE_TIME_OFFSET.coefficient):
        turn = Rotation.from_rotvec(-attitude * signals.angular_velocity).as_matrix()
        signals = replace(signals, rotation=signals.rotation @ turn)
    return signals
