"""A filter with a clock: measurements with a time stamp in the past are fused where they belong.

Poses take time to be computed and sent, not always the same time: they come late and out of order.
``TimedFilter`` keeps the inputs of the last ``horizon`` seconds, and the filter's memory at a few
times in between. A late measurement takes the filter back to the last of these times before its
stamp. From there all inputs are repeated, with the measurement in its place. The stamp splits a
prediction, whose rotor speeds hold on both sides. The result equals, bit for bit, a filter's with
all inputs in order of time stamps.

The filter's whole memory goes back: state, covariance, the memory of effects such as motor lag or
latency, and the counts of refusals and restarts.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..runtime.errors import InputError
from .estimate import WrenchEstimate
from .ukf import WrenchUKF

_DIGITS = 9  # decimals of a time stamp in s: closer stamps count as equal
_SNAPSHOTS = 16  # of the memory in a horizon: they lengthen a replay by a sixteenth at most

Snapshot = list[NDArray[np.uint8]]


@dataclass(slots=True, eq=False)
class _Event:
    """A prediction up to a time, then perhaps a measurement."""

    t: float  # s
    # rotor speeds and voltage of the time since the event before
    inputs: tuple[ArrayLike, float | None] | None
    # the filter's method, and its arguments
    measured: tuple[str, tuple[ArrayLike | None, ArrayLike | None]] | None
    before: Snapshot | None = None  # the filter's memory before this event


class TimedFilter:
    """A wrench filter for measurements with time stamps, late and in any order.

    Call ``reset`` with a first pose and ``predict`` with each set of rotor speeds, in order. Call
    ``correct`` or ``correct_imu`` at each measurement, with a stamp of at most ``horizon`` in the
    past. Stamps are times in s on one clock, rounded to nanoseconds. Measurements with equal stamps
    count in order of arrival.

    A late measurement costs a replay of all after its stamp. The worst takes 0.5 ms with
    ``WrenchUKF`` on one core: 0.3 s late among rotor speeds at 200 Hz and poses at 100 Hz. A
    measurement of now takes 5 us. Snapshots take 0.8 MB.

    Args:
        ukf: a ``WrenchUKF`` or ``ConstantGainFilter``; only to be read from now on.
        horizon: how far in the past a stamp may lie, s. Longer costs memory, and time at late
            measurements.

    Attributes:
        late: how many measurements were fused in the past.
        too_late: how many were refused, being older than the horizon or than the reset.
        fused: the estimate at the stamp of the last fused measurement, just after the fusion, with
            the measurement's NIS. None before the first.

    Raises:
        InputError: the horizon is not positive.
    """

    def __init__(self, ukf: WrenchUKF, horizon: float = 0.3) -> None:
        if not (math.isfinite(horizon) and horizon > 0):
            raise InputError(f"TimedFilter: horizon must be positive, in s, got {horizon!r}")
        self.ukf = ukf
        self.horizon = float(horizon)
        self.late = self.too_late = 0
        self.fused: WrenchEstimate | None = None
        self._events: list[_Event] = []  # in order of time; the first has a snapshot
        self._start = math.nan  # s, time of the filter before the first event
        self._snapped = math.nan  # s, time of the last snapshot

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} at {self.time:g} s, {self.late} late, {self.too_late} too "
            f"late: {self.ukf!r}>"
        )

    @property
    def time(self) -> float:
        """Time of the filter, s; NaN before ``reset``."""
        return self._events[-1].t if self._events else self._start

    @property
    def estimate(self) -> WrenchEstimate:
        """The estimate now."""
        return self.ukf.estimate

    def reset(
        self,
        t: float,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose at time ``t``, s, and forget what was before; arguments as for
        ``WrenchUKF.reset``.

        Raises:
            InputError: as ``WrenchUKF.reset``, or the time is not finite.
        """
        t = _seconds("reset", t)
        self.ukf.reset(position, quaternion, covariance, velocity, angular_velocity)
        self._events.clear()
        self._start = t
        self.late = self.too_late = 0
        self.fused = None

    def predict(
        self, t: float, rotor_speeds: ArrayLike, voltage: float | None = None
    ) -> WrenchEstimate:
        """Carry the filter to time ``t``, s, with the rotor speeds (4,) rad/s since the last call;
        ``voltage`` as for ``WrenchUKF.step``.

        Raises:
            InputError: before ``reset``, ``t`` is not after the filter's time, or a shape is wrong;
                the filter stays as it was.
        """
        t, now = _seconds("predict", t), self._now("predict")
        if t <= now:
            raise InputError(
                f"predict: rotor speeds up to {t:.6f} s, but the filter is at {now:.6f} s already; "
                "rotor speeds must come in order"
            )
        # a copy: a caller may use its array again before it is replayed
        estimate = self._append(_Event(t, (copy(rotor_speeds), voltage), None), now)
        self._forget(t - self.horizon)
        return estimate

    def correct(
        self, t: float, position: ArrayLike | None, quaternion: ArrayLike | None
    ) -> WrenchEstimate | None:
        """Take in a pose, or a part of one, measured at time ``t``, s.

        Returns:
            The present estimate; None where the pose is older than the horizon, and was refused.

        Raises:
            InputError: before ``reset``, ``t`` lies in the future, a shape is wrong, or the
                quaternion's length is not 1; the filter stays as it was.
        """
        return self._take("correct", t, position, quaternion)

    def correct_imu(
        self, t: float, gyro: ArrayLike | None = None, accelerometer: ArrayLike | None = None
    ) -> WrenchEstimate | None:
        """Take in an IMU's measurement at time ``t``, s, as ``correct`` does; arguments of
        ``WrenchUKF.correct_imu``.
        """
        return self._take("correct_imu", t, gyro, accelerometer)

    def _take(
        self, method: str, t: float, first: ArrayLike | None, second: ArrayLike | None
    ) -> WrenchEstimate | None:
        t, now = _seconds(method, t), self._now(method)
        if t > now:
            raise InputError(
                f"{method}: a measurement of {t:.6f} s lies in the future, the filter is at "
                f"{now:.6f} s; call predict up to there first"
            )
        if t < max(now - self.horizon, self._start):
            self.too_late += 1
            return None
        measured = method, (copy(first), copy(second))
        where = bisect_right(self._events, t, key=lambda event: event.t)
        if where == len(self._events):
            self.fused = self._append(_Event(t, None, measured), now)
            return self.fused
        follower = self._events[where]
        event = _Event(t, follower.inputs, measured)
        event.before, follower.before = follower.before, None
        self._events.insert(where, event)
        try:
            self._replay(where)
        except InputError:
            del self._events[where]
            follower.before = event.before
            self._replay(where)
            raise
        self.late += 1
        return self.ukf.estimate

    def _append(self, event: _Event, now: float) -> WrenchEstimate:
        """Process the newest event, and append it if no error comes."""
        if not self._events or now - self._snapped >= self.horizon / _SNAPSHOTS:
            event.before = self._snapshot()
        estimate = self._do(event, now)
        if event.before is not None:
            self._snapped = now
        self._events.append(event)
        return estimate

    def _do(self, event: _Event, now: float) -> WrenchEstimate:
        """Carry the filter from ``now`` to an event, and take in its measurement."""
        ukf = self.ukf
        if event.inputs is not None and event.t > now:
            speeds, voltage = event.inputs
            estimate = ukf.predict(speeds, event.t - now, voltage)
        if event.measured is not None:
            method, values = event.measured
            estimate = getattr(ukf, method)(*values)
        return estimate

    def _replay(self, new: int) -> None:
        """Repeat the events after a new one, from the last snapshot before it on."""
        events = self._events
        first = next(i for i in range(new, -1, -1) if events[i].before is not None)
        for part, old in zip(self.ukf.memory, events[first].before or (), strict=True):
            part[:] = old
        now = events[first - 1].t if first else self._start
        self._snapped = now
        for i in range(first, len(events)):
            if i > first:
                due = now - self._snapped >= self.horizon / _SNAPSHOTS
                events[i].before = self._snapshot() if due else None
                self._snapped = now if due else self._snapped
            estimate = self._do(events[i], now)
            now = events[i].t
            if i == new:
                self.fused = estimate

    def _forget(self, until: float) -> None:
        """Drop events up to the last snapshot as old as ``until``, s."""
        events, last = self._events, 0
        for i in range(1, len(events)):
            if events[i - 1].t > until:
                break
            if events[i].before is not None:
                last = i
        if last:
            self._start = events[last - 1].t
            del events[:last]

    def _snapshot(self) -> Snapshot:
        return [part.copy() for part in self.ukf.memory]

    def _now(self, method: str) -> float:
        now = self.time
        if math.isnan(now):
            raise InputError(f"{method}: call reset with a first pose before")
        return now


def _seconds(method: str, t: float) -> float:
    """Return a time stamp as a number, to the nanosecond.

    Raises:
        InputError: it is not a finite number.
    """
    try:
        seconds = float(t)
    except (TypeError, ValueError):
        seconds = math.nan
    if not math.isfinite(seconds):
        raise InputError(f"{method}: t must be a finite time in s, got {t!r}")
    return round(seconds, _DIGITS)
