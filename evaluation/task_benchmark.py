"""The tasks beside ``FanTracking``: laws and policies flown on the same episodes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
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
from .episodes import benchmark_seeds, check_episodes
from .side_by_side import each_flown

Array = NDArray[np.float64]

_CHUNK = 5  # episodes that a worker flies at a time


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
    check_episodes(episodes, seed)
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


__all__ = [
    "TASKS",
    "TASK_LAWS",
    "TaskEpisode",
    "check_task_request",
    "fly_task",
    "fly_task_episode",
    "task_of",
    "wanted_laws",
]
