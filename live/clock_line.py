"""One sender's clock against ours: its rate, and the least delay of its messages.

``arrival = stamp / rate + offset + delay``. Transport only delays: the line of a clock lies below
all its messages. The rate is the median of slopes over half a second: bursts and pauses are few
among them. A device's clock agrees with ours to 1e-4. Its offset is the least of 30 s and outlasts
a busy link. A simulator's clock may change its rate at any time. Its offset is the least of 1 s.
"""

from collections import deque
from statistics import median

from .messages import SECOND

_BIN = SECOND // 4  # ns; each bin keeps its message with the least delay
_KEPT = 120  # bins: a device's
_NEAR = 4  # and a simulator's
_SLOPES = 12  # bins for the rate, 3 s
_MEAN = 20  # bins, 5 s, for the mean rate
_LONG = 40  # 10 s, for the latest rate
_DEVICE = 0.002  # largest measured difference of a device's rate, with jitter of 5 ms
_SLOWEST = 0.01
_FASTEST = 100.0


class ClockLine:
    """The line of a clock.

    Args:
        arrival: time of the first message, ns.
        stamp: the first message's, ns.
        horizon: largest delay, ns; after a second of longer delays the clock stood still.
    """

    def __init__(self, arrival: int, stamp: int, horizon: int) -> None:
        self.rate = 1.0  # the sender's seconds in one of ours
        self.known = False  # whether the rate was measured
        self._horizon = horizon
        self._last = arrival
        self._base = arrival, stamp  # on the line
        self._low = deque([self._base], maxlen=_KEPT)  # the least delayed of each bin
        self._first: tuple[int, int] | None = None  # the least delayed message of the first 5 s

    def add(self, arrival: int, stamp: int) -> None:
        """Take in a message, ns."""
        silence = arrival - self._last
        self._last = max(arrival, self._last)
        if min(silence, self.delay(arrival, stamp)) > self._horizon:
            # the clock stood still, or the link held messages back: then the last one is early
            self._low = deque([(arrival, stamp)], maxlen=_KEPT)
            self._base = (arrival, stamp)
            return
        low = self._low
        if arrival // _BIN > low[-1][0] // _BIN:
            low.append((arrival, stamp))
            self._fit()
        elif self.delay(arrival, stamp) < self._later(low[-1]):
            low[-1] = arrival, stamp
        if self.delay(arrival, stamp) < 0.0:
            self._base = arrival, stamp

    def delay(self, arrival: int, stamp: int) -> float:
        """Return the delay of a message beyond the line, ns."""
        a, s = self._base
        return (arrival - a) - (stamp - s) / self.rate

    def arrival_of(self, stamp: int) -> int:
        """Return the arrival of a stamp at the least delay, ns."""
        a, s = self._base
        return a + round((stamp - s) / self.rate)

    def stamp_of(self, arrival: int) -> int:
        """Return the stamp of an arrival at the least delay, ns."""
        a, s = self._base
        return s + round((arrival - a) * self.rate)

    @property
    def mean_rate(self) -> float | None:
        """The rate since the first message; None: not known within 10 s."""
        if self._first is None:
            return None
        last = min(list(self._low)[-_MEAN:], key=_offset)
        elapsed = last[0] - self._first[0]
        return (last[1] - self._first[1]) / elapsed if elapsed > 10 * SECOND - _BIN else None

    @property
    def latest_rate(self) -> float | None:
        """The rate over the last 10 s with messages; None: not known yet."""
        low = self._low
        if len(low) <= _LONG:
            return None
        a0, s0 = low[-1 - _LONG]
        a1, s1 = low[-1]
        return (s1 - s0) / (a1 - a0)

    def _fit(self) -> None:
        """Place the line anew, once a bin is full."""
        low = list(self._low)
        recent = low[-2 - _SLOPES : -1]  # the last bin has but begun
        pairs = zip(recent[:-2], recent[2:], strict=True)
        slopes = [(s1 - s0) / (a1 - a0) for (a0, s0), (a1, s1) in pairs]
        if slopes:
            self.known = True
            rate = min(max(median(slopes), _SLOWEST), _FASTEST)
            self.rate = 1.0 if abs(rate - 1.0) < _DEVICE else rate
        if self._first is None and len(low) > _MEAN:
            self._first = min(low[:_MEAN], key=_offset)
        near = min(low[-1 - _NEAR :], key=self._later)
        least = min(low, key=self._later)
        if self.rate != 1.0:
            self._base = near
        elif self._later(near) - self._later(least) > self._horizon:  # the clock stood still
            self._low = deque(low[-1 - _NEAR :], maxlen=_KEPT)
            self._base = near
        else:
            self._base = least

    def _later(self, message: tuple[int, int]) -> float:
        return self.delay(*message)


def _offset(message: tuple[int, int]) -> int:
    return message[0] - message[1]
