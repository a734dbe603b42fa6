"""Datasets for offline learners."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.table import Table

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


@expensive
def minari(
    controllers: Annotated[
        str,
        typer.Option(
            help="Controllers, comma-separated: names, paths of trained policies, or "
            "FILE.py:CLASS; default: the designed laws of the task.",
            autocompletion=offering(controller_names),
        ),
    ] = "",
    scenarios: Annotated[
        str,
        typer.Option(
            help="Scenario names, comma-separated.", autocompletion=offering(scenario_names)
        ),
    ] = "base",
    episodes: Annotated[int, typer.Option(min=1, help="Episodes in each dataset.")] = 20,
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="Random seed. Episodes are those of the training range, none of a benchmark.",
        ),
    ] = 0,
    task: Annotated[
        str,
        typer.Option(
            help="Task: FanTracking, FanTracking2D, WindHover or WindTrajectory.",
            autocompletion=offering(task_names),
        ),
    ] = "FanTracking",
    out: Out = Path("results/minari"),
) -> list[Any]:
    """Write flown episodes as Minari datasets. One for each controller and scenario.

    Example: windwrench minari --task WindHover --controllers pid,l1 --episodes 50
    """
    from ..controllers.task_laws import TASK_LAWS
    from ..evaluation.minari_data import check_dataset_request, write_dataset

    laws = "hover,admittance,ratio,lead,oracle"
    if not controllers:
        controllers = ",".join(TASK_LAWS[task]) if task in TASK_LAWS else laws
    names, worlds = names_in(controllers, "--controllers"), names_in(scenarios, "--scenarios")
    check_dataset_request(task, names, worlds, episodes, seed)
    count = len(names) * len(worlds) * episodes
    folder = results_folder(out, controllers=names, scenarios=worlds, flights=count)
    written = []
    with progress_bar() as progress:
        bar = progress.add_task("flying episodes", total=count)
        for world in worlds:
            for name in names:
                written.append(
                    write_dataset(
                        task, world, name, episodes, seed, folder, lambda: progress.advance(bar)
                    )
                )
    table = Table("dataset", "episodes", "decisions", "mean return", "lost", box=box.SIMPLE_HEAD)
    for data in written:
        table.add_row(
            data.id,
            str(data.episodes),
            str(data.decisions),
            f"{data.mean_return:.1f}",
            str(data.lost),
        )
    console.print(table)
    console.print(f"MINARI_DATASETS_PATH={folder} lets minari.load_dataset find them")
    say(*(folder / data.id for data in written))
    return written
