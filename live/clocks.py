"""Stamps of other clocks, on one time: the stream's.

The stream's time is the first sender's clock, in s. A clock from 1970 is set to begin at zero.
The filter's steps are the sender's, also where a simulator runs at half of real time. Stamps
of one clock never move against each other: the estimates equal the log's offline.

A message without a stamp gets the newest stamp before it, plus the time since then at the sender's
rate. A silence does not tell whether the sender's clock went on or a simulator was paused: 0.1 s of
each count. A rotor speed placed too early is held until the next one. One placed
too late carries the filter past the poses to come.

Stamps of a second clock (a camera's beside the autopilot's) are brought over by the lines of both
clocks (``clock_line``). After a jump of a clock (an autopilot boots again) the stream goes on from
its last time, once enough messages agree.
"""

from collections import deque

from .clock_line import ClockLine
from .messages import SECOND, Measurement
from .tallies import Tallies

# s: two kinds of messages whose clocks differ by less share one clock. Transport's delays are far
# shorter, and two devices switched on one after the other differ by far more.
_SAME = 1.0
# s: a stamp so far ahead of all others is no faster transport (the horizon bounds the past)
_AHEAD = 1.0
# messages in a row, and their s, for a clock's jump; a burst of delayed messages is shorter
_AGREEING = 20
_LASTING = 0.2
_SILENCE = SECOND // 10  # ns counted of a silence; the slowest ESC sends sooner
_JITTER = SECOND // 50  # ns, usual spread of a link's delays
_UNSTAMPED = 1.0  # s of poses without any stamp until the stream's time is ours
_EPOCH = 1e8  # s: larger stamps count from 1970; the stream's time then begins at zero
_REMEMBERED = 64  # stamps of a kind; a stamp among them is a double


class _Clock:
    """One sender's clock."""

    def __init__(self, shift: int, stamp: int, arrival: int, horizon: int) -> None:
        self.shift = shift  # ns, from stamps to the stream's time
        self.newest = stamp
        self.newest_arrival = arrival
        self.line = ClockLine(arrival, stamp, horizon)
        self.odd: list[Measurement] = []  # messages of a possible jump


class Clocks:
    """From stamps to the stream's time.

    Args:
        tallies: counts doubles, jumps and implausible times.
        horizon: largest age of a stamp, s.
        paced: messages arrive at the vehicle's own pace; arrivals of a file's lines mean nothing.
    """

    def __init__(self, tallies: Tallies, horizon: float, paced: bool = True) -> None:
        self._tallies = tallies
        self._paced = paced
        self._horizon = round(horizon * SECOND)
        self._clocks: list[_Clock] = []  # the first is the reference
        self._kinds: dict[str, tuple[_Clock, deque[int]]] = {}  # and the last stamps
        self._first_pose: int | None = None  # ns, arrival of the first pose without a stamp
        self._ours = False  # no message had a stamp: the reference is this machine's clock
        self._latest = 0  # ns, arrival of the newest message
        self._anew = False  # another sender is taken, without a stamp so far
        self.poses_at_jumps = 0  # left out before a jump was known
        self._awake = 0  # ns since the reference's newest stamp, without silences

    @property
    def count(self) -> int:
        """Number of clocks."""
        return len(self._clocks)

    @property
    def line(self) -> ClockLine | None:
        """The reference's line against this machine's clock; None: unknown."""
        has_line = self._clocks and self._paced and not self._ours
        return self._clocks[0].line if has_line else None

    @property
    def drift(self) -> float | None:
        """The reference's rate above this machine's clock, ppm; None: not known."""
        rate = None if self.line is None else self.line.mean_rate
        return None if rate is None else 1e6 * (rate - 1.0)

    def time(self, sample: Measurement) -> float | None:
        """Return a message's time of measurement in the stream, s; None: left out."""
        self._awake += min(max(sample.arrival - self._latest, 0), _SILENCE)
        self._latest = max(sample.arrival, self._latest)
        self._anew |= sample.anew
        if sample.stamp is None:
            return self._unstamped(sample)
        if sample.kind not in self._kinds:
            clock = self._clock_of(sample.stamp, sample.arrival)
            self._kinds[sample.kind] = clock, deque(maxlen=_REMEMBERED)
        clock, recent = self._kinds[sample.kind]
        if sample.stamp in recent:
            self._tallies.counts["doubled"] += 1
            return None
        reference = self._clocks[0]
        stamp = sample.stamp
        if not self._goes_on(clock, sample, stamp):
            return None
        self._anew = False
        recent.append(stamp)
        if self._paced:
            clock.line.add(sample.arrival, stamp)
        if stamp >= clock.newest:
            clock.newest = stamp
            clock.newest_arrival = sample.arrival
            self._awake = 0 if clock is reference else self._awake
        if clock is not reference:
            stamp = reference.line.stamp_of(clock.line.arrival_of(stamp))
        return 1e-9 * (stamp + reference.shift)

    def _unstamped(self, sample: Measurement) -> float | None:
        """Return the time of a message without a stamp; None: no clock is known yet."""
        arrival = sample.arrival
        if not self._clocks:
            if self._first_pose is None and sample.has_pose:
                self._first_pose = arrival
            if self._first_pose is None or arrival - self._first_pose < _UNSTAMPED * SECOND:
                return None
            self._ours = True
            self._tallies.say(
                "warning: no message has a stamp: each counts as measured when it came, at this "
                "machine's clock; delays of the link count as motion"
            )
            self._clocks.append(_Clock(-arrival, arrival, arrival, self._horizon))
        reference = self._clocks[0]
        if self._ours:
            return 1e-9 * (arrival + reference.shift)
        stamp = reference.newest
        line = reference.line
        if self._paced:
            stamp += round(self._awake * line.rate)
            if line.known:  # the newest may itself have come late
                stamp = max(stamp, min(line.stamp_of(arrival), stamp + _JITTER))
        return 1e-9 * (stamp + reference.shift)

    def _clock_of(self, stamp: int, arrival: int) -> _Clock:
        """Return the clock for the stamps of a new kind of message."""
        if self._clocks and not self._paced:
            return self._clocks[0]
        for clock in self._clocks:
            if abs(clock.line.delay(arrival, stamp)) < _SAME * SECOND:
                return clock
        shift = -stamp if not self._clocks and stamp > _EPOCH * SECOND else 0
        self._clocks.append(_Clock(shift, stamp, arrival, self._horizon))
        return self._clocks[-1]

    def _goes_on(self, clock: _Clock, sample: Measurement, stamp: int) -> bool:
        """Return whether a stamp is taken; a jump is taken once enough messages agree."""
        arrival = sample.arrival
        odd = clock.odd
        passed = max(arrival - clock.newest_arrival, 0) * max(clock.line.rate, 1.0)
        late = stamp < clock.newest - self._horizon
        ahead = self._paced and stamp - clock.newest > passed + _AHEAD * SECOND
        if not late and not ahead:
            odd.clear()
            return True
        # kinds of messages alternate, and some come late: stamps need not always rise
        if odd and not abs(stamp - (odd[-1].stamp or 0)) < _AHEAD * SECOND:
            odd.clear()
        odd.append(sample)
        agree = len(odd) >= _AGREEING and stamp > (odd[0].stamp or 0)
        if agree and self._paced:
            agree = arrival - odd[0].arrival > _LASTING * SECOND
        counts = self._tallies.counts
        if not (agree or self._anew):
            counts["implausible times" if ahead else "too late"] += 1
            return False
        counts["clock jumps"] += 1
        if late and len(odd) > 1:  # the messages before were not late
            counts["too late"] -= len(odd) - 1
            counts["implausible times"] += len(odd) - 1
            self.poses_at_jumps += sum(one.has_pose for one in odd[:-1])
        # the stream's time goes on by our time since the last message
        gone = max(round(clock.line.rate * (arrival - clock.newest_arrival)), 1_000_000)
        clock.shift += clock.newest - stamp + (gone if self._paced else 1_000_000)
        clock.newest = stamp
        clock.newest_arrival = arrival
        clock.line = ClockLine(arrival, stamp, self._horizon)
        odd.clear()
        return True
