"""``python -m studies.learning`` writes the leaderboard page from its result files; with
``--train``, it first trains and scores what is missing.
"""

from pathlib import Path
from typing import Annotated

import typer

from windwrench.studies.learning.page import MAIN, page
from windwrench.studies.learning.pictures import draw_intervals, draw_summary
from windwrench.studies.learning.study import KEPT, Places, entries_of, load_plan, run_study
from windwrench.studies.pages import DOCS, write_page
from windwrench.studies.runner import Jobs, start


def study(
    train: Annotated[
        bool, typer.Option("--train", help="Also train and score what is missing.")
    ] = False,
    only: Annotated[
        str,
        typer.Option(
            help="Parts of the study, comma-separated: designed, learned, ablation, or names of "
            "entries."
        ),
    ] = "",
    plan: Annotated[
        Path | None,
        typer.Option(help="Plan of the study (YAML); default: studies/learning/study.yaml."),
    ] = None,
    results: Annotated[
        Path, typer.Option(help="Folder of the result files, one per entry and seed.")
    ] = KEPT.results,
    policies: Annotated[Path, typer.Option(help="Folder of trained policies.")] = KEPT.policies,
    markdown: Annotated[
        Path,
        typer.Option(
            help="Markdown file for the page; its pictures go to a folder of its name beside it."
        ),
    ] = DOCS / "leaderboard.md",
    jobs: Jobs = 1,
    out: Annotated[
        Path, typer.Option(help="Folder for training runs and their checkpoints.")
    ] = KEPT.runs,
) -> None:
    """Write the leaderboard page. A repeated command keeps what is finished, and an interrupted
    training run resumes.
    """
    asked = load_plan(plan)
    places = Places(out, results, policies)
    if train:
        names = [name.strip() for name in only.split(",") if name.strip()]
        run_study(entries_of(asked, names), asked, places, jobs)
    shown = page(places, asked)
    every = [row for by_world in shown["rows"].values() for row in by_world.values()]
    every.sort(key=lambda row: row.rmse_m)
    folder = markdown.with_suffix("")
    draw_intervals([row for row in every if row.world in MAIN], folder / "intervals.png")
    draw_summary(every, folder / "summary.png")
    print(write_page("leaderboard", shown, markdown))


if __name__ == "__main__":
    start(study)
