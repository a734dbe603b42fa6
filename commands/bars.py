"""Bars of progress: in a terminal they move; elsewhere, such as in a log of a build, a line comes
now and then.
"""

import threading
from typing import Any, ClassVar

from rich.console import Console
from rich.progress import Progress, ProgressColumn, TaskID

from ..runtime.compile_watch import Lines, watch

LINE_EVERY = 10.0  # s between two lines where bars cannot move


class Bars(Progress):
    """Bars that also show what is compiled meanwhile.

    Args:
        columns: of each bar.
        console: of standard error.
        every: s between two lines where there is no terminal.
    """

    _open: ClassVar[list["Bars"]] = []

    def __init__(
        self, *columns: ProgressColumn, console: Console, every: float = LINE_EVERY
    ) -> None:
        moving = console.is_terminal and not console.quiet
        super().__init__(*columns, console=console, transient=True, disable=not moving)
        self._every, self._over = every, threading.Event()
        self._in_lines = not (moving or console.quiet)
        self._compiling: TaskID | None = None

    def start(self) -> None:
        """Show the bars."""
        super().start()
        self._open.append(self)
        if self._in_lines:
            self._over.clear()
            threading.Thread(target=self._write_lines, name="progress", daemon=True).start()

    def stop(self) -> None:
        """Take them away."""
        self._over.set()
        if self in self._open:
            self._open.remove(self)
        super().stop()

    def _write_lines(self) -> None:
        while not self._over.wait(self._every):
            if watch.is_busy:
                continue  # and said on lines of its own
            for task in self.tasks:
                if not task.finished and task.id != self._compiling:
                    self.console.print(_line(task), highlight=False, markup=False, soft_wrap=True)

    def show_compiling(self, text: str | None) -> None:
        """Show what is compiled, or no more."""
        if text is None:
            if self._compiling is not None:
                self.remove_task(self._compiling)
            self._compiling = None
        elif self._compiling is None:
            self._compiling = self.add_task(text, total=None)
        else:
            self.update(self._compiling, description=text)


def _line(task: Any) -> str:
    """Return how far a task is, in words."""
    done = ""
    if task.total:
        done = f", {task.completed / task.total:.0%}"
        if task.total > 1.0:
            done = f", {task.completed:.0f} of {task.total:.0f}"
    left = "" if not task.time_remaining else f", {task.time_remaining:.0f} s left"
    return f"{task.description}{done}, {task.elapsed or 0.0:.0f} s so far{left}"


_plain = Lines()


def show_compiling(text: str | None, console: Console) -> None:
    """Show what is compiled in the bars that are open, or on lines of its own."""
    if console.quiet:
        return
    if console.is_terminal and Bars._open:
        Bars._open[-1].show_compiling(text)
    else:
        _plain(text)
