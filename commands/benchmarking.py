"""The benchmark: controllers of a task on the same episodes."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..controllers.registry import STANDARD_TASK
from ..runtime.page_files import write_text
from .options import listed
from .running import expensive
from .terminal import console, results_folder, say, show_table, working

if TYPE_CHECKING:
    from ..evaluation.leaderboard import Standing

# columns of a narrow terminal
_SHOWN = ("scenario", "law", "RMSE", "median", "terminated", "score", "wins", "against", "to the")


@expensive
def benchmark(
    controllers: str | None = None,
    scenarios: str | None = None,
    episodes: int = 40,
    seed: int = 0,
    jobs: int | None = None,
    cluster: str | None = None,
    task: str = STANDARD_TASK,
    out: Path = Path("results/benchmark"),
) -> dict[str, Any]:
    """Fly controllers through the same episodes. Write the leaderboard as JSON, table and picture.

    Example: windwrench benchmark --controllers lead,tracker,sac-0 --scenarios base,fast
    --episodes 40
    """
    from ..evaluation.benchmark import check_request, count_flights
    from ..evaluation.leaderboard import table
    from ..evaluation.tasks import task_of

    known = task_of(task)
    names = list(known.standard) if controllers is None else listed(controllers, "--controllers")
    worlds = list(known.defaults) if scenarios is None else listed(scenarios, "--scenarios")
    check_request(names, worlds, episodes, seed, task)
    flights = count_flights(names, worlds, episodes, task)
    folder = results_folder(
        out, task=task, controllers=names, scenarios=worlds, flights=flights, jobs=jobs
    )
    with working("flying episodes", flights) as progress:
        rows, written = write_board(
            folder, names, worlds, episodes, seed, progress, jobs=jobs, cluster=cluster, task=task
        )
    columns = {title: texts for title, texts in table(rows).items() if title.startswith(_SHOWN)}
    show_table(tuple(columns), zip(*columns.values(), strict=True))
    limit = "; limit: of what can be measured" if "limit" in known.bounds else ""
    console.print(
        f"{task}: {episodes} paired episodes per scenario, seed {seed}; score: 0 = hover, 1 = "
        f"oracle; wins over {known.rival}{limit}",
    )
    say(*written)
    return {"leaderboard": rows}


def write_board(
    folder: Path,
    controllers: Sequence[str],
    scenarios: Sequence[str],
    episodes: int,
    seed: int,
    progress: Callable[..., None],
    task: str = STANDARD_TASK,
    **where: Any,
) -> "tuple[list[Standing], list[Path]]":
    """Fly controllers through the same episodes, and write the leaderboard into a folder.

    Args:
        folder: for ``leaderboard.json``, ``.md`` and ``.png``.
        controllers: as ``fly_all`` takes them.
        scenarios: likewise.
        episodes: number in each scenario.
        seed: the benchmark's.
        progress: takes ``more`` episodes.
        task: a name of ``TASKS``.
        where: ``jobs`` and ``cluster`` of ``fly_all``.

    Returns:
        The rows, and the paths of the files.
    """
    from ..evaluation.benchmark import fly_all
    from ..evaluation.leaderboard import leaderboard, markdown, summary, write_leaderboard
    from ..evaluation.pictures import draw_leaderboard

    results = fly_all(
        controllers,
        scenarios,
        episodes,
        seed,
        advance=lambda count: progress(more=count),
        task=task,
        **where,
    )
    rows = leaderboard(results, controllers, seed, task)
    path = write_leaderboard(rows, folder)
    table, picture = path.with_suffix(".md"), path.with_suffix(".png")
    write_text(f"{summary(rows)}\n{markdown(rows)}", table)
    draw_leaderboard(rows, results, picture)
    return rows, [path, table, picture]
