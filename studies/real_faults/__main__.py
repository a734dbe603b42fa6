"""``python -m studies.real_faults``: what is found of real faults, counted, and its page."""

import os
from pathlib import Path
from typing import Annotated

import typer

from windwrench.commands.terminal import share_bars_by_part
from windwrench.runtime.page_files import write_json
from windwrench.runtime.regular_files import read_json
from windwrench.studies.real_faults.page import write_page
from windwrench.studies.real_faults.study import run


def study(
    changes: Annotated[int, typer.Option(min=1, help="Drawn comparisons.")] = 1000,
    flights: Annotated[int, typer.Option(min=2, help="Simulated flights with a fault.")] = 60,
    seed: Annotated[int, typer.Option(min=0, help="Of the first.")] = 0,
    data: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the measured logs; default: the environment variable WINDWRENCH_DATA, "
            "or ../shared/data."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the data.")] = Path("docs/real-faults"),
    page_only: Annotated[
        bool, typer.Option("--page-only", help="Write the page from data that lie there.")
    ] = False,
) -> None:
    """Count what is found of cut propellers, weights and failing motors (ten minutes)."""
    results = out / "results.json"
    if not page_only:
        folder = data or Path(os.environ.get("WINDWRENCH_DATA") or "../shared/data")
        with share_bars_by_part() as report:
            write_json(run(folder, changes, flights, seed, report), results)
    write_page(read_json(results, "results of this study"), results, out.with_suffix(".md"))


if __name__ == "__main__":
    typer.run(study)
