"""The benchmark: controllers of a task on the same episodes."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Table

from ..runtime.whole_files import replaced
from .running import expensive
from .terminal import (
    Out,
    console,
    controller_names,
    names_in,
    offering,
    progress_bar,
    results_folder,
    say,
    scenario_names,
    task_names,
)

# of a narrow terminal
_SHOWN = ("scenario", "law", "RMSE", "median", "lost", "score", "wins", "against", "to the")


@expensive
def benchmark(
    controllers: Annotated[
        str | None,
        typer.Option(
            help="Controllers, comma-separated: names, such as lead, tracker or the policy sac-0, "
            "paths of trained policies, or FILE.py:CLASS; default: hover, admittance, ratio and "
            "oracle, or all designed laws of another task.",
            autocompletion=offering(controller_names),
        ),
    ] = None,
    scenarios: Annotated[
        str | None,
        typer.Option(
            help="Scenario names, comma-separated; default: two or three of the task.",
            autocompletion=offering(scenario_names),
        ),
    ] = None,
    episodes: Annotated[
        int, typer.Option(min=1, help="Number of paired episodes per scenario.")
    ] = 40,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Random seed.")] = 0,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of processes; default: one per core.")
    ] = None,
    cluster: Annotated[
        str | None, typer.Option(help="Address of a Ray cluster to fly on, or local.")
    ] = None,
    task: Annotated[
        str,
        typer.Option(
            help="Task: FanTracking, FanTracking2D, WindHover or WindTrajectory; each has "
            "controllers and scenarios of its own.",
            autocompletion=offering(task_names),
        ),
    ] = "FanTracking",
    out: Out = Path("results/benchmark"),
) -> dict[str, Any]:
    """Fly controllers through the same episodes. Write the leaderboard as JSON, table and picture.

    Example: windwrench benchmark --controllers lead,tracker,sac-0 --scenarios base,fast
    --episodes 40
    """
    from ..evaluation.benchmark import check_request, count_flights, fly_all
    from ..evaluation.leaderboard import leaderboard, markdown, summary, table, write_leaderboard
    from ..evaluation.pictures import draw_leaderboard
    from ..evaluation.tasks import task_of

    known = task_of(task)
    names = list(known.standard) if controllers is None else names_in(controllers, "--controllers")
    worlds = list(known.defaults) if scenarios is None else names_in(scenarios, "--scenarios")
    check_request(names, worlds, episodes, seed, task)
    flights = count_flights(names, worlds, episodes, task)
    folder = results_folder(
        out, task=task, controllers=names, scenarios=worlds, flights=flights, jobs=jobs
    )
    with progress_bar() as progress:
        bar = progress.add_task("flying episodes", total=flights)
        results = fly_all(
            names,
            worlds,
            episodes,
            seed,
            jobs,
            lambda count: progress.advance(bar, count),
            cluster,
            task,
        )
    rows = leaderboard(results, names, seed, task)
    path = write_leaderboard(rows, folder)
    draw_leaderboard(rows, results, folder / "leaderboard.png")
    with replaced(folder / "leaderboard.md") as partial:
        partial.write_text(f"{summary(rows)}\n{markdown(rows)}", encoding="utf-8")
    columns = {title: texts for title, texts in table(rows).items() if title.startswith(_SHOWN)}
    printed = Table(*columns, box=box.SIMPLE_HEAD)
    for cells in zip(*columns.values(), strict=True):
        printed.add_row(*cells)
    console.print(printed)
    limit = "; limit: of what can be measured" if "limit" in known.bounds else ""
    console.print(
        f"{task}: {episodes} paired episodes per scenario, seed {seed}; score: 0 = hover, 1 = "
        f"oracle; wins over {known.rival}{limit}",
        highlight=False,
    )
    say(path, folder / "leaderboard.md", folder / "leaderboard.png")
    return {"leaderboard": rows}
