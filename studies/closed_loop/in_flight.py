"""``python -m studies.closed_loop.in_flight``: the amended model flown, and its page."""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.runtime.errors import unknown_name
from windwrench.runtime.regular_files import read_json
from windwrench.studies.closed_loop.closed_loop import DEFAULT_EFFECTS
from windwrench.studies.closed_loop.page import write_page
from windwrench.studies.closed_loop.wind_section import write_wind_picture
from windwrench.studies.closed_loop.wind_tasks import SETTINGS, study


def main(
    episodes: Annotated[int, typer.Option(min=1, help="Paired, of each law and model.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of the benchmark.")] = 0,
    setting: Annotated[
        list[str] | None, typer.Option(help="Only these settings are flown; default: all.")
    ] = None,
    results: Annotated[
        Path, typer.Option(help="Folder of the results of close-loop; these go there, too.")
    ] = Path("docs/close-loop"),
    markdown: Annotated[Path, typer.Option(help="Page to write.")] = Path("docs/close-loop.md"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes.")] = None,
    page_only: Annotated[
        bool, typer.Option("--page-only", help="Write picture and page from results there.")
    ] = False,
) -> None:
    """Fly WindTrajectory and WindHover with every effect of the closed loop, before and after."""
    known = {s.name: s for s in SETTINGS}
    wanted = setting or list(known)
    for name in wanted:
        if name not in known:
            raise unknown_name("setting", name, known)
    if not page_only:
        for name in wanted:
            study(
                results,
                known[name],
                episodes,
                seed,
                jobs,
                lambda setting, share: print(f"{setting}: {100 * share:.0f} %", flush=True),
            )
    write_wind_picture(results)
    closed = [
        read_json(results / f"{name}.json", "a result of windwrench close-loop")
        for name in DEFAULT_EFFECTS
    ]
    write_page(closed, results, markdown)


if __name__ == "__main__":
    typer.run(main)
