"""The four tasks as data: environment, scenarios, laws, and the rivals on a leaderboard."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..controllers.law_file import is_law_file
from ..controllers.own_file import is_file_name, load_controller
from ..controllers.registry import STANDARD_TASK, TASK_LAWS, make_controller, shipped_policies
from ..controllers.trained_policy import is_policy_path, load_policy
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.fan_tracking_2d import FanTracking2DEnv
from ..envs.task import Task
from ..envs.wind_tasks import WindHoverEnv, WindTrajectoryEnv
from ..runtime.errors import InputError, unknown_name
from .statistics import episode_bootstrap, hierarchical_bootstrap


@dataclass(frozen=True)
class BenchmarkTask:
    """A task with its rivals and defaults."""

    environment: type[Task]
    rival: str  # wins are counted over this law
    flown: str  # default law of one episode
    defaults: tuple[str, ...]  # default scenarios
    selected: tuple[str, ...] = ()  # default laws of a benchmark; none: all
    bounds: tuple[str, ...] = ("hover", "oracle")  # no designed laws: the ends of the scales
    # 95 % interval of one law's mean RMSE
    interval: Callable[..., tuple[float, float]] = hierarchical_bootstrap

    @property
    def scenarios(self) -> Mapping[str, Any]:
        """All of its worlds, by name."""
        return self.environment.scenarios

    @property
    def laws(self) -> Mapping[str, Callable[..., Any]]:
        """All of its designed laws, by name."""
        return TASK_LAWS[self.environment.name]

    @property
    def standard(self) -> tuple[str, ...]:
        """Default laws of a benchmark."""
        return self.selected or tuple(self.laws)

    @property
    def decisions(self) -> int:
        """Decisions of an episode."""
        return self.environment.decisions()

    def policies(self) -> Mapping[str, Path]:
        """Return the kit's own policies, by name."""
        return shipped_policies(self.environment.name)

    def references(self, names: Sequence[str]) -> list[str]:
        """Return ``names`` and the reference laws of scores, wins and shares."""
        return list(dict.fromkeys([*names, "hover", self.rival, *self.bounds]))


TASKS: dict[str, BenchmarkTask] = {
    task.environment.name: task
    for task in (
        BenchmarkTask(
            FanTrackingEnv,
            "admittance",
            "admittance",
            ("static", "base"),
            ("hover", "admittance", "ratio", "oracle"),
            ("hover", "limit", "oracle"),
            episode_bootstrap,
        ),
        BenchmarkTask(FanTracking2DEnv, "admittance", "admittance", ("static", "base", "fast")),
        BenchmarkTask(WindHoverEnv, "pid", "pid-force", ("base", "turbulent")),
        BenchmarkTask(WindTrajectoryEnv, "pid", "pid-force", ("base", "turbulent")),
    )
}


def task_of(name: str) -> BenchmarkTask:
    """Return a task by its name.

    Raises:
        InputError: no task has this name.
    """
    if name not in TASKS:
        raise unknown_name("task", name, TASKS)
    return TASKS[name]


def make_pilot(name: str, task: str = STANDARD_TASK) -> Any:
    """Return a new controller of a task.

    Args:
        name: a law, its YAML file, one of the kit's policies, the path of a trained policy, or
            FILE.py:CLASS; the file is then run.
        task: one of ``TASKS``.

    Raises:
        InputError: no controller has this name, the file holds none, or a policy of another task.
    """
    known = task_of(task)
    if is_file_name(name):
        return load_controller(name)
    if is_law_file(name):
        return make_controller(name, task)
    shipped = known.policies()
    if name in shipped or is_policy_path(name):
        policy = load_policy(shipped.get(name, name))
        if policy.task != task:
            raise InputError(f"{name}: a policy of {policy.task}, not of {task}")
        return policy
    if task == STANDARD_TASK and name not in known.laws:
        raise unknown_name("controller", name, [*known.laws, *shipped])
    return make_controller(name, task)


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Return the controllers' names in tables and pictures: of a policy's file the name, with
    enough of its folders to tell policies apart.
    """
    parts = {
        name: Path(name).with_suffix("").parts if is_policy_path(name) else (name,)
        for name in names
    }
    shown = {}
    for name, own in parts.items():
        others = [other for key, other in parts.items() if key != name]
        length = 1
        while length < len(own) and any(other[-length:] == own[-length:] for other in others):
            length += 1
        shown[name] = "/".join(own[-length:])
    return shown
