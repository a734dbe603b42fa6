"""A stream from beginning to end: messages in, estimates out, a log beside it.

Everything between a message's arrival and its estimate is done in one thread, one message after the
other; whoever shows the estimates looks at ``snapshot`` from another.
"""

import gc
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from ..runtime.errors import InputError
from .clocks import Clocks
from .filtering import LiveFilter, LiveSettings, Output
from .messages import Row, Sample
from .recorder import Recorder
from .rows import Joiner
from .sources.base import Source

_SECOND = 1_000_000_000  # ns
_VIEW_SECONDS, _VIEWED = 30.0, 50.0  # what a view shows: so long, and so often a second
SILENT = 0.5  # s without a message after which a source has stopped
_POLL = 0.1  # s between two looks at whether to end
_TURN = 2e-4  # s after which Python's threads take turns: an arrival waits no longer for the page


@dataclass
class Snapshot:
    """What there is to show, now."""

    output: Output | None
    rates: dict[str, float]  # Hz, by kind of message
    counts: dict[str, int]
    silence: float  # s since the last message
    latency_ms: tuple[float, float]  # median and 99 % quantile
    processor_ms: tuple[float, float]  # likewise, of a row's own processor time, but its recording
    drift_ppm: float | None
    clocks: int
    estimates: int
    restarts: int
    recorded: int  # rows
    seconds: float  # of the stream's time, since it began


class Session:
    """One stream.

    Args:
        source: of messages; it states the vehicle and counts.
        settings: of the stream.
        recorder: where rows are recorded; None: nowhere.
        tell: called with each estimate, in the stream's thread.
        flush: called when all that has come is dealt with.
    """

    def __init__(
        self,
        source: Source,
        settings: LiveSettings | None = None,
        recorder: Recorder | None = None,
        tell: Callable[[Output], None] = lambda output: None,
        flush: Callable[[], None] = lambda: None,
    ) -> None:
        tallies = source.tallies
        self.source, self.tallies, self.recorder = source, tallies, recorder
        self.filter = LiveFilter(source.vehicle, tallies, settings)
        self._settings = self.filter.settings
        self._clocks = Clocks(tallies, self._settings.horizon, source.paced)
        self._joiner = Joiner(source.vehicle, tallies)
        self._tell, self._flush = tell, flush
        self._stop = threading.Event()
        self._first = self._last = time.monotonic_ns()  # of messages
        self._begun = 0.0  # s, stream's time of the first estimate
        self._unrecorded: list[Row] = []
        self._fresh: list[int] = []  # ns, arrivals whose estimates are being told
        self.output: Output | None = None
        # what a view shows
        self._recent: deque[Output] = deque(maxlen=round(_VIEW_SECONDS * _VIEWED))
        self.estimates = 0
        self.ended = ""  # why, in words

    def since(self, t: float) -> list[Output]:
        """Return the estimates of the last 30 s that lie after ``t``, s, from any thread."""
        return [output for output in self._recent.copy() if output.t > t]

    def stop(self) -> None:
        """Have the stream end; from any thread."""
        self._stop.set()

    def run(self) -> None:
        """Open the source and deal with all that comes, until it ends or ``stop`` is called.

        Raises:
            InputError: there is no such source, what comes is none of its messages, or the log
                cannot be written.
        """
        try:
            self.source.open()
            self._first = self._last = time.monotonic_ns()
            with _undisturbed():
                while not self._stop.is_set():
                    if not self._once():
                        break
                else:
                    self.ended = self.ended or "it was stopped"
            for output in self.filter.begin():
                self._out(output)
            self._flush()
            if not self.estimates and not self._stop.is_set():
                raise self._nothing("before it ended")
        finally:
            self.source.close()
            if self.recorder is not None and self.estimates:
                self._record()
                self.recorder.close()

    def _once(self) -> bool:
        """Deal with what has come; return whether there may be more."""
        samples = self.source.receive(_POLL)
        now = time.monotonic_ns()
        if samples is None:
            self.ended = "the source ended"
            return False
        if samples:
            silence = now - self._last > SILENT * _SECOND
            if silence and self.tallies.rates and self.source.paced:
                self.tallies.counts["stops"] += 1
            self._last = now
            spent = time.thread_time_ns()
            for sample in samples:
                self.take(sample)
                if self._stop.is_set():
                    break
            self._flush()
            out, spent = time.monotonic_ns(), time.thread_time_ns() - spent
            for arrival in self._fresh:
                self.tallies.latency.add(out - arrival)
                self.tallies.processor.add(spent // len(self._fresh))
            self._fresh.clear()
            self._record()
        elif self.recorder is not None:
            self.recorder.idle(1e-9 * (now - self._last))
        wait = self._settings.wait
        if not self.estimates and wait and now - self._first > wait * _SECOND:
            raise self._nothing(f"within {wait:g} s")
        return True

    def take(self, sample: Sample) -> None:
        """Deal with one message."""
        self.tallies.rates[sample.kind].add(sample.arrival)
        t = self._clocks.time(sample)
        row = None if t is None else self._joiner.take(sample, t)
        if row is not None:
            self._take_row(row)

    def _take_row(self, row: Row) -> None:
        for output in self.filter.take(row):
            self._out(output)
            if output.row is row and self.source.paced:  # not one that was held back
                self._fresh.append(row.arrival)
        if self.recorder is not None:
            self._unrecorded.append(row)

    def _record(self) -> None:
        """Record the rows that came, once their estimates are out."""
        if self.recorder is not None:
            for row in self._unrecorded:
                self.recorder.add(row)
            self._unrecorded.clear()

    def _out(self, output: Output) -> None:
        if not self.estimates:
            self._begun = output.t
        self.estimates += 1
        self.output = output
        try:
            self.source.send(output)
        except OSError:
            self.tallies.counts["not sent"] += 1
        self.tallies.wrench.add(output.wrench)
        self._tell(output)
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
        if not came:
            found = "no message came"
        elif waiting:
            found = f"poses came ({came}), and no rotor speeds"
        else:
            found = f"{came} came, which is no estimate yet"
        return InputError(f"{self.source.name}: {found} {when}; expected {self.source.expected()}")

    def snapshot(self) -> Snapshot:
        """Return what there is to show, from any thread."""
        now = time.monotonic_ns()
        latency, processor = self.tallies.latency, self.tallies.processor
        return Snapshot(
            output=self.output,
            rates={kind: rate.hertz(now) for kind, rate in list(self.tallies.rates.items())},
            counts={name: n for name, n in list(self.tallies.counts.items()) if n},
            silence=1e-9 * (now - self._last),
            latency_ms=(latency.quantile(0.5), latency.quantile(0.99)),
            processor_ms=(processor.quantile(0.5), processor.quantile(0.99)),
            drift_ppm=self._clocks.drift,
            clocks=self._clocks.count,
            estimates=self.estimates,
            restarts=self.filter.restarts,
            recorded=0 if self.recorder is None else self.recorder.rows,
            seconds=0.0 if self.output is None else self.output.t - self._begun,
        )


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Have other threads give way soon, and the collector of garbage leave what is there alone."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_TURN)
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)
