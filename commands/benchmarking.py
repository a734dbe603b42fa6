"""The benchmark: controllers of a task on the same episodes."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..controllers.registry import STANDARD_TASK
from ..runtime.page_files import write_text
from .options import listed
from .running import expensive
from .terminal import console, results_folder, say, show_table, working

if TYPE_CHECKING:
    from ..evaluation.benchmark import Request
    from ..evaluation.leaderboard import Standing


@expensive
def benchmark(
    controllers: str | None = None,
    scenarios: str | None = None,
    episodes: int = 40,
    seed: int = 0,
    jobs: int | None = None,
    cluster: str | None = None,
    task: str = STANDARD_TASK,
    reward: str | None = None,
    imports: list[str] | None = None,
    out: Path = Path("results/benchmark"),
) -> dict[str, Any]:
    """Rank controllers on the same simulated episodes. Write the leaderboard as JSON, table and
    picture.

    Example: windwrench benchmark --controllers lead,tracker,sac-0 --scenarios base,fast
    --episodes 40
    """
    from ..evaluation.benchmark import Request
    from ..evaluation.tasks import import_files, scenario_names, task_of

    import_files(imports or ())
    known = task_of(task)
    names = known.standard if controllers is None else listed(controllers, "--controllers")
    given = known.defaults if scenarios is None else listed(scenarios, "--scenarios")
    worlds = scenario_names(given, known)
    request = Request(
        tuple(names), tuple(worlds), episodes, seed, task, reward, tuple(imports or ())
    )
    request.check()
    flights = request.flights()
    folder = results_folder(
        out,
        task=task,
        controllers=list(names),
        scenarios=worlds,
        reward=reward,
        flights=flights,
        jobs=jobs,
    )
    with working("flying episodes", flights) as progress:
        rows, written = write_board(folder, request, progress, jobs=jobs, cluster=cluster)
    _show(task, rows)
    say(*written)
    return {"leaderboard": rows}


def _show(task: str, rows: "list[Standing]") -> None:
    """Print the tables of each scenario, figures before comparisons, and their legend."""
    from ..evaluation.tables import COMPARED, FIGURES, legend, part_of, table

    for scenario in dict.fromkeys(row.scenario for row in rows):
        columns = table([row for row in rows if row.scenario == scenario])
        console.print(f"\n{scenario}")
        for titles in (FIGURES, COMPARED):
            part = part_of(columns, titles)
            show_table(tuple(part), zip(*part.values(), strict=True))
    console.print(legend(task, rows))


def write_board(
    folder: Path, request: "Request", progress: Callable[..., None], **where: Any
) -> "tuple[list[Standing], list[Path]]":
    """Fly controllers through the same episodes, and write the leaderboard into a folder.

    Args:
        folder: for ``leaderboard.json``, ``.md`` and ``.png``, and ``submission.json``.
        request: the benchmark.
        progress: takes ``more`` episodes.
        where: ``jobs`` and ``cluster`` of ``fly_all``.

    Returns:
        The rows, and the paths of the files.
    """
    from ..evaluation.benchmark import fly_all
    from ..evaluation.leaderboard import leaderboard
    from ..evaluation.pictures import draw_leaderboard
    from ..evaluation.submission import write_submission
    from ..evaluation.tables import legend, markdown, summary, write_leaderboard

    results = fly_all(request, advance=lambda count: progress(more=count), **where)
    rows = leaderboard(results, request.controllers, request.seed, request.task)
    path = write_leaderboard(rows, folder)
    table, picture = path.with_suffix(".md"), path.with_suffix(".png")
    write_text(f"{summary(rows)}\n{markdown(rows)}\n{legend(request.task, rows)}\n", table)
    draw_leaderboard(rows, results, picture)
    return rows, [path, table, picture, write_submission(request, rows, results, folder)]
