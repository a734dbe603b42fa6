"""Tasks by name, with their scenarios, laws and rivals: the kit's four, and a user's.

A user's task is an id registered with Gymnasium, or ``FILE.py:NAME`` with the class of an
environment. ``info`` has ``error`` (m); without an error the leaderboard ranks by return.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec, load_env_creator

from ..controllers.fan_laws import Hover
from ..controllers.registry import (
    OWN_LAWS,
    STANDARD_TASK,
    TASK_LAWS,
    make_controller,
    shipped_policies,
)
from ..controllers.trained_policy import is_policy_path, load_policy
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.fan_tracking_2d import FanTracking2DEnv
from ..envs.scenarios import find_scenario, scenarios_in
from ..envs.wind_tasks import WindHoverEnv, WindTrajectoryEnv
from ..runtime.errors import InputError, unknown_name
from ..runtime.python_file import import_file, is_file_name, named_in_file
from .rewards import OwnReward, find_reward
from .statistics import episode_bootstrap, hierarchical_bootstrap

ALONE = "default"  # scenario of a task without scenarios
_WHAT = "a Python file with the class of a Gymnasium environment"


@dataclass(frozen=True)
class BenchmarkTask:
    """A task with its rivals and defaults."""

    environment: Any  # class of the environment
    rival: str  # wins are counted over this law
    flown: str  # default law of one episode
    defaults: tuple[str, ...]  # default scenarios
    selected: tuple[str, ...] = ()  # default laws of a benchmark; none: all
    bounds: tuple[str, ...] = ("hover", "oracle")  # no designed laws: the ends of the scales
    # 95 % interval of one law's mean RMSE
    interval: Callable[..., tuple[float, float]] = hierarchical_bootstrap
    spec: EnvSpec | None = None  # if the task is a user's
    kin: str = ""  # the kit's task with the parent class, action and observation

    @property
    def name(self) -> str:
        """Its name in results: one of ``TASKS``, or the registered id."""
        return self.spec.id if self.spec else str(self.environment.name)

    @property
    def scenarios(self) -> Mapping[str, Any]:
        """All of its worlds, by name; none where its class has no ``scenarios``."""
        by_name: Mapping[str, Any] = getattr(self.environment, "scenarios", {})
        return by_name

    @property
    def laws(self) -> Mapping[str, Callable[..., Any]]:
        """All of its designed laws, by name."""
        return TASK_LAWS.get(self.kin or self.name, {"hover": Hover})

    @property
    def standard(self) -> tuple[str, ...]:
        """Default laws of a benchmark."""
        return self.selected or tuple(self.laws)

    @property
    def flown_in(self) -> str:
        """Default scenario of one episode."""
        return "base" if "base" in self.scenarios else self.defaults[0]

    @property
    def decisions(self) -> int:
        """Decisions of an episode."""
        spec = self.spec
        return int((spec and spec.max_episode_steps) or self.environment.decisions())

    def policies(self) -> Mapping[str, Path]:
        """Return the kit's own policies, by name."""
        kit_task = self.kin or self.name
        return shipped_policies(kit_task) if kit_task in TASK_LAWS else {}

    def references(self, names: Sequence[str]) -> list[str]:
        """Return ``names`` and the reference laws of scores, wins and shares."""
        some = ("hover", self.rival, *self.bounds)
        return list(dict.fromkeys([*names, *(law for law in some if law in self.laws)]))

    def scenario(self, name: str) -> Any:
        """Return a scenario by its name, of a YAML file or of a Python file.

        Raises:
            InputError: as ``find_scenario``, or the task has none of this name.
        """
        if self.scenarios:
            return find_scenario(name, self.scenarios)
        if name != ALONE:
            raise unknown_name("scenario", name, [ALONE])
        return None

    def make(self, scenario: str, reward: str | None = None, **given: Any) -> Any:
        """Return an environment in SI units, for controllers.

        Args:
            scenario: a name, as of ``scenario``.
            reward: one's own, as of ``find_reward``; default: the task's.
            **given: other arguments of the environment; None: not given.

        Raises:
            InputError: as ``scenario`` and ``find_reward``, the environment takes no such argument,
                or its actions are no box.
        """
        given = {name: value for name, value in given.items() if value is not None}
        if self.scenarios:
            given["scenario"] = self.scenario(scenario)
        if self.spec is None:
            env: Any = self.environment(**given)
        else:
            units = {"normalize": False} if self.kin else {}
            try:
                env = gym.make(self.spec, disable_env_checker=True, **units, **given)
            except TypeError as error:
                raise InputError(f"{self.name}: cannot be made: {error}") from error
            if not isinstance(env.action_space, gym.spaces.Box):
                raise InputError(
                    f"{self.name}: expected actions in a Box, got {env.action_space}: control laws "
                    "command real numbers"
                )
        return env if reward is None else OwnReward(env, find_reward(reward))

    def make_many(self, count: int, scenario: str, **given: Any) -> gym.vector.VectorEnv:
        """Return a vector of ``count`` environments for learners, normalised if the task is the
        kit's or extends one of the kit's.

        Args:
            count: number of environments.
            scenario: a name, as of ``scenario``.
            **given: other arguments of the environment.
        """
        if self.scenarios:
            given["scenario"] = self.scenario(scenario)
        if self.kin or self.spec is None:
            given.setdefault("normalize", True)
        if self.spec is None:
            many: gym.vector.VectorEnv = self.environment.vector(count, **given)
            return many
        mode = "sync" if self.spec.vector_entry_point is None else "vector_entry_point"
        return gym.make_vec(self.spec, count, vectorization_mode=mode, **given)

    def units(self, envs: gym.vector.VectorEnv, judge: Any) -> dict[str, Any]:
        """Return the entries of a policy's card for the units of ``make``: ``scale`` of the
        observation, ``largest`` of the action.

        Args:
            envs: from ``make_many``.
            judge: from ``make``, with the same observation.

        Raises:
            InputError: the spaces of ``envs`` are no boxes of one dimension, or the action's range
                is not -1 to 1.
        """
        seen: Any = envs.single_observation_space
        action: Any = envs.single_action_space
        boxes = all(isinstance(s, gym.spaces.Box) and len(s.shape) == 1 for s in (seen, action))
        if not boxes or np.any(action.high != 1.0) or np.any(action.low != -1.0):
            raise InputError(
                f"train: {self.name}: expected observations (n,) and actions (k,) in [-1, 1], got "
                f"{seen} and {action}"
            )
        if self.kin or self.spec is None:
            world = judge.unwrapped
            return {"scale": [*map(float, world.bounds()[1])], "largest": world.largest_action}
        return {"scale": [1.0] * seen.shape[0], "largest": 1.0}


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


def import_files(paths: Iterable[str]) -> None:
    """Run Python files that register tasks, laws, scenarios or rewards; each once in a process.

    Raises:
        InputError: as ``import_file``.
    """
    for path in paths:
        import_file(path, "a Python file that registers a task, a law or a reward")


@cache
def task_of(name: str) -> BenchmarkTask:
    """Return a task by its name: one of ``TASKS``, a registered id, or ``FILE.py:NAME``.

    Raises:
        InputError: no task has this name, its file holds none, or it states no length of an
            episode.
    """
    if name in TASKS:
        return TASKS[name]
    if is_file_name(name):
        kind = named_in_file(name, "task", _WHAT, _is_environment)
        many = getattr(kind, "vector", None)
        entries = kind, f"{Path(kind.__module__).stem}:{kind.__name__}"
        spec = next((s for s in gym.registry.values() if s.entry_point in entries), None)
        spec = spec or EnvSpec(f"own/{kind.__name__}-v0", kind, vector_entry_point=many)
    else:
        try:
            spec = gym.spec(name)
        except gym.error.Error as error:
            if "/" not in name:
                raise unknown_name("task", name, TASKS) from error
            raise InputError(
                f"unknown task {name!r}; expected an id registered by Gymnasium or --import "
                f"FILE.py, FILE.py:NAME, or one of {', '.join(TASKS)}"
            ) from error
        kind = spec.entry_point
        kind = load_env_creator(kind) if isinstance(kind, str) else kind
    if spec.namespace == "windwrench" and spec.name in TASKS and spec.version in (0, 1):
        return TASKS[spec.name]
    if spec.max_episode_steps is None:
        if not hasattr(kind, "decisions"):
            raise InputError(
                f"{name}: states no length of an episode; expected max_episode_steps in "
                "gymnasium.register, or a class method decisions()"
            )
        spec = replace(spec, max_episode_steps=kind.decisions())
    kin = next((n for n, t in TASKS.items() if _is_kin(kind, spec.kwargs, t.environment)), "")
    if kin:
        return replace(TASKS[kin], environment=kind, spec=spec, kin=kin)
    scenarios = tuple(getattr(kind, "scenarios", ())) or (ALONE,)
    worlds = ("base",) if "base" in scenarios else scenarios[:1]
    return BenchmarkTask(kind, "hover", "hover", worlds, spec=spec)


def _is_kin(kind: Any, arguments: Mapping[str, Any], kit: Any) -> bool:
    """Return whether a class extends the kit's, with the action and observation of its laws."""
    fields = ("action", "observation", "decision_hz", "observe")
    return kit in getattr(kind, "__mro__", ()) and all(
        arguments.get(name, getattr(kind, name)) == getattr(kit, name) for name in fields
    )


def _is_environment(value: Any) -> bool:
    return inspect.isclass(value) and issubclass(value, gym.Env | gym.vector.VectorEnv)


def scenario_names(given: Iterable[str], task: BenchmarkTask) -> list[str]:
    """Return scenarios by name; in place of a YAML file with groups the names of its scenarios.

    Raises:
        InputError: as ``BenchmarkTask.scenario``.
    """
    names: list[str] = []
    for name in given:
        some = [name]
        if name.endswith((".yaml", ".yml")) and task.scenarios:
            some = [*scenarios_in(name, task.scenarios)]
        for each in some:
            task.scenario(each)
        names += some
    return names


def make_pilot(name: str, task: str = STANDARD_TASK) -> Any:
    """Return a new controller of a task.

    Args:
        name: a law, one of the kit's policies, the path of a trained policy, a YAML file of a law,
            or FILE.py:CLASS, which runs the file. In a user's task ``hover`` is the middle of
            the action space.
        task: as of ``task_of``.

    Raises:
        InputError: no controller has this name, a file holds none, or a policy of another task.
    """
    flown_task = task_of(task)
    shipped = flown_task.policies()
    if name in shipped or is_policy_path(name):
        policy = load_policy(shipped.get(name, name))
        if policy.task not in (flown_task.name, flown_task.kin):
            raise InputError(f"{name}: a policy of {policy.task}, not of {task}")
        return policy
    if flown_task.kin or flown_task.spec is None or is_file_name(name):
        return make_controller(name, flown_task.kin or flown_task.name)
    if name in OWN_LAWS:
        return OWN_LAWS[name]()
    if name not in flown_task.laws:
        raise unknown_name("controller", name, [*flown_task.laws, *OWN_LAWS])
    space = flown_task.make(flown_task.defaults[0]).action_space
    return lambda observation, info=None: 0.5 * (space.low + space.high)


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Return the controllers' names in tables and pictures. A policy's file shows its name, with
    the folders that tell policies apart.
    """
    parts = {
        name: Path(name).with_suffix("").parts if is_policy_path(name) else (name,)
        for name in names
    }
    shown = {}
    for name, folders in parts.items():
        ends = ["/".join(folders[i:]) for i in reversed(range(len(folders)))]
        others = ["/".join(("", *other)) for key, other in parts.items() if key != name]
        alone = (end for end in ends if not any(o.endswith(f"/{end}") for o in others))
        shown[name] = next(alone, ends[-1])
    return shown
