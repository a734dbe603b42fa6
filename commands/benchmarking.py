"""The benchmark: controllers of a task on the same episodes."""

from pathlib import Path
from typing import Any

from ..runtime.whole_files import replaced
from .options import listed
from .running import expensive
from .terminal import console, results_folder, say, show_table, working

# of a narrow terminal
_SHOWN = ("scenario", "law", "RMSE", "median", "lost", "score", "wins", "against", "to the")


@expensive
def benchmark(
    controllers: str | None = None,
    scenarios: str | None = None,
    episodes: int = 40,
    seed: int = 0,
    jobs: int | None = None,
    cluster: str | None = None,
    task: str = "FanTracking",
    out: Path = Path("results/benchmark"),
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
    names = list(known.standard) if controllers is None else listed(controllers, "--controllers")
    worlds = list(known.defaults) if scenarios is None else listed(scenarios, "--scenarios")
    check_request(names, worlds, episodes, seed, task)
    flights = count_flights(names, worlds, episodes, task)
    folder = results_folder(
        out, task=task, controllers=names, scenarios=worlds, flights=flights, jobs=jobs
    )
    with working("flying episodes", flights) as progress:
        results = fly_all(
            names,
            worlds,
            episodes,
            seed,
            jobs,
            lambda count: progress(more=count),
            cluster,
            task,
        )
    rows = leaderboard(results, names, seed, task)
    path = write_leaderboard(rows, folder)
    draw_leaderboard(rows, results, folder / "leaderboard.png")
    with replaced(folder / "leaderboard.md") as partial:
        partial.write_text(f"{summary(rows)}\n{markdown(rows)}", encoding="utf-8")
    columns = {title: texts for title, texts in table(rows).items() if title.startswith(_SHOWN)}
    show_table(tuple(columns), zip(*columns.values(), strict=True))
    limit = "; limit: of what can be measured" if "limit" in known.bounds else ""
    console.print(
        f"{task}: {episodes} paired episodes per scenario, seed {seed}; score: 0 = hover, 1 = "
        f"oracle; wins over {known.rival}{limit}",
    )
    say(path, folder / "leaderboard.md", folder / "leaderboard.png")
    return {"leaderboard": rows}
