"""``python -m studies.faults``: what faults do to the estimators, counted, and its page."""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.runtime.page_files import write_json
from windwrench.runtime.regular_files import read_json
from windwrench.studies.faults.page import write_page
from windwrench.studies.faults.study import run


def study(
    count: Annotated[int, typer.Option(min=1, help="Random sequences.")] = 500,
    steps: Annotated[int, typer.Option(min=1000, help="Of the long flight.")] = 1_000_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the sequences.")] = 0,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder of the data.")] = Path("docs/faults"),
    page_only: Annotated[
        bool, typer.Option("--page-only", help="Write the page from data that lie there.")
    ] = False,
) -> None:
    """Count how often each estimator is right again after faults (half an hour). What is done is
    kept, so a run that was stopped goes on.
    """
    data = out / "results.json"
    if not page_only:
        write_json(run(count, steps, seed, out, jobs), data)
    write_page(read_json(data, "results of this study"), data, out.with_suffix(".md"))


if __name__ == "__main__":
    typer.run(study)
