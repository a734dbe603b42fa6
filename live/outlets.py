"""Where rows and estimates go, in a thread of its own: the stream hands them over and goes on,
whether they are taken, taken slowly, or not at all.
"""

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, TypeVar

from .tallies import Tallies, reason_of

Item = TypeVar("Item")
# that wait for a sink: 41 s at 200 Hz, longer than a disk takes to wake or a card to erase; about
# 10 MB of rows
WAITING = 8192
_LAST = 5.0  # s that the end of a stream waits for a sink that still takes; a healthy one needs ms


class Sink(ABC, Generic[Item]):
    """What takes items, and may stall or fail."""

    name = ""  # for people
    lost = ""  # as what the items are counted that it does not take
    pause = 0.0  # s without an item after which it is idle
    rows = 0  # taken for good
    held = 0  # taken, and lost if it fails

    @abstractmethod
    def add(self, item: Item, /) -> None:
        """Take an item."""

    def idle(self) -> None:
        """Finish what was taken: nothing has come for a while."""

    def end(self) -> None:
        """Finish what was taken: nothing comes any more."""
        self.idle()

    def close(self) -> None:
        """Let go of what is open, after the end or a failure."""


class Outlet(Generic[Item]):
    """Hands items to a sink.

    Args:
        sink: that takes them, in the order in which they come.
        tallies: where what it does not take is counted and said.
        failed: called once the sink has failed, in its thread.
        waiting: items that wait for the sink, at most.
    """

    def __init__(
        self,
        sink: Sink[Item],
        tallies: Tallies,
        failed: Callable[[], object] = lambda: None,
        waiting: int = WAITING,
    ) -> None:
        self.sink, self.problem = sink, ""
        self.patience = 0.0  # s that the stream waits for room, where its source waits for it
        self._tallies, self._failed, self._waiting = tallies, failed, waiting
        self._held: deque[Item] = deque()
        self._changed = threading.Condition()
        self._over = self._stalls = False
        self._thread = threading.Thread(target=self._run, daemon=True, name=sink.name)
        self._thread.start()

    def put(self, item: Item) -> None:
        """Hand an item over; where there is no room for it, it is left out and counted."""
        with self._changed:
            begun = time.monotonic()
            while self._full() and not self._stalls and time.monotonic() - begun < self.patience:
                self._changed.wait(0.1)
            if self.problem or self._full():
                self._tallies.counts[self.sink.lost] += 1
                if not self.problem and not self._stalls:
                    self._stalls = True
                    self._tallies.say(
                        f"warning: {self.sink.name} stalls; what comes until it goes on is left out"
                    )
            else:
                self._held.append(item)
                self._changed.notify_all()

    def close(self, wait: float = _LAST) -> None:
        """Have the sink take what is held, for up to ``wait`` s, and end."""
        with self._changed:
            self._over = True
            self._changed.notify_all()
        self._thread.join(wait)
        if self._thread.is_alive():
            self._end(f"still stalls {wait:g} s after the end")

    def _full(self) -> bool:
        return len(self._held) >= self._waiting and not self.problem

    def _run(self) -> None:
        problem = ""
        try:
            while self._next():
                with self._changed:
                    item = self._held.popleft()
                    self._stalls = False
                    self._changed.notify_all()
                self.sink.add(item)
            self.sink.end()
        except Exception as error:
            problem = reason_of(error)
        with suppress(OSError):
            self.sink.close()
        if problem:
            self._end(problem)

    def _next(self) -> bool:
        """Wait for an item; return whether there is one."""
        with self._changed:
            if self._changed.wait_for(lambda: self._held or self._over, self.sink.pause):
                return bool(self._held)
        self.sink.idle()
        with self._changed:
            self._changed.wait_for(lambda: self._held or self._over)
            return bool(self._held)

    def _end(self, problem: str) -> None:
        """Take nothing more, count what is lost by it, and say so."""
        with self._changed:
            self.problem = problem
            self._tallies.counts[self.sink.lost] += self.sink.held + len(self._held)
            self._held.clear()
            self._changed.notify_all()
        self._tallies.say(
            f"warning: {self.sink.name}: {problem}; {self.sink.rows} rows came through before"
        )
        self._failed()
