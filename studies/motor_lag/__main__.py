"""``python -m studies.motor_lag LOG:FROM-TO ...``: prints the table of each log."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from windwrench.commands.identifying import parse_window
from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_json
from windwrench.runtime.regular_files import read_json
from windwrench.studies.motor_lag.page import MARKS, tables
from windwrench.studies.motor_lag.study import of_log
from windwrench.studies.page_tables import put_between


def study(
    logs: Annotated[list[str] | None, typer.Argument(help="LOG or LOG:FROM-TO, in s.")] = None,
    results: Annotated[Path, typer.Option(help="What is kept for the page.")] = Path(
        "results/motor_lag/motor_lag.json"
    ),
    page: Annotated[Path | None, typer.Option(help="Page whose table is made anew.")] = None,
    done: Annotated[bool, typer.Option("--done", help="Show what has been kept.")] = False,
) -> None:
    """Say what lag of the motors the thrust of logs shows, under four models."""
    if done == bool(logs):
        raise typer.BadParameter("expected logs, or --done without any")
    try:
        if logs:
            write_json([one for text in logs for one in _named(text)], results)
        text = tables(read_json(results, "outcomes of this study"))
        put_between(text, page, MARKS)
    except InputError as error:
        sys.exit(f"error: {error}")
    typer.echo(text)


def _named(text: str) -> list[dict[str, Any]]:
    path, (begin, end) = parse_window(text)
    # without the log's folder, which is another one on each machine
    return [{"log": Path(text).name, **one} for one in of_log(path, begin, end)]


if __name__ == "__main__":
    typer.run(study)
