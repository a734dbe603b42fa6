"""Progress: in a terminal bars move; elsewhere, such as in a log of a build, a line comes now and
then.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
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


@contextmanager
def bars(*columns: ProgressColumn, console: Console) -> Iterator[Progress]:
    """Show bars of these columns, or lines where there is no terminal; nothing on a quiet one."""
    moving, over = console.is_terminal and not console.quiet, threading.Event()
    with Progress(*columns, console=console, transient=True, disable=not moving) as progress:

        def write_lines() -> None:
            while not over.wait(_LINE_EVERY):
                for task in progress.tasks:
                    if not task.finished:
                        console.print(_line(task), highlight=False, markup=False, soft_wrap=True)

        if not (moving or console.quiet):
            threading.Thread(target=write_lines, name="progress", daemon=True).start()
        try:
            yield progress
        finally:
            over.set()


def _line(task: Any) -> str:
    """Return how far a task is, in words."""
    done = ""
    if task.total:
        done = f", {task.completed / task.total:.0%}"
        if task.total > 1.0:
            done = f", {task.completed:.0f} of {task.total:.0f}"
    left = "" if not task.time_remaining else f", {task.time_remaining:.0f} s left"
    return f"{notice.words or task.description}{done}, {task.elapsed or 0.0:.0f} s so far{left}"
