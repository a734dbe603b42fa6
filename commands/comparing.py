"""Comparisons: controllers on the same episodes, and speed beside that of other packages."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Table

from ..runtime.errors import InputError
from ..runtime.whole_files import replaced
from .durations import duration_words
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

_CONTROLLERS, _SCENARIOS = "hover,admittance,ratio,oracle", "static,base"


@expensive
def benchmark(
    controllers: Annotated[
        str,
        typer.Option(
            help="Controllers, comma-separated: names, such as lead, tracker or the policy sac-0, "
            "paths of trained policies, or FILE.py:CLASS.",
            autocompletion=offering(controller_names),
        ),
    ] = _CONTROLLERS,
    scenarios: Annotated[
        str,
        typer.Option(
            help="Scenario names, comma-separated.", autocompletion=offering(scenario_names)
        ),
    ] = _SCENARIOS,
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
            "controllers and scenarios of its own, all of them where none is named.",
            autocompletion=offering(task_names),
        ),
    ] = "FanTracking",
    out: Out = Path("results/benchmark"),
) -> dict[str, Any]:
    """Fly controllers through the same episodes. Write the leaderboard as JSON, table and picture.

    Example: windwrench benchmark --controllers lead,tracker,sac-0 --scenarios base,fast
    --episodes 40
    """
    if task != "FanTracking":
        return _task_benchmark(
            task,
            None if controllers == _CONTROLLERS else controllers,
            None if scenarios == _SCENARIOS else scenarios,
            episodes,
            seed,
            jobs,
            cluster,
            out,
        )
    from ..evaluation.benchmark import (
        check_request,
        count_flights,
        fly_all,
        leaderboard,
        sampled_seconds,
        short_names,
    )
    from ..evaluation.pictures import draw_leaderboard
    from ..evaluation.side_by_side import write_leaderboard

    names, worlds = names_in(controllers, "--controllers"), names_in(scenarios, "--scenarios")
    check_request(names, worlds, episodes, seed)
    folder = results_folder(
        out,
        controllers=names,
        scenarios=worlds,
        flights=count_flights(names, worlds, episodes),
        jobs=jobs,
        takes=lambda: _sampled(sampled_seconds(names, worlds, episodes, jobs)),
    )
    with progress_bar() as progress:
        bar = progress.add_task("flying episodes", total=count_flights(names, worlds, episodes))
        results = fly_all(
            names,
            worlds,
            episodes,
            seed,
            jobs,
            lambda count: progress.advance(bar, count),
            cluster,
        )
    rows = leaderboard(results, names, seed)
    path = write_leaderboard(rows, folder)
    draw_leaderboard(rows, results, folder / "leaderboard.png")
    table = Table(
        "scenario",
        "controller",
        "RMSE (m), 95 %",
        "median",
        "lost",
        "score",
        "wins*",
        "to the limit**",
        box=box.SIMPLE_HEAD,
    )
    shown = short_names(names)
    for i, row in enumerate(rows):
        low, high = row.rmse_ci95_m
        last = i + 1 == len(rows) or rows[i + 1].scenario != row.scenario
        table.add_row(
            row.scenario,
            shown[row.controller],
            f"{row.rmse_m:.3f} ({low:.3f}-{high:.3f})",
            f"{row.median_rmse_m:.3f}",
            f"{row.lost_fraction:.1%}",
            f"{row.score:.2f}",
            f"{row.wins_over_admittance:.1%}",
            "-" if math.isnan(row.share_of_limit) else f"{row.share_of_limit:.0%}",
            end_section=last,
        )
    console.print(table)
    console.print(
        f"{episodes} paired episodes per scenario, seed {seed}; score: 0 = hover, 1 = oracle; "
        "*over admittance; **share of the way from admittance to the limit of what can be measured",
        highlight=False,
    )
    say(path, folder / "leaderboard.png")
    return {"leaderboard": rows}


def _sampled(seconds: float | None) -> str | None:
    if seconds is None:
        return (
            "not known: nothing is compiled yet, which takes about a minute of its own; after a "
            "first flight a dry run can tell"
        )
    return (
        f"about {duration_words(seconds)} at the present load, by 2 s of flight of each controller"
    )


def _task_benchmark(
    task: str,
    controllers: str | None,
    scenarios: str | None,
    episodes: int,
    seed: int,
    jobs: int | None,
    cluster: str | None,
    out: Path,
) -> dict[str, Any]:
    """Fly the laws of another task; what is not named is all that the task has."""
    from ..controllers.task_laws import TASK_LAWS
    from ..envs.fan_tracking import EPISODE_SECONDS
    from ..evaluation.side_by_side import write_leaderboard
    from ..evaluation.task_benchmark import check_task_request, fly_task, task_of, wanted_laws
    from ..evaluation.task_leaderboard import (
        draw_task_leaderboard,
        markdown,
        summary,
        task_leaderboard,
    )

    known = task_of(task)
    if cluster is not None:
        raise InputError(f"benchmark: --cluster flies FanTracking alone; leave it out for {task}")
    names = list(TASK_LAWS[task]) if controllers is None else names_in(controllers, "--controllers")
    worlds = list(known.defaults) if scenarios is None else names_in(scenarios, "--scenarios")
    check_task_request(task, names, worlds, episodes, seed)
    flights = len(wanted_laws(task, names)) * len(worlds) * episodes
    folder = results_folder(
        out, task=task, controllers=names, scenarios=worlds, flights=flights, jobs=jobs
    )
    with progress_bar() as progress:
        bar = progress.add_task("flying episodes", total=flights)
        results = fly_task(
            task, names, worlds, episodes, seed, jobs, lambda count: progress.advance(bar, count)
        )
    rows = task_leaderboard(task, results, names, seed)
    path = write_leaderboard(rows, folder)
    period = EPISODE_SECONDS / known.decisions
    draw_task_leaderboard(rows, results, folder / "leaderboard.png", period)
    with replaced(folder / "leaderboard.md") as partial:
        partial.write_text(f"{summary(rows)}\n{markdown(rows)}", encoding="utf-8")
    table = Table(
        "scenario",
        "controller",
        "RMSE (m), 95 %",
        "median",
        "lost",
        "score",
        f"against {known.rival}, 95 %",
        "wins",
        box=box.SIMPLE_HEAD,
    )
    for i, row in enumerate(rows):
        low, high = row.rmse_ci95_m
        table.add_row(
            row.scenario,
            row.controller,
            f"{row.rmse_m:.3f} ({low:.3f}-{high:.3f})",
            f"{row.median_rmse_m:.3f}",
            f"{row.lost_fraction:.1%}",
            f"{row.score:.2f}",
            f"{row.change_over_rival:+.0%} ({row.change_ci95[0]:+.0%}, {row.change_ci95[1]:+.0%})",
            f"{row.wins_over_rival:.0%}",
            end_section=i + 1 == len(rows) or rows[i + 1].scenario != row.scenario,
        )
    console.print(table)
    console.print(
        f"{task}: {episodes} paired episodes per scenario, seed {seed}; score: 0 = hover, 1 = "
        f"oracle",
        highlight=False,
    )
    say(path, folder / "leaderboard.md", folder / "leaderboard.png")
    return {"leaderboard": rows}
