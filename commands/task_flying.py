"""One episode of a task beside FanTracking: its picture, its time series and its film."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table

from ..runtime.errors import InputError
from .terminal import console, progress_bar, results_folder, say

_DEFAULT = {"FanTracking2D": "admittance"}  # controller; else the one below
_IN_WIND = "pid-force"


def fly_task_once(
    task: str,
    scenario: str,
    controller: str | None,
    seed: int,
    vehicle: str,
    truth: str | None,
    effects: Sequence[Any],
    kinds: list[str],
    film_seconds: float,
    csv: bool,
    view: bool,
    rrd: bool,
    out: Path,
) -> dict[str, Any]:
    """Fly one episode; see ``fly``.

    Raises:
        InputError: an unknown task, scenario or controller, or ``--rrd``.
    """
    import numpy as np

    from ..envs.drawing import SCALES
    from ..envs.fan_tracking import EPISODE_SECONDS
    from ..envs.video import FPS
    from ..envs.wind_drawing import WIND_SCALES
    from ..evaluation.pictures import draw_task_episode
    from ..evaluation.task_benchmark import check_task_request, fly_task_episode, task_of
    from ..evaluation.task_benchmark import make_task_pilot as make_pilot
    from .filming import SIZE, Tally, caption_of, films, written

    known = task_of(task)
    if rrd:
        raise InputError("--rrd: expected --task FanTracking with it")
    name = controller or _DEFAULT.get(task, _IN_WIND)
    check_task_request(task, [name], [scenario], 1, 0)
    law = make_pilot(name, task)
    mode = "rgb_array" if kinds else "human" if view else None
    env = known.environment(
        scenario, mode, vehicle, effects, truth=truth, width=SIZE[0], height=SIZE[1]
    )
    folder = results_folder(out)
    in_wind = task != "FanTracking2D"
    rate = known.decisions / EPISODE_SECONDS
    every = max(1, round(rate / FPS))
    tally = Tally("error")
    rows: list[list[float]] = []
    with (
        progress_bar() as progress,
        films(folder, "fly", kinds, film_seconds, every, rate) as film,
    ):
        bar = progress.add_task("flying", total=known.decisions)

        def each(info: Any) -> None:
            progress.advance(bar)
            loop = env.flight.loop
            now, error = float(info["time"]), float(info["error"])
            rows.append(
                [
                    *(now, error, *loop.position, *loop.state[16:19], *loop.state[13:16]),
                    *(*info["force"], *info["torque"]),
                ]
            )
            tally.add(error, float(info["reward_tracking"]))
            if kinds:
                wind = (f"wind {np.linalg.norm(info['wind']):.1f} m/s",) if in_wind else ()
                film(
                    env.render,
                    lambda: caption_of(
                        loop,
                        env.viewer,
                        f"{task}, {scenario}: {name}",
                        now,
                        (*tally.lines(), *wind),
                        WIND_SCALES if in_wind else SCALES,
                    ),
                )

        episode = fly_task_episode(env, law, seed, known, each)
    env.close()
    columns = dict(zip(COLUMNS, np.array(rows).T, strict=True))
    paths = [folder / "fly.png", *written(folder, "fly", kinds)]
    draw_task_episode(columns, f"{task}, {scenario}, {name}: RMSE {episode.rmse:.3f} m", paths[0])
    if csv:
        from ..identification.logs.tables import write_csv

        write_csv(columns, folder / "fly.csv")
        paths.append(folder / "fly.csv")
    table = Table(
        "controller", "task", "scenario", "RMSE (m)", "lost", "reward", box=box.SIMPLE_HEAD
    )
    table.add_row(
        name,
        task,
        scenario,
        f"{episode.rmse:.3f}",
        "yes" if episode.lost else "no",
        f"{episode.total_reward:.1f}",
    )
    console.print(table)
    say(*paths)
    return {
        "task": task,
        "controller": name,
        "scenario": scenario,
        "rmse_m": episode.rmse,
        "lost": episode.lost,
        "reward": episode.total_reward,
    }


_WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
# t s, error m, true position m, estimated and true wrench N and Nm, world
COLUMNS = ("t", "error", "px", "py", "pz", *_WRENCH, *(f"true_{name}" for name in _WRENCH))
