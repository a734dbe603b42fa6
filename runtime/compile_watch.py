"""Telling what is compiled and for how long, where that takes more than a moment.

``runtime.compiled`` says what it has compiled; this module imports nothing heavy, so a command can
say where to show it before anything else.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

PATIENCE = 2.0  # s of compiling, after which it is told
_LOOK = 0.25  # s between two looks at what is compiled
_PAUSE = 1.0  # s without compiling, after which it is over
_LINE_EVERY = 4.0  # s between two lines where lines cannot be written over

Sink = Callable[[str | None], None]  # takes what to show now; None: it is over


class Lines:
    """Shows it on a stream: one line written over and over in a terminal, else a line every 4 s."""

    def __init__(self, stream: Callable[[], TextIO] = lambda: sys.stderr) -> None:
        self._stream, self._width, self._last = stream, 0, -_LINE_EVERY

    def __call__(self, text: str | None) -> None:
        """Show a text, or take it away."""
        stream = self._stream()
        if stream.isatty():
            line = "" if text is None else f"windwrench: {text}"
            ending = "\r" if text is None else ""
            print(f"\r{line:<{self._width}}", end=ending, file=stream, flush=True)
            self._width = len(line)
        elif text is not None and time.monotonic() - self._last >= _LINE_EVERY:
            print(f"windwrench: {text}", file=stream, flush=True)
            self._last = time.monotonic()


class CompileWatch:
    """Knows what is compiled now, and tells a sink.

    Args:
        sink: takes what to show.
        patience: s of compiling, after which it is told.
    """

    def __init__(self, sink: Sink, patience: float = PATIENCE) -> None:
        self.sink, self._patience = sink, patience
        self._lock = threading.Lock()
        self._names: list[str] = []  # functions, the outermost first
        self._thread: threading.Thread | None = None
        self._begun = self._ended = 0.0
        self._told = False  # that it happens once

    @property
    def is_busy(self) -> bool:
        """Whether something is compiled now."""
        return bool(self._names)

    def begin(self, name: str) -> None:
        """Note that something of this name is compiled from now on."""
        with self._lock:
            self._names.append(name)
            if self._thread is None:
                self._begun = time.monotonic()
                self._thread = threading.Thread(target=self._watch, name="compiling", daemon=True)
                self._thread.start()

    def end(self) -> None:
        """Note that what began last is done."""
        with self._lock:
            self._names.pop()
            self._ended = time.monotonic()

    def _watch(self) -> None:
        shown = False
        while True:
            time.sleep(min(_LOOK, self._patience))
            with self._lock:
                now = time.monotonic()
                if not self._names and now - self._ended > _PAUSE:
                    self._thread = None
                    break
                name, seconds = "".join(self._names[:1]), now - self._begun
            if name and seconds > self._patience:
                self.sink(self._words(name, seconds))
                shown = True
        if shown:
            self.sink(None)

    def _words(self, name: str, seconds: float) -> str:
        if self._told:
            # in a terminal this takes the other's place at once: it says "once", too
            return f"compiling, once: {seconds:.0f} s, now {name.strip('_')}"
        self._told = True
        return "compiling, once for this installation; later starts load it"


watch = CompileWatch(Lines())


@contextmanager
def compiling(name: str) -> Iterator[None]:
    """Count the block as compiling: what another process does."""
    watch.begin(name)
    try:
        yield
    finally:
        watch.end()
