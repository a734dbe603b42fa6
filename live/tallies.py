"""Counts of a stream, in constant memory."""

import math
import time
from collections import Counter, defaultdict, deque
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..estimator.consistency import Consistency
from ..runtime.errors import InputError
from .messages import Malformed

_BINS_PER_OCTAVE = 16
_QUANTILES = np.array([0.5, 0.99])
_WINDOW = 5_000_000_000  # ns of a rate


class _Durations:
    """Durations as a histogram with bins 4 % wide."""

    def __init__(self) -> None:
        self.longest = 1  # ns
        self._bins = np.zeros(64 * _BINS_PER_OCTAVE, int)

    def add(self, nanoseconds: int) -> None:
        """Count one."""
        self.longest = max(self.longest, nanoseconds)
        self._bins[int(_BINS_PER_OCTAVE * math.log2(max(nanoseconds, 1)))] += 1

    @property
    def median_and_most(self) -> tuple[float, float]:
        """Median and 99 % quantile, ms, or NaN; from any thread."""
        counts = np.cumsum(self._bins)
        if not counts[-1]:
            return math.nan, math.nan
        ends = np.exp2((np.searchsorted(counts, counts[-1] * _QUANTILES) + 1) / _BINS_PER_OCTAVE)
        median, most = (1e-6 * np.minimum(ends, self.longest)).tolist()
        return median, most


class Rate:
    """A rate over the last 5 s, and a count in all."""

    def __init__(self) -> None:
        self.count = 0
        self._arrivals: deque[int] = deque()  # ns, of the last 5 s

    def add(self, now: int) -> None:
        """Count one at ``now``, ns."""
        self.count += 1
        self._arrivals.append(now)
        while self._arrivals[0] < now - _WINDOW:
            self._arrivals.popleft()

    def hertz(self, now: int) -> float:
        """Return the rate over the last 5 s before ``now``, ns, or since the first arrival."""
        recent = [arrival for arrival in self._arrivals.copy() if arrival > now - _WINDOW]
        lasted = _WINDOW if len(recent) < self.count else now - recent[0] if recent else 0
        return 1e9 * len(recent) / max(lasted, 1_000_000_000)


class Tallies:
    """Counts of messages, of losses and of failures.

    Names of ``counts`` for messages: ``doubled`` (the same again), ``late`` (fused at an earlier
    time), ``too late`` (older than the horizon: left out), ``lost`` (missing in the sender's own
    count), ``malformed``, ``other senders`` (a second sender of the same quantity), ``clock
    jumps``, ``implausible times``, ``waiting`` (poses before any rotor speeds). For the source:
    ``stops`` (silent for a while). For the filter: ``refused`` (poses gated as outliers).

    For failures of this kit or its libraries: ``not decoded`` (messages), ``not read`` (reads of
    the link), ``not estimated`` (rows). For items not taken: ``not sent`` (by the link), ``not
    recorded`` (by the log), ``not told`` (by standard output), ``not drawn`` (by the terminal),
    ``not shown`` (events too fast for a browser), ``turned away`` (browsers beyond the most).
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._said: dict[str, bool] = {}  # lines for people: printed or not
        self.rates: defaultdict[str, Rate] = defaultdict(Rate)
        self.latency = _Durations()
        self.processor = _Durations()
        self.wrench = np.zeros((2, 6))  # sums of force, N, and torque, Nm, and of their squares
        self.consistency = Consistency()

    @property
    def found(self) -> dict[str, int]:
        """The counts above zero, from any thread."""
        return {name: n for name, n in list(self.counts.items()) if n}

    @property
    def hertz(self) -> dict[str, float]:
        """The rate of each kind of message, Hz, from any thread."""
        now = time.monotonic_ns()
        return {kind: rate.hertz(now) for kind, rate in list(self.rates.items())}

    def say(self, line: str) -> None:
        """Keep a line for people, once; from any thread."""
        self._said.setdefault(line, False)

    def news(self) -> list[str]:
        """Return the lines kept since the last call."""
        lines = [line for line, taken in self._said.copy().items() if not taken]
        self._said.update(dict.fromkeys(lines, True))
        return lines

    @contextmanager
    def spared(self, count: str, what: str) -> Iterator[None]:
        """Let the stream go on after a failure of the block: all are counted, the first is told.

        Raises:
            InputError: the user's mistake, no failure of ours.
            Malformed: the sender's mistake.
        """
        try:
            yield
        except (InputError, Malformed):
            raise
        except Exception as error:
            self.fail(count, what, error)

    def fail(self, count: str, what: str, error: Exception) -> None:
        """Count a failure, and say the first."""
        self.counts[count] += 1
        if self.counts[count] == 1:
            self.say(f"warning: {what}: {reason_of(error)}; the stream goes on")


def reason_of(error: Exception) -> str:
    """Return the reason of a failure, on a line."""
    error = error.__cause__ if isinstance(error.__cause__, OSError) else error
    reason = " ".join(str(getattr(error, "strerror", None) or error).split())[:200]
    return (
        reason if isinstance(error, InputError | OSError) else f"{type(error).__name__}: {reason}"
    )
