"""Threads that pass rows and estimates on: the stream hands an item over and goes on, whether the
sink takes the item, takes time, or fails.
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
# items waiting for a sink: 41 s at 200 Hz, 10 MB of rows; a disk wakes and a card erases sooner
WAITING = 8192
_LAST = 5.0  # s for a slow sink at the end of a stream; a healthy one needs ms


class Sink(ABC, Generic[Item]):
    """A taker of items; may stall or fail."""

    name = ""  # for people
    lost = ""  # name in the counts of items not taken
    pause = 0.0  # s without an item until ``idle`` is called
    rows = 0  # taken for good
    held = 0  # taken, and lost after a failure

    @abstractmethod
    def add(self, item: Item, /) -> None:
        """Take an item."""

    def idle(self) -> None:
        """Finish the items so far, in a pause."""

    def end(self) -> None:
        """Finish the items: no further ones come."""
        self.idle()

    def close(self) -> None:
        """Close files, after the end or a failure."""


class Outlet(Generic[Item]):
    """Hands items to a sink.

    Args:
        sink: takes the items in their order.
        tallies: counts and names lost items.
        failed: called once the sink has failed, in its thread.
        waiting: most items held for the sink.
    """

    def __init__(
        self,
        sink: Sink[Item],
        tallies: Tallies,
        failed: Callable[[], object] = lambda: None,
        waiting: int = WAITING,
    ) -> None:
        self.sink = sink
        self.problem = ""
        self.patience = 0.0  # s of waiting for room; more than 0 if the source waits too
        self._tallies = tallies
        self._failed = failed
        self._waiting = waiting
        self._held: deque[Item] = deque()
        self._changed = threading.Condition()
        self._over = self._stalls = False
        self._thread = threading.Thread(target=self._run, daemon=True, name=sink.name)
        self._thread.start()

    def put(self, item: Item) -> None:
        """Hand an item over; without room the item is left out and counted."""
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
        """Let the sink take the held items, for up to ``wait`` s, and end."""
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
        """End, count the lost items, and say so."""
        with self._changed:
            self.problem = problem
            self._tallies.counts[self.sink.lost] += self.sink.held + len(self._held)
            self._held.clear()
            self._changed.notify_all()
        self._tallies.say(
            f"warning: {self.sink.name}: {problem}; {self.sink.rows} rows came through before"
        )
        self._failed()
