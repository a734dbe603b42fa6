"""The four tasks as data: environment, scenarios, laws, and what a leaderboard compares with."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..controllers.own_file import is_file_name, load_controller
from ..controllers.registry import STANDARD_TASK, TASK_LAWS, make_controller, shipped_policies
from ..controllers.trained_policy import TrainedPolicy, is_policy_path, load_policy
from ..envs.fan_tracking import FanTrackingEnv, scenario_env
from ..envs.fan_tracking_2d import FanTracking2DEnv
from ..envs.wind_tasks import WindHoverEnv, WindTrajectoryEnv
from ..runtime.errors import InputError, unknown_name
from .statistics import episode_bootstrap, hierarchical_bootstrap


@dataclass(frozen=True)
class Task:
    """What a benchmark needs to know of a task."""

    environment: Any  # class of the task
    laws: Mapping[str, Callable[..., Any]]
    rival: str  # the law over which wins are counted
    flown: str  # the law that is flown where none is named
    standard: tuple[str, ...]  # laws of a benchmark where none is named
    defaults: tuple[str, ...]  # its scenarios where none is named
    policies: Callable[[], Mapping[str, Path]]  # that come with the kit, by name
    decisions: int = 250  # of an episode of 20 s
    bounds: tuple[str, ...] = ("hover", "oracle")  # no designed laws: the ends of the scales
    # 95 % interval of one law's mean RMSE
    interval: Callable[..., tuple[float, float]] = hierarchical_bootstrap

    def references(self, names: Sequence[str]) -> list[str]:
        """Return ``names`` and the laws that scores, wins and shares are relative to."""
        return list(dict.fromkeys([*names, "hover", self.rival, *self.bounds]))


_WIND = {
    "rival": "pid",
    "flown": "pid-force",
    "defaults": ("base", "turbulent"),
    "decisions": 500,
}
TASKS: dict[str, Task] = {
    "FanTracking": Task(
        FanTrackingEnv,
        TASK_LAWS["FanTracking"],
        "admittance",
        "admittance",
        ("hover", "admittance", "ratio", "oracle"),
        ("static", "base"),
        shipped_policies,
        bounds=("hover", "limit", "oracle"),
        interval=episode_bootstrap,
    ),
    "FanTracking2D": Task(
        FanTracking2DEnv,
        TASK_LAWS["FanTracking2D"],
        "admittance",
        "admittance",
        tuple(TASK_LAWS["FanTracking2D"]),
        ("static", "base", "fast"),
        partial(shipped_policies, "FanTracking2D"),
    ),
    **{
        name: Task(
            environment=environment,
            laws=TASK_LAWS[name],
            standard=tuple(TASK_LAWS[name]),
            policies=partial(shipped_policies, name),
            **_WIND,  # type: ignore[arg-type]
        )
        for name, environment in (
            ("WindHover", WindHoverEnv),
            ("WindTrajectory", WindTrajectoryEnv),
        )
    },
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


def make_environment(task: str, scenario: str, controller: Any = None) -> Any:
    """Return the environment of a scenario, with what a trained policy needs in its ``info``."""
    if isinstance(controller, TrainedPolicy):
        return scenario_env(scenario, controller.features.sources)
    return TASKS[task].environment(scenario)


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
