"""``python -m studies.log_estimates``: how good ``windwrench estimate`` is on a log."""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.commands.terminal import share_bars_by_part
from windwrench.runtime.page_files import write_figure, write_json
from windwrench.runtime.regular_files import read_json
from windwrench.studies.log_estimates.page import draw, write_page
from windwrench.studies.log_estimates.study import run


def study(
    seconds: Annotated[float, typer.Option(min=20.0, help="Of each flight.")] = 60.0,
    flights: Annotated[int, typer.Option(min=2, help="Of each of the kit's vehicles.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Of the first flight.")] = 100,
    out: Annotated[Path, typer.Option(help="Folder of data and picture.")] = Path(
        "docs/log-estimates"
    ),
    poses_only: Annotated[
        bool,
        typer.Option("--poses-only", help="Keep the accuracy by tuning from data that lie there."),
    ] = False,
    page_only: Annotated[
        bool, typer.Option("--page-only", help="Write the page from data that lie there.")
    ] = False,
) -> None:
    """Measure accuracy by tuning and the cost of bad poses (half an hour; needs RotorPy)."""
    data = out / "results.json"
    if not page_only:
        with share_bars_by_part() as report:
            measured = read_json(data, "results of this study") if poses_only else None
            write_json(run(seconds, flights, seed, report, measured), data)
    result = read_json(data, "results of this study")
    picture = write_figure(draw(result), out, "errors")
    write_page(result, data, picture, out.with_suffix(".md"))


if __name__ == "__main__":
    typer.run(study)
