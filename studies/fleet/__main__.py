"""``python -m studies.fleet``: flights recorded and diagnosed as a fleet, and its page."""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.commands.terminal import share_bars_by_part
from windwrench.studies.fleet.page import write_page
from windwrench.studies.fleet.study import run, save


def study(
    flights: Annotated[int, typer.Option(min=12, help="Recorded flights.")] = 1000,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder of the logs and results.")] = Path(
        "results/fleet"
    ),
    page: Annotated[
        Path | None, typer.Option(help="Page to write, with its data in a folder beside it.")
    ] = None,
) -> None:
    """Record flights of 12 individuals and diagnose them as a fleet (some seconds a flight); what
    is done is not done again.
    """
    with share_bars_by_part() as report:
        result = run(flights, out, jobs, report)
    save(result, out / "study.json")
    if page is not None:
        write_page(result, out, page)


if __name__ == "__main__":
    typer.run(study)
