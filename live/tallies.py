"""What is counted while a stream runs, in memory that does not grow with it."""

import math
from bisect import bisect_left
from collections import Counter, deque
from itertools import accumulate

_BINS_PER_OCTAVE = 16
_LOWEST = 100.0  # ns; shorter counts as this
_BINS = 512  # to 100 ns * 2^32, seven minutes


class Durations:
    """How long something takes, as a histogram whose bins are 4 % wide."""

    def __init__(self) -> None:
        self.count = 0
        self.longest = 0  # ns
        self._bins = [0] * _BINS

    def add(self, nanoseconds: int) -> None:
        """Count one."""
        self.count += 1
        self.longest = max(self.longest, nanoseconds)
        octaves = math.log2(max(nanoseconds, _LOWEST) / _LOWEST)
        self._bins[min(int(_BINS_PER_OCTAVE * octaves), _BINS - 1)] += 1

    def quantile(self, share: float) -> float:
        """Return the duration, ms, that a share of them does not exceed; NaN: there is none."""
        if not self.count:
            return math.nan
        i = bisect_left(list(accumulate(self._bins)), share * self.count)
        return 1e-6 * min(_LOWEST * math.exp2((i + 1) / _BINS_PER_OCTAVE), float(self.longest))


class Rate:
    """How often something comes: over the last seconds, and in all."""

    _SECONDS = 5

    def __init__(self) -> None:
        self.count = 0
        self._seconds: deque[list[int]] = deque(maxlen=self._SECONDS + 1)  # [second, count]

    def add(self, now: int) -> None:
        """Count one that came ``now``, ns."""
        self.count += 1
        second = now // 1_000_000_000
        if self._seconds and self._seconds[-1][0] == second:
            self._seconds[-1][1] += 1
        else:
            self._seconds.append([second, 1])

    def hertz(self, now: int) -> float:
        """Return the rate over the last whole seconds before ``now``, ns; over the first one, what
        has come so far.
        """
        second = now // 1_000_000_000
        seconds = list(self._seconds)
        if not seconds:
            return 0.0
        whole = [(s, n) for s, n in seconds if second - self._SECONDS <= s < second]
        # a second in which it began is no whole one
        whole = [(s, n) for s, n in whole if s > seconds[0][0]] or whole
        if not whole:
            return float(seconds[-1][1]) if seconds[-1][0] == second else 0.0
        return sum(n for _, n in whole) / (second - whole[0][0])


class Tallies:
    """Counts of what came, and of what became of it.

    The names of ``counts``: ``doubled`` (the same message again), ``late`` (measured before what
    was known already, and fused where it belongs), ``too late`` (older than the horizon: left out),
    ``lost`` (missing in the sender's own count, or in its regular times), ``malformed``, ``clock
    jumps``, ``implausible times``, ``waiting`` (poses that came while no rotor speeds were known),
    ``stops`` (times that the source was silent and came back), ``refused`` (poses that the gate
    took for outliers), ``not recorded``, ``not sent`` (estimates that the link did not take).
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.rates: dict[str, Rate] = {}
        self.latency = Durations()
        self.processor = Durations()

    def message(self, kind: str, now: int) -> None:
        """Count a message of a kind that came ``now``, ns."""
        rate = self.rates.get(kind)
        if rate is None:
            rate = self.rates[kind] = Rate()
        rate.add(now)
