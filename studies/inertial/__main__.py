"""``python -m studies.inertial``: what an IMU beside a pose buys, measured, and its page."""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.commands.terminal import share_bars_by_part
from windwrench.runtime.page_files import write_figure, write_json
from windwrench.runtime.regular_files import read_json
from windwrench.studies.inertial.page import draw, write_page
from windwrench.studies.inertial.study import run


def study(
    runs: Annotated[int, typer.Option(min=2, help="Flights of each kind.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of the first flight.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder of data and picture.")] = Path("docs/imu"),
    page_only: Annotated[
        bool, typer.Option("--page-only", help="Write the page from data that lie there.")
    ] = False,
) -> None:
    """Measure rise time, consistency and faults of the filter with an IMU (15 minutes)."""
    data = out / "results.json"
    if not page_only:
        with share_bars_by_part() as report:
            # a rise time that no tuning reaches is not a number
            write_json(run(runs, seed, report), data, allow_nan=True)
    result = read_json(data, "results of this study")
    write_page(result, data, write_figure(draw(result), out, "rise_time"), out.with_suffix(".md"))


if __name__ == "__main__":
    typer.run(study)
