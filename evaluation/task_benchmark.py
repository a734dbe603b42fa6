"""The leaderboards of the tasks beside ``FanTracking``: laws on the same episodes, scored between
hover (0) and oracle (1).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..controllers.own_file import is_file_name, load_controller
from ..controllers.task_laws import TASK_LAWS, make_task_law
from ..controllers.task_policy import load_task_policy, shipped_task_policies
from ..controllers.trained_policy import is_policy_path
from ..envs.fan_tracking_2d import FanTracking2DEnv
from ..envs.scenarios import SCENARIOS
from ..envs.wind_hover import WindHoverEnv
from ..envs.wind_scenarios import WIND_SCENARIOS
from ..envs.wind_trajectory import WindTrajectoryEnv
from ..runtime.errors import InputError, unknown_name
from ..runtime.whole_files import replaced
from .episodes import FIRST_TEST_SEED, benchmark_seeds
from .side_by_side import each_flown

Array = NDArray[np.float64]

_CHUNK = 5  # episodes that a worker flies at a time
_RESAMPLES = 4_000
_SEEDS = (2**32 - FIRST_TEST_SEED) // 10_000 - 1  # of a benchmark, the last


@dataclass(frozen=True)
class Task:
    """What a leaderboard needs to know of a task."""

    environment: Callable[..., Any]
    scenarios: Mapping[str, Any]
    decisions: int
    lost_error: float  # m, that a lost vehicle's remaining time counts at
    rival: str  # the law that wins are counted over
    defaults: tuple[str, ...]  # scenarios that are flown where none is named


TASKS: dict[str, Task] = {
    "FanTracking2D": Task(
        FanTracking2DEnv, SCENARIOS, 250, 2.5, "admittance", ("static", "base", "fast")
    ),
    "WindHover": Task(WindHoverEnv, WIND_SCENARIOS, 500, 2.5, "pid", ("base", "turbulent")),
    "WindTrajectory": Task(
        WindTrajectoryEnv, WIND_SCENARIOS, 500, 2.5, "pid", ("base", "turbulent")
    ),
}


@dataclass(frozen=True, eq=False)
class TaskEpisode:
    """One flown episode; ``error`` ends where the vehicle was lost."""

    seed: int
    lost: bool
    total_reward: float
    error: Array = field(repr=False)  # m, a number a decision
    rmse: float = math.nan  # m, over the whole episode


@dataclass(frozen=True)
class TaskRow:
    """One line of a task's leaderboard."""

    task: str
    controller: str
    scenario: str
    episodes: int
    seed: int
    rmse_m: float  # mean over episodes
    rmse_ci95_m: tuple[float, float]  # bootstrap over episodes
    median_rmse_m: float
    lost_fraction: float
    score: float  # (hover - this) / (hover - oracle), of the means
    wins_over_admittance: float  # null where the task has no admittance law
    rival: str  # the law of ``wins_over_rival``
    wins_over_rival: float  # share of the paired episodes with a smaller RMSE
    change_over_rival: float  # of the mean RMSE
    change_ci95: tuple[float, float]  # paired bootstrap over episodes


TaskResults = dict[tuple[str, str], list[TaskEpisode]]


def task_of(name: str) -> Task:
    """Return a task by its name.

    Raises:
        InputError: no task has this name.
    """
    if name not in TASKS:
        raise unknown_name("task", name, ["FanTracking", *TASKS])
    return TASKS[name]


def make_task_pilot(name: str, task: str) -> Any:
    """Return a new law of a task by its name, or by FILE.py:CLASS of a file that is then run; or a
    trained policy by its name or the path of its file.

    Raises:
        InputError: no law has this name, the file holds none, or a policy of another task.
    """
    if is_file_name(name):
        return load_controller(name)
    shipped = shipped_task_policies(task)
    if name not in shipped and not is_policy_path(name):
        return make_task_law(name, task)
    policy = load_task_policy(shipped.get(name, name))
    if policy.task != task:
        raise InputError(f"{name}: a policy of {policy.task}, not of {task}")
    return policy


def fly_task_episode(
    env: Any, law: Any, seed: int, task: Task, each: Callable[[Any], None] = lambda info: None
) -> TaskEpisode:
    """Fly one episode of a task and return it; ``each`` is called with the ``info`` of every
    decision.
    """
    law.reset()
    if hasattr(env, "preview"):
        env.preview = getattr(law, "preview", 0.0)
    observation, info = env.reset(seed=seed)
    errors, total = [], 0.0
    for _ in range(task.decisions):
        observation, reward, lost, _, info = env.step(law(observation, info))
        total += float(reward)
        errors.append(info["error"])
        each(info)
        if lost:
            break
    error = np.array(errors)
    full = np.full(task.decisions, task.lost_error)
    full[: len(error)] = np.minimum(np.nan_to_num(error, nan=task.lost_error), task.lost_error)
    return TaskEpisode(seed, bool(info["lost"]), total, error, float(np.sqrt(np.mean(full * full))))


def check_task_request(
    task: str, controllers: Sequence[str], scenarios: Sequence[str], episodes: int, seed: int
) -> None:
    """Check what ``fly_task`` is asked for, before anything is flown.

    Raises:
        InputError: an unknown name, no episodes, or a seed out of range.
    """
    known = task_of(task)
    if episodes < 1:
        raise InputError(f"benchmark: --episodes must be at least 1, got {episodes}")
    if not 0 <= seed <= _SEEDS:
        raise InputError(f"benchmark: --seed must lie between 0 and {_SEEDS}, got {seed}")
    for name in controllers:
        make_task_pilot(name, task)
    for name in scenarios:
        if name not in known.scenarios:
            raise unknown_name("scenario", name, known.scenarios)


def wanted_laws(task: str, controllers: Sequence[str]) -> list[str]:
    """Return the laws that are flown: those asked for, and what scores and wins are relative to."""
    return list(dict.fromkeys([*controllers, "hover", TASKS[task].rival, "oracle"]))


def fly_task(
    task: str,
    controllers: Sequence[str],
    scenarios: Sequence[str],
    episodes: int,
    seed: int,
    jobs: int | None = None,
    advance: Callable[[int], None] = lambda count: None,
) -> TaskResults:
    """Fly every law, and the references, through every scenario of a task on the same seeds.

    Args:
        task: one of ``TASKS``.
        controllers: names, or FILE.py:CLASS.
        scenarios: names.
        episodes: a scenario.
        seed: of the benchmark.
        jobs: processes; default: one a core. The results do not depend on it.
        advance: called with the number of episodes flown since the last call.

    Raises:
        InputError: as ``check_task_request``.
    """
    check_task_request(task, controllers, scenarios, episodes, seed)
    wanted, seeds = wanted_laws(task, controllers), benchmark_seeds(seed, episodes)
    chunks = [
        (task, law, scenario, seeds[i : i + _CHUNK])
        for scenario in dict.fromkeys(scenarios)
        for law in wanted
        for i in range(0, episodes, _CHUNK)
    ]
    results: TaskResults = {(law, scenario): [] for scenario in scenarios for law in wanted}

    def compile_first() -> None:
        _environment(task, scenarios[0]).reset(seed=0)

    flown_chunks = each_flown(_fly_chunk, chunks, jobs, compile_first=compile_first)
    for (_, law, scenario, _), flown in flown_chunks:
        results[law, scenario].extend(flown)
        advance(len(flown))
    return results


@cache
def _environment(task: str, scenario: str) -> Any:
    return TASKS[task].environment(scenario)


def _fly_chunk(chunk: tuple[str, str, str, list[int]]) -> list[TaskEpisode]:
    task, name, scenario, seeds = chunk
    law, env = make_task_pilot(name, task), _environment(task, scenario)
    return [fly_task_episode(env, law, seed, TASKS[task]) for seed in seeds]


def task_leaderboard(
    task: str, results: TaskResults, controllers: Sequence[str], seed: int
) -> list[TaskRow]:
    """Return the leaderboard's rows, scenario by scenario, best first."""
    rival, rows = TASKS[task].rival, []
    for scenario in dict.fromkeys(s for _, s in results):
        rmse = {
            law: np.array([e.rmse for e in flown])
            for (law, s), flown in results.items()
            if s == scenario
        }
        span = rmse["hover"].mean() - rmse["oracle"].mean()
        other, some = rmse[rival], []
        for name in dict.fromkeys(controllers):
            flown, values = results[name, scenario], rmse[name]
            wins = float(np.mean(values < other) + 0.5 * np.mean(values == other))
            means = _resampled(values), _resampled(other)
            low, high = np.quantile(means[0] / means[1] - 1.0, [0.025, 0.975])
            interval = np.quantile(means[0], [0.025, 0.975])
            some.append(
                TaskRow(
                    task=task,
                    controller=name,
                    scenario=scenario,
                    episodes=len(flown),
                    seed=seed,
                    rmse_m=float(values.mean()),
                    rmse_ci95_m=(float(interval[0]), float(interval[1])),
                    median_rmse_m=float(np.median(values)),
                    lost_fraction=float(np.mean([e.lost for e in flown])),
                    score=float((rmse["hover"].mean() - values.mean()) / span)
                    if span > 0
                    else math.nan,
                    wins_over_admittance=wins if rival == "admittance" else math.nan,
                    rival=rival,
                    wins_over_rival=wins,
                    change_over_rival=float(values.mean() / other.mean() - 1.0),
                    change_ci95=(float(low), float(high)),
                )
            )
        rows.extend(sorted(some, key=lambda row: row.rmse_m))
    return rows


def _resampled(values: Array) -> Array:
    """Return means of episodes drawn anew; the same draws for every law, so that pairs stay."""
    rng = np.random.default_rng(0)
    means: Array = values[rng.integers(len(values), size=(_RESAMPLES, len(values)))].mean(axis=1)
    return means


def markdown(rows: Sequence[TaskRow]) -> str:
    """Return the rows as a table for a page, losses as a column of their own."""
    if not rows:
        return ""
    lines = [
        f"| scenario | law | episodes | RMSE (m), 95 % | median | lost | score | against "
        f"{rows[0].rival}, 95 % | wins |",
        "| - | - | -: | - | -: | -: | -: | - | -: |",
    ]
    for row in rows:
        low, high = row.rmse_ci95_m
        change = ", ".join(f"{100 * v:+.0f}" for v in row.change_ci95)
        lines.append(
            f"| {row.scenario} | {row.controller} | {row.episodes} | {row.rmse_m:.3f} "
            f"({low:.3f}-{high:.3f}) | {row.median_rmse_m:.3f} | {100 * row.lost_fraction:.1f} % | "
            f"{row.score:.2f} | {100 * row.change_over_rival:+.0f} % ({change}) | "
            f"{100 * row.wins_over_rival:.0f} % |"
        )
    return "\n".join(lines) + "\n"


_COLOURS = ("#30638e", "#2a9d8f", "#edae49", "#d1495b", "#8d5a97", "#8c8c8c", "#6a994e")


def draw_task_leaderboard(
    rows: Sequence[TaskRow], results: TaskResults, path: Path, period: float
) -> None:
    """Draw every episode's RMSE, the mean with its interval, and the error over time of the rival's
    median episode, a scenario a row.
    """
    scenarios = list(dict.fromkeys(row.scenario for row in rows))
    colour = {
        name: _COLOURS[i % len(_COLOURS)]
        for i, name in enumerate(dict.fromkeys(row.controller for row in rows))
    }
    figure = Figure(figsize=(11, 1.0 + 2.8 * len(scenarios)), layout="constrained")
    grid = figure.subplots(len(scenarios), 2, squeeze=False, width_ratios=[1.1, 1])
    for (left, right), scenario in zip(grid, scenarios, strict=True):
        some = [row for row in rows if row.scenario == scenario]
        rival = results[some[0].rival, scenario]
        middle = int(np.argsort([e.rmse for e in rival])[len(rival) // 2])
        for i, row in enumerate(some):
            values = np.array([e.rmse for e in results[row.controller, scenario]])
            jitter = np.random.default_rng(0).uniform(-0.24, 0.24, len(values))
            left.scatter(values, i + jitter, s=11, color=colour[row.controller], alpha=0.4, lw=0)
            left.plot(row.rmse_ci95_m, [i, i], color="black", lw=2.2, solid_capstyle="butt")
            left.plot(row.rmse_m, i, "o", color=colour[row.controller], mec="black", ms=8, zorder=5)
            label = f"{row.rmse_m:.3f} m" + (
                f", {100 * row.lost_fraction:.0f} % lost" if row.lost_fraction else ""
            )
            left.annotate(
                label, (1.01, i), xycoords=("axes fraction", "data"), va="center", fontsize=9
            )
            error = results[row.controller, scenario][middle].error
            right.plot(
                period * (1 + np.arange(len(error))),
                error,
                color=colour[row.controller],
                lw=1.4,
                label=row.controller,
            )
        left.set_yticks(range(len(some)), [row.controller for row in some])
        left.invert_yaxis()
        left.set_xlim(left=0)
        left.set_title(f"{scenario}: RMSE of each episode, mean, 95 %", loc="left", fontsize=10)
        left.set_xlabel("RMSE (m)")
        right.set_title(f"{some[0].rival}'s median episode", loc="left", fontsize=10)
        right.set_xlabel("time (s)")
        right.set_ylabel("error (m)")
        right.set_ylim(bottom=0)
        right.legend(frameon=False, fontsize=8, ncols=3)
        for axes in (left, right):
            axes.spines[["top", "right"]].set_visible(False)
    with replaced(path) as partial:
        figure.savefig(partial, dpi=110, format="png")


__all__ = [
    "TASKS",
    "TASK_LAWS",
    "TaskEpisode",
    "TaskRow",
    "check_task_request",
    "draw_task_leaderboard",
    "fly_task",
    "fly_task_episode",
    "markdown",
    "task_leaderboard",
    "task_of",
    "wanted_laws",
]
