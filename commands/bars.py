"""Bars of progress: in a terminal they move; elsewhere, such as in a log of a build, a line comes
now and then.
"""

import threading
from typing import Any

from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from ..runtime.compile_notice import notice

_LINE_EVERY = 10.0  # s between two lines where bars cannot move


class What(TextColumn):
    """What is being done; while functions are compiled, how many."""

    def __init__(self) -> None:
        super().__init__("{task.description}")

    def render(self, task: Task) -> Text:
        """Return the text beside a bar."""
        return Text(notice.words) if notice.words else super().render(task)


class Bars(Progress):
    """Bars, or lines where there is no terminal.

    Args:
        columns: of each bar.
        console: of standard error.
    """

    def __init__(self, *columns: ProgressColumn, console: Console) -> None:
        moving = console.is_terminal and not console.quiet
        super().__init__(*columns, console=console, transient=True, disable=not moving)
        self._over = threading.Event()
        self._in_lines = not (moving or console.quiet)

    def start(self) -> None:
        """Show the bars."""
        super().start()
        if self._in_lines:
            threading.Thread(target=self._write_lines, name="progress", daemon=True).start()

    def stop(self) -> None:
        """Take the bars away."""
        self._over.set()
        super().stop()

    def _write_lines(self) -> None:
        while not self._over.wait(_LINE_EVERY):
            for task in self.tasks:
                if not task.finished:
                    self.console.print(_line(task), highlight=False, markup=False, soft_wrap=True)


def _line(task: Any) -> str:
    """Return how far a task is, in words."""
    done = ""
    if task.total:
        done = f", {task.completed / task.total:.0%}"
        if task.total > 1.0:
            done = f", {task.completed:.0f} of {task.total:.0f}"
    left = "" if not task.time_remaining else f", {task.time_remaining:.0f} s left"
    return f"{notice.words or task.description}{done}, {task.elapsed or 0.0:.0f} s so far{left}"
