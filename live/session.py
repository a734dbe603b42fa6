"""A stream from beginning to end: messages in, estimates out, a log beside it.

One thread does everything between a message's arrival and its estimate, one message after the
other. Recording and printing run behind an ``Outlet``, and views in threads of their own: a failure
or a stall there never reaches the stream.
"""

import gc
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..runtime.errors import InputError
from .clocks import Clocks
from .filtering import LiveFilter, LiveSettings, Output
from .messages import SECOND, Measurement, Row
from .outlets import WAITING, Outlet
from .rows import Joiner
from .sources.base import Source
from .watch import Watch

_VIEWED = 50.0  # estimates a second in a view
VIEWED = 1500  # in all: the last 30 s
SILENT = 0.5  # s without a message until a source counts as stopped
_POLL = 0.1  # s between two checks for the end
_TURN = 2e-4  # s of a turn of Python's threads: the longest wait of an arrival for the page


class Session:
    """One stream.

    Args:
        source: the messages, the vehicle and the counts.
        settings: the stream's.
        recording: takes the rows; None: no recording.
        telling: takes the estimates.
    """

    def __init__(
        self,
        source: Source,
        settings: LiveSettings | None = None,
        recording: Outlet[Row] | None = None,
        telling: Outlet[Output] | None = None,
    ) -> None:
        tallies = source.tallies
        self.source = source
        self.tallies = tallies
        self.recording = recording
        self.telling = telling
        self.filter = LiveFilter(source.vehicle, tallies, settings)
        self._settings = self.filter.settings
        self.clocks = Clocks(tallies, self._settings.horizon, source.paced)
        self._joiner = Joiner(source.vehicle, tallies)
        self.watch = Watch(tallies, self.clocks, self.filter)
        self._stop = threading.Event()
        self._first = self._last = time.monotonic_ns()  # of messages
        self._begun = 0.0  # s, time of the first estimate in the stream
        self._unrecorded: deque[Row] = deque(maxlen=WAITING)
        self._fresh: list[int] = []  # ns, arrivals of the estimates being sent
        self.output: Output | None = None
        # for views
        self._recent: deque[Output] = deque(maxlen=VIEWED)
        self.estimates = 0
        self.ended = ""  # why, in words

    @property
    def outlets(self) -> list[Outlet[Any]]:
        """The outlets of rows and estimates."""
        return [one for one in (self.recording, self.telling) if one is not None]

    @property
    def silence(self) -> float:
        """Time since the last message, s."""
        return 1e-9 * (time.monotonic_ns() - self._last)

    @property
    def seconds(self) -> float:
        """The stream's time since the first estimate, s."""
        return 0.0 if self.output is None else self.output.t - self._begun

    @property
    def recorded(self) -> int:
        """Number of recorded rows."""
        return 0 if self.recording is None else self.recording.sink.rows

    def since(self, t: float) -> list[Output]:
        """Return the estimates of the last 30 s later than ``t``, s; from any thread."""
        return [output for output in self._recent.copy() if output.t > t]

    def stop(self) -> None:
        """End the stream; from any thread."""
        self._stop.set()
        for outlet in self.outlets:
            outlet.patience = 0.0

    def run(self) -> None:
        """Open the source and estimate, until the source ends or ``stop`` is called.

        Raises:
            InputError: there is no such source, or its messages are of another kind.
        """
        try:
            self.source.open()
            for outlet in self.outlets:
                outlet.patience = self.source.patience
            self._first = self._last = time.monotonic_ns()
            with _undisturbed():
                while not self._stop.is_set() and self._once():
                    pass
            self.ended = self.ended or "it was stopped"
            for output in self.filter.begin():
                self._out(output)
            self._record()
            if not self.estimates and not self._stop.is_set():
                raise self._nothing("before it ended")
        finally:
            with self.tallies.spared("not read", self.source.name):
                self.source.close()
            for outlet in self.outlets:
                outlet.close()

    def _once(self) -> bool:
        """Handle the messages so far; return whether more may come."""
        samples: list[Measurement] | None = []
        failures = self.tallies.counts["not read"]
        with self.tallies.spared("not read", self.source.name):
            samples = self.source.receive(_POLL)
        if self.tallies.counts["not read"] > failures:
            self._stop.wait(_POLL)
        now = time.monotonic_ns()
        if samples is None:
            self.ended = "the source ended"
            return False
        if samples:
            silence = now - self._last > SILENT * SECOND
            if silence and self.tallies.rates and self.source.paced:
                self.tallies.counts["stops"] += 1
            self._last = now
            spent = time.thread_time_ns()
            for sample in samples:
                with self.tallies.spared("not estimated", f"a {sample.kind}"):
                    self.take(sample)
                if self._stop.is_set():
                    break
            out = time.monotonic_ns()
            spent = time.thread_time_ns() - spent
            for arrival in self._fresh:
                self.tallies.latency.add(out - arrival)
                self.tallies.processor.add(spent // len(self._fresh))
            self._fresh.clear()
            self._record()
            self.watch.look(now)
        wait = self._settings.wait
        if not self.estimates and wait and now - self._first > wait * SECOND:
            raise self._nothing(f"within {wait:g} s")
        return True

    def take(self, sample: Measurement) -> None:
        """Handle one message."""
        counts = self.tallies.counts
        self.tallies.rates[sample.kind].add(sample.arrival)
        late = counts["too late"]
        t = self.clocks.time(sample)
        row = None if t is None else self._joiner.take(sample, t)
        if row is not None:
            for output in self.filter.take(row):
                self._out(output)
                if output.row is row and self.source.paced:  # not a row held back
                    self._fresh.append(row.arrival)
            if self.recording is not None:
                self._unrecorded.append(row)
        if sample.has_pose:
            self.watch.count(max(counts["too late"] - late, 0))

    def _record(self) -> None:
        """Record the rows so far, after the first estimate is out."""
        while self.recording is not None and self.estimates and self._unrecorded:
            self.recording.put(self._unrecorded.popleft())

    def _out(self, output: Output) -> None:
        if not self.estimates:
            self._begun = output.t
        self.estimates += 1
        self.output = output
        self.watch.add(output)
        with self.tallies.spared("not sent", f"the answer to {self.source.name}"):
            self.source.send(output)
        self.tallies.wrench += output.wrench, output.wrench**2
        if self.telling is not None:
            self.telling.put(output)
        if not self._recent or output.t - self._recent[-1].t >= 1.0 / _VIEWED - 1e-6:
            self._recent.append(output)
        seconds = self._settings.seconds
        if seconds is not None and output.t - self._begun >= seconds - 1e-9:
            self.ended = f"{seconds:g} s have passed"
            self._stop.set()

    def _nothing(self, when: str) -> InputError:
        """Return the error for a stream without an estimate."""
        waiting = self.tallies.counts["waiting"]
        came = ", ".join(sorted(self.tallies.rates))
        bad = self.tallies.counts["malformed"]
        problems = self.source.problems
        if not came:
            problem = "no good message came" if bad else "no message came"
        elif waiting:
            problem = f"poses came ({came}), and no rotor speeds"
        else:
            problem = f"{came} came, which is no estimate yet"
        if problems:
            when += f"; {bad} malformed, the first: {problems[0]}"
        return InputError(f"{self.source.name}: {problem} {when}; expected {self.source.expected}")


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Let other threads give way soon, and keep present objects from the collector of garbage."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_TURN)
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)
