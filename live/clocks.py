"""Stamps of clocks that are not ours, on one time: the stream's.

The stream's time is the first sender's clock itself, in s; it begins at zero where that clock
counts from 1970. What only one clock has stamped is so never moved about: its estimates are those
of the log offline. Stamps of a second clock (a camera's beside the autopilot's) are brought over by
how much earlier than here each of them reads: the least over the last half minute, since transport
only delays. That follows clocks that drift. A clock that jumps (an autopilot that boots again) goes
on where the stream was, once enough messages agree that it did.
"""

from collections import deque

from .messages import SECOND, Sample
from .tallies import Tallies

# s: clocks of two kinds of messages that read so much alike are one; far above transport's delays,
# far below what two devices that were switched on one after the other differ by
_SAME = 1.0
# s: a stamp that is so much ahead of all before is no faster transport; and how far a stamp may lie
# in the past is the horizon
_AHEAD = 1.0
# messages in a row, and s over which they come, that must agree that a clock has jumped; a burst of
# delayed messages is shorter
_AGREEING, _LASTING = 20, 0.2
_WINDOW = 30  # s, over which the least delay is looked for
_EPOCH = 1e8  # s: stamps above it are counted from 1970, and the stream's time begins at zero
_REMEMBERED = 64  # stamps of a kind, among which one that comes again is a double


class _Offset:
    """How much earlier a clock reads than ours, at the least delay of the last seconds."""

    def __init__(self) -> None:
        self._least: dict[int, int] = {}  # offset, ns, by the second of arrival
        self.first: tuple[int, int] | None = None  # arrival and offset, ns, at the beginning
        self.value = 0

    def add(self, arrival: int, offset: int) -> None:
        least, second = self._least, arrival // SECOND
        if self.first is None and len(least) == 5 and second not in least:
            self.first = arrival, min(least.values())
        least[second] = min(offset, least.get(second, offset))
        while (oldest := next(iter(least))) <= second - _WINDOW:
            del least[oldest]
        self.value = min(least.values())

    def drift(self) -> float | None:
        """Return by how much faster the clock runs than ours, in ppm; None: not known yet."""
        latest = list(self._least.items())[-5:]
        if self.first is None or len(latest) < 5:
            return None
        elapsed = latest[-1][0] - self.first[0] // SECOND
        if elapsed < 10:
            return None
        change = min(least for _, least in latest) - self.first[1]
        return -1e6 * change / (elapsed * SECOND)


class _Clock:
    """One sender's clock."""

    def __init__(self, shift: int, stamp: int, arrival: int) -> None:
        self.shift = shift  # ns, from stamps to the stream's time
        self.newest, self.newest_arrival = stamp, arrival
        self.offset = _Offset()
        self.odd: list[tuple[int, int]] = []  # stamps and arrivals that would be a jump


class Clocks:
    """From stamps to the stream's time.

    Args:
        tallies: where doubles, jumps and implausible times are counted.
        horizon: how far in the past a stamp may lie, s.
        paced: whether messages arrive at the vehicle's own pace; a file that is read at once says
            nothing by when it is read.
    """

    def __init__(self, tallies: Tallies, horizon: float, paced: bool = True) -> None:
        self._tallies, self._paced = tallies, paced
        self._horizon = round(horizon * SECOND)
        self._clocks: list[_Clock] = []  # the first is the reference
        self._kinds: dict[str, tuple[_Clock, deque[int]]] = {}  # and the last stamps

    @property
    def count(self) -> int:
        """How many clocks there are."""
        return len(self._clocks)

    @property
    def drift(self) -> float | None:
        """By how much faster the reference runs than this machine's clock, ppm; None: not known."""
        return self._clocks[0].offset.drift() if self._clocks and self._paced else None

    def time(self, sample: Sample) -> float | None:
        """Return when a message was measured, s of the stream's time; None where it is left out."""
        if sample.stamp is None:  # as if its delay were the least
            if not self._clocks:
                return None
            reference, arrival = self._clocks[0], sample.arrival
            stamp = arrival - reference.offset.value if self._paced else reference.newest
            return 1e-9 * (stamp + reference.shift)
        if sample.kind not in self._kinds:
            found = self._clock_of(sample.stamp, sample.arrival)
            self._kinds[sample.kind] = found, deque(maxlen=_REMEMBERED)
        clock, recent = self._kinds[sample.kind]
        if sample.stamp in recent:
            self._tallies.counts["doubled"] += 1
            return None
        if not self._goes_on(clock, sample.stamp, sample.arrival):
            return None
        recent.append(sample.stamp)
        if self._paced:
            clock.offset.add(sample.arrival, sample.arrival - sample.stamp)
        if sample.stamp > clock.newest:
            clock.newest, clock.newest_arrival = sample.stamp, sample.arrival
        reference = self._clocks[0]
        ahead = 0 if clock is reference else clock.offset.value - reference.offset.value
        return 1e-9 * (sample.stamp + ahead + reference.shift)

    def _clock_of(self, stamp: int, arrival: int) -> _Clock:
        """Return the clock that a new kind of message is stamped by."""
        if self._clocks and not self._paced:
            return self._clocks[0]
        for clock in self._clocks:
            if abs(arrival - stamp - clock.offset.value) < _SAME * SECOND:
                return clock
        shift = -stamp if not self._clocks and stamp > _EPOCH * SECOND else 0
        clock = _Clock(shift, stamp, arrival)
        clock.offset.add(arrival, arrival - stamp)
        self._clocks.append(clock)
        return clock

    def _goes_on(self, clock: _Clock, stamp: int, arrival: int) -> bool:
        """Return whether a stamp is taken: none is that would be a jump, until enough agree."""
        late = stamp < clock.newest - self._horizon
        ahead = self._paced and arrival - stamp < clock.offset.value - _AHEAD * SECOND
        if not late and not ahead:
            clock.odd.clear()
            return True
        if clock.odd and not 0 < stamp - clock.odd[-1][0] < _AHEAD * SECOND:
            clock.odd.clear()
        clock.odd.append((stamp, arrival))
        agree = len(clock.odd) >= _AGREEING
        if agree and self._paced:
            agree = arrival - clock.odd[0][1] > _LASTING * SECOND
        if not agree:
            self._tallies.counts["implausible times" if ahead else "too late"] += 1
            return False
        del clock.odd[:-1]
        self._tallies.counts["clock jumps"] += 1
        # the stream goes on for as long as passed here since the last message before
        passed = max(arrival - clock.newest_arrival, 1_000_000) if self._paced else 1_000_000
        clock.shift += clock.newest + passed - stamp
        clock.newest, clock.newest_arrival = stamp, arrival
        clock.offset = _Offset()
        clock.odd.clear()
        return True
