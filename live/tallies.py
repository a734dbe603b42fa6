"""What is counted while a stream runs, in memory that does not grow with it."""

import math
from bisect import bisect_left
from collections import Counter, defaultdict, deque
from itertools import accumulate

import numpy as np

from .messages import Array

_BINS_PER_OCTAVE = 16
_WINDOW = 5_000_000_000  # ns, over which a rate is told


class Durations:
    """How long something takes, as a histogram whose bins are 4 % wide."""

    def __init__(self) -> None:
        self.longest = 1  # ns
        self._bins: Counter[int] = Counter()

    def add(self, nanoseconds: int) -> None:
        """Count one."""
        self.longest = max(self.longest, nanoseconds)
        self._bins[int(_BINS_PER_OCTAVE * math.log2(max(nanoseconds, 1)))] += 1

    def quantile(self, share: float) -> float:
        """Return the duration, ms, that a share of them does not exceed; NaN: there is none."""
        bins = sorted(dict(self._bins).items())
        if not bins:
            return math.nan
        counts = list(accumulate(count for _, count in bins))
        last, _ = bins[bisect_left(counts, share * counts[-1])]
        return 1e-6 * min(math.exp2((last + 1) / _BINS_PER_OCTAVE), self.longest)


class Rate:
    """How often something comes: over the last 5 s, and in all."""

    def __init__(self) -> None:
        self.count = 0
        self._arrivals: deque[int] = deque()  # ns, of the last 5 s

    def add(self, now: int) -> None:
        """Count one that came ``now``, ns."""
        self.count += 1
        self._arrivals.append(now)
        while self._arrivals[0] < now - _WINDOW:
            self._arrivals.popleft()

    def hertz(self, now: int) -> float:
        """Return the rate over the last 5 s before ``now``, ns, or since the first of them came."""
        recent = [arrival for arrival in self._arrivals.copy() if arrival > now - _WINDOW]
        lasted = _WINDOW if len(recent) < self.count else now - recent[0] if recent else 0
        return 1e9 * len(recent) / max(lasted, 1_000_000_000)


class Means:
    """The mean wrench of a stream, and how much it varies."""

    def __init__(self) -> None:
        self._count = 0
        self._sums, self._squares = np.zeros(6), np.zeros(6)

    def add(self, wrench: Array) -> None:
        """Take in one of force, N, and torque, Nm, (6,)."""
        self._count += 1
        self._sums += wrench
        self._squares += wrench * wrench

    @property
    def mean(self) -> Array:
        """Mean (6,)."""
        return self._sums / max(self._count, 1)

    @property
    def deviation(self) -> Array:
        """Standard deviation (6,)."""
        return np.sqrt(np.maximum(self._squares / max(self._count, 1) - self.mean**2, 0.0))


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
        self.rates: defaultdict[str, Rate] = defaultdict(Rate)
        self.latency = Durations()
        self.processor = Durations()
        self.wrench = Means()
