"""The four tasks as data: environment, scenarios, laws, and what a leaderboard compares with."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..controllers.own_file import is_file_name, load_controller
from ..controllers.registry import STANDARD_TASK, TASK_LAWS, make_controller, shipped_policies
from ..controllers.trained_policy import is_policy_path, load_policy
from ..envs import task as environments
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.fan_tracking_2d import FanTracking2DEnv
from ..envs.wind_tasks import WindHoverEnv, WindTrajectoryEnv
from ..runtime.errors import InputError, unknown_name
from .statistics import episode_bootstrap, hierarchical_bootstrap


@dataclass(frozen=True)
class Task:
    """What a benchmark needs to know of a task."""

    environment: type[environments.Task]
    rival: str  # the law over which wins are counted
    flown: str  # the law that is flown where none is named
    defaults: tuple[str, ...]  # its scenarios where none is named
    selected: tuple[str, ...] = ()  # laws of a benchmark where none is named; none: all
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
        """Laws of a benchmark where none is named."""
        return self.selected or tuple(self.laws)

    @property
    def decisions(self) -> int:
        """How many an episode has."""
        return self.environment.decisions()

    def policies(self) -> Mapping[str, Path]:
        """Return the policies that come with the kit, by name."""
        return shipped_policies(self.environment.name)

    def references(self, names: Sequence[str]) -> list[str]:
        """Return ``names`` and the laws that scores, wins and shares are relative to."""
        return list(dict.fromkeys([*names, "hover", self.rival, *self.bounds]))


TASKS: dict[str, Task] = {
    task.environment.name: task
    for task in (
        Task(
            FanTrackingEnv,
            "admittance",
            "admittance",
            ("static", "base"),
            ("hover", "admittance", "ratio", "oracle"),
            ("hover", "limit", "oracle"),
            episode_bootstrap,
        ),
        Task(FanTracking2DEnv, "admittance", "admittance", ("static", "base", "fast")),
        Task(WindHoverEnv, "pid", "pid-force", ("base", "turbulent")),
        Task(WindTrajectoryEnv, "pid", "pid-force", ("base", "turbulent")),
    )
}


def task_of(name: str) -> Task:
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
        name: a law; a policy that comes with the kit; the path of a trained policy; or
            FILE.py:CLASS of a file that is then run.
        task: one of ``TASKS``.

    Raises:
        InputError: no controller has this name, the file holds none, or a policy of another task.
    """
    known = task_of(task)
    if is_file_name(name):
        return load_controller(name)
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
    """Return what tables and pictures call controllers: a policy by the name of its file, with as
    many of its folders as it takes to tell it from the others.
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
