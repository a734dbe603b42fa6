"""What the commands share: the terminal, the results' folder, options that mean the same everywhere."""

import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ..dynamics.errors import InputError

console = Console()
errors = Console(stderr=True)

Out = Annotated[Path, typer.Option("--out", help="Folder for the results; it is made if need be.")]
VehicleOption = Annotated[str, typer.Option("--vehicle", help="Preset (ardrone2, crazyflie, hummingbird) or a YAML file.")]


def results_folder(out: Path) -> Path:
    """Make the results' folder before the work starts, so that no result is lost for want of it."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {out}: cannot be made a folder: {error.strerror or error}") from error
    if not os.access(out, os.W_OK):
        raise InputError(f"--out {out}: is not writable")
    return out


def progress_bar() -> Progress:
    """Return a bar that counts what is done and says how long the rest will take; it goes when the work is over."""
    return Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
                    console=errors, transient=True)


def names_in(text: str, option: str) -> list[str]:
    """Return the different names in a text with commas, in its order.

    Raises:
        InputError: there is none.
    """
    names = [part.strip() for part in text.split(",") if part.strip()]
    if not names:
        raise InputError(f"{option}: expected names with commas between them, got {text!r}")
    return list(dict.fromkeys(names))


def say(*paths: Path) -> None:
    """Say which files were written."""
    for path in paths:
        console.print(f"wrote {path}", highlight=False, soft_wrap=True, markup=False)
