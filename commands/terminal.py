"""What the commands share: terminal, folder of results, and options with one meaning everywhere."""

import os
import sys
import webbrowser
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment
from rich.table import Table

from ..runtime.errors import InputError
from ..runtime.printable import printable
from .bars import LINE_EVERY, Bars


class _Terminal(Console):
    """A console that shows what a terminal might act on, in names and texts of files, as escapes;
    whatever is printed comes through here.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the pieces of text and style that a thing is printed as."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text), style, control)


# without emoji: an address such as crazyflie:radio://0/80 is no picture of a radio
console = _Terminal(emoji=False, markup=False, highlight=False)
errors = _Terminal(stderr=True, emoji=False, markup=False, highlight=False)


@dataclass
class Run:
    """What the command that runs now has done so far."""

    dry: bool = False
    written: list[Path] = field(default_factory=list)
    record: Path | None = None  # where it is noted how the results came about
    made: list[Path] = field(default_factory=list)  # folders, innermost first
    code: int = 0  # exit code of work that was ended and has a result all the same

    def begin(self, dry: bool = False) -> None:
        """Forget the command before."""
        self.dry, self.written, self.record, self.made, self.code = dry, [], None, [], 0

    def undo(self) -> None:
        """Take the folders away again that were made for results and are empty."""
        with suppress(OSError):
            for folder in self.made:
                folder.rmdir()


run = Run()


class DryRun(Exception):  # noqa: N818 - the way out of a command whose request is good, no error
    """Ends a dry run where the work would begin."""

    def __init__(self, plan: Mapping[str, Any], out: Path) -> None:
        super().__init__("dry run")
        self.plan, self.out = plan, out


def offering(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return what completes a name, or the last of several with commas, in a shell; ``names`` is
    only called there.
    """

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [f"{before}{comma}{name}" for name in names() if name.startswith(last)]

    return complete


def vehicle_names() -> list[str]:
    """Return the vehicles that come with the kit."""
    from ..dynamics.vehicle_file import preset_names

    return preset_names()


def effect_names() -> Iterable[str]:
    """Return the effects of the library."""
    from ..dynamics.effects import names

    return names()


def scenario_names() -> Iterable[str]:
    """Return the scenarios of the task."""
    from ..envs.scenarios import SCENARIOS

    return SCENARIOS


def controller_names() -> Iterable[str]:
    """Return the controllers that come with the kit, trained policies among them."""
    from ..controllers import CONTROLLERS
    from ..controllers.shipped import shipped_policies

    return [*CONTROLLERS, *shipped_policies()]


def task_names() -> Iterable[str]:
    """Return the tasks that have a leaderboard."""
    from ..controllers.task_laws import TASK_LAWS

    return ["FanTracking", *TASK_LAWS]


def reader_names() -> Iterable[str]:
    """Return the readers of other log formats."""
    from ..identification.logs.readers import READERS

    return READERS


def map_names() -> Iterable[str]:
    """Return the maps of tables that come with the kit."""
    from ..identification.logs import log_map

    return log_map.map_names()


Out = Annotated[
    Path, typer.Option("--out", help="Folder for the results; created if it does not exist.")
]
VehicleOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        help="Vehicle: a preset (ardrone2, crazyflie, hummingbird) or a YAML file.",
        autocompletion=offering(vehicle_names),
    ),
]
ReaderOption = Annotated[
    str | None,
    typer.Option(
        "--reader",
        help="Reader of the log, where another is wanted than what is in the file says: "
        "px4_ulog, ardupilot_bin, betaflight[:MAGNET_POLES], crazyflie_sd, rosbag[:TOPICS.yaml] "
        "and so on (docs/readers.md).",
        autocompletion=offering(reader_names),
    ),
]
MapOption = Annotated[
    str | None,
    typer.Option(
        "--map",
        help="What the columns of another table mean: a YAML file, or a map that comes with the "
        "kit (betaflight, cflib, crazypad, euler-pwm, neurobem, rpm). windwrench check proposes "
        "one.",
        autocompletion=offering(map_names),
    ),
]


Without = Annotated[
    list[str] | None,
    typer.Option(
        "--without",
        help="Effect to leave out of the library; may be repeated.",
        autocompletion=offering(effect_names),
    ),
]
Gate = Annotated[
    float | None,
    typer.Option(
        "--gate",
        help="Refuse poses that jump and are less likely than 1 minus this; 0: refuse none. "
        "Default: 0.9999.",
    ),
]


def checked_gate(gate: float) -> float:
    """Return a gate: 0, or a probability.

    Raises:
        InputError: the gate is neither.
    """
    if gate != 0.0 and not 0.5 <= gate < 1.0:
        raise InputError(f"--gate: expected 0, or a probability from 0.5 to below 1, got {gate:g}")
    return gate


def results_folder(out: Path, **plan: object) -> Path:
    """Make the results' folder, before the work starts, so that no result is lost for want of it.

    Every command calls this once its request is checked and before its work begins: here a dry run
    ends.

    Args:
        out: the folder.
        plan: what is about to be done, for a dry run.

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


def progress_bar() -> Progress:
    """Return a bar that counts what is done and says how long the rest will take; it goes when the
    work is over.
    """
    return Bars(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
        console=errors,
    )


def share_bars() -> Progress:
    """Return bars for shares of work between 0 and 1, with the time that is left; they go when the
    work is over.
    """
    return Bars(
        TextColumn("{task.description:18}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=errors,
    )


@contextmanager
def share_bars_by_part() -> Iterator[Callable[[str, float], None]]:
    """Show a bar for each part of the work from when its first share is told: ``(part, share)``."""
    with share_bars() as progress:
        tasks: dict[str, TaskID] = {}

        def report(part: str, share: float) -> None:
            if part not in tasks:
                tasks[part] = progress.add_task(part, total=1.0)
            progress.update(tasks[part], completed=share)

        yield report


@contextmanager
def working(text: str, every: float = LINE_EVERY) -> Iterator[Callable[..., None]]:
    """Show what is being done; give a function that takes the share done so far, another text, or
    both. Where there is no terminal a line comes ``every`` so many s.
    """
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=errors, every=every) as progress:
        task = progress.add_task(text, total=None)

        def report(share: float | None = None, text: str | None = None) -> None:
            if share is not None:
                progress.update(task, total=1.0, completed=share)
            progress.update(task, description=text)

        yield report


def names_in(text: str, option: str) -> list[str]:
    """Return the different names in a text with commas, in its order.

    Raises:
        InputError: there is none.
    """
    names = [part.strip() for part in text.split(",") if part.strip()]
    if not names:
        raise InputError(f"{option}: expected names with commas between them, got {text!r}")
    return list(dict.fromkeys(names))


def note(text: str) -> None:
    """Say on standard error what is worth knowing about the input; a warning stands out."""
    errors.print(text, style="yellow" if text.startswith("warning") else "dim")


def show_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table."""
    table = Table(*header, box=box.SIMPLE_HEAD)
    for row in rows:
        table.add_row(*row)
    console.print(table)


def say(*paths: Path) -> None:
    """Say which files were written."""
    run.written.extend(paths)
    for path in paths:
        console.print(f"wrote {path}", soft_wrap=True)


def show_page(path: Path, wanted: bool) -> None:
    """Say where a page is, and open it in a browser if that is wanted and a display is there."""
    address = path.resolve().as_uri()
    console.print(f"page: {address}", soft_wrap=True)
    display = not sys.platform.startswith("linux") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if wanted and display and not console.quiet:
        with suppress(webbrowser.Error, OSError):
            webbrowser.open(address)
