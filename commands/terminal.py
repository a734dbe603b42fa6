"""Shared by the commands: the terminal, the folder of results, and the words on both."""

import os
import shlex
import sys
import threading
import webbrowser
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment
from rich.table import Table

from ..runtime.errors import InputError
from ..runtime.printable import printable

_LINE_EVERY = 10.0  # s between two lines on progress where no bar can move


class _Terminal(Console):
    """A console that shows control characters, in names and texts of files, as escapes. All printed
    text comes through here.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the printed pieces of text and style of a thing."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)


# without emoji and markup: an address such as mavlink:radio://0/80 is no picture of a radio, and
# columns such as [x, y, z] are no style
console = _Terminal(emoji=False, markup=False)
errors = _Terminal(stderr=True, emoji=False, markup=False)


@dataclass
class _CommandRun:
    """The running command's record so far."""

    dry: bool = False
    written: list[Path] = field(default_factory=list)
    record: Path | None = None  # file with the origin of the results
    made: list[Path] = field(default_factory=list)  # folders, innermost first
    code: int = 0  # exit code of work that was ended and has a result all the same
    notes: bool = True  # whether notes on the input are told

    def begin(self, dry: bool = False) -> None:
        """Forget the command before."""
        self.dry, self.written, self.record, self.made, self.code = dry, [], None, [], 0

    def undo(self) -> None:
        """Remove the empty folders among those made for results."""
        with suppress(OSError):
            for folder in self.made:
                folder.rmdir()


run = _CommandRun()


class DryRun(Exception):  # noqa: N818 - the way out of a command whose request is good, no error
    """Ends a dry run where the work would begin."""

    def __init__(self, plan: Mapping[str, Any], out: Path) -> None:
        super().__init__("dry run")
        self.plan, self.out = plan, out


def command_line() -> str:
    """Return the user's command line, for a page or file with its origin."""
    return shlex.join(["windwrench", *sys.argv[1:]])


def gate_of(gate: float | None) -> float | None:
    """Return the probability of ``--gate``, or the default one; None: no gate.

    Raises:
        InputError: the gate is neither 0 nor a probability.
    """
    from ..identification.wrench_series import GATE

    if gate is None:
        return GATE
    if gate != 0.0 and not 0.5 <= gate < 1.0:
        raise InputError(f"--gate: expected 0, or a probability from 0.5 to below 1, got {gate:g}")
    return gate or None


def result_file(out: Path, usual: str, endings: Collection[str] = ()) -> Path:
    """Return the main result's file: ``--out`` itself with one of the ``endings``, or any where
    none is given; else the ``usual`` name in the folder ``--out``.
    """
    named = out.suffix in endings if endings else out.suffix
    return out if named and not os.path.isdir(out) else out / usual


def results_folder(out: Path, **plan: object) -> Path:
    """Make the results' folder before the work starts: no result is lost for want of a folder.

    Every command calls this once its request is checked and before its work begins: here a dry run
    ends.

    Args:
        out: the folder.
        plan: the work to come, for a dry run.

    Raises:
        InputError: there can be no such folder.
        DryRun: the command is not to do its work.
    """
    if run.dry:
        raise DryRun(plan, out)
    try:
        run.made = [folder for folder in (out, *out.parents) if not folder.exists()]
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot be made a folder: {error.strerror or error}"
        ) from error
    if not os.access(out, os.W_OK):
        raise InputError(f"--out {out}: is not writable")
    run.record = out / "run.json"
    return out


@contextmanager
def working(text: str, total: float = 1.0) -> Iterator[Callable[..., None]]:
    """Show the work at hand and the time of its rest. Give a function of the finished amount,
    another text, or a further amount.

    In a terminal a bar moves; elsewhere, such as in a log of a build, a line comes now and then.

    Args:
        text: names the work at hand.
        total: how much there is to do: 1 where shares are told.
    """
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        *([MofNCompleteColumn()] if total > 1.0 else []),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    moving, over = errors.is_terminal and not errors.quiet, threading.Event()
    with Progress(*columns, console=errors, transient=True, disable=not moving) as progress:
        progress.add_task(text, total=None)
        (task,) = progress.tasks

        def write_lines() -> None:
            while not (over.wait(_LINE_EVERY) or task.finished):
                errors.print(_line(task), highlight=False, soft_wrap=True)

        def report(
            done: float | None = None, text: str | None = None, more: float | None = None
        ) -> None:
            told = total if done is not None or more is not None else None
            progress.update(task.id, total=told, completed=done, description=text, advance=more)

        if not (moving or errors.quiet):
            threading.Thread(target=write_lines, name="progress", daemon=True).start()
        try:
            yield report
        finally:
            over.set()


def _line(task: Task) -> str:
    """Return how far a task is, in words."""
    done = ""
    if task.total:
        done = f", {task.completed / task.total:.0%}"
        if task.total > 1.0:
            done = f", {task.completed:.0f} of {task.total:.0f}"
    left = f", {task.time_remaining:.0f} s left" if task.time_remaining else ""
    return f"{task.description}{done}, {task.elapsed or 0.0:.0f} s so far{left}"


@contextmanager
def silently() -> Iterator[None]:
    """Print nothing of another command's output; its progress is shown."""
    quiet, console.quiet = console.quiet, True
    told, run.notes = run.notes, False
    try:
        yield
    finally:
        console.quiet, run.notes = quiet, told


def note(text: str) -> None:
    """Print notes on the input on standard error; a warning stands out."""
    if run.notes:
        errors.print(text, style="yellow" if text.startswith("warning") else "dim")


def show_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table without a cut word. Cells too wide for the terminal are folded at spaces.
    Columns still too many follow below, beside the first column again.
    """
    columns = list(zip(header, *rows, strict=True))
    full = [max(map(len, column)) for column in columns]
    least = [max(len(w) for text in column for w in (text.split() or [""])) for column in columns]
    shown = [0]
    for i in range(1, len(columns) + 1):
        if i < len(columns) and _width(least[k] for k in (*shown, i)) <= console.width:
            shown.append(i)
            continue
        widths = {k: full[k] for k in shown}
        while _width(widths.values()) > max(console.width, _width([1] * len(shown))):
            widths[max(shown, key=lambda k: (widths[k] > 1, widths[k] - least[k]))] -= 1
        table = Table(box=box.SIMPLE_HEAD)
        for k, width in widths.items():
            table.add_column(columns[k][0], width=width, overflow="fold")
        for row in zip(*(columns[k][1:] for k in shown), strict=True):
            table.add_row(*row)
        console.print(table)
        shown = [0, i]


def _width(columns: Iterable[int]) -> int:
    """Return the characters across a table from the widths of its columns."""
    return 1 + sum(width + 3 for width in columns)


def say(*paths: Path) -> None:
    """Print the written files."""
    run.written.extend(paths)
    for path in paths:
        console.print(f"wrote {path}", soft_wrap=True)


def show_page(path: Path, wanted: bool) -> None:
    """Print a page's place, and open the page in a browser if wanted and a display is there."""
    address = path.resolve().as_uri()
    console.print(f"page: {address}", soft_wrap=True)
    display = not sys.platform.startswith("linux") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if wanted and display and not console.quiet:
        with suppress(webbrowser.Error, OSError):
            webbrowser.open(address)
