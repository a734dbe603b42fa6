"""A run of training in its folder: its request, its progress, and the best policy so far."""

import platform
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..controllers.flight import FlightGains
from ..controllers.registry import STANDARD_TASK
from ..controllers.trained_policy import TaskPolicy, TrainedPolicy, save_policy
from ..envs.definition import TaskDefinition
from ..evaluation.episodes import fly_episode
from ..runtime.errors import InputError
from ..runtime.forms import STRICT, checked
from ..runtime.page_files import write_json
from ..runtime.plain_values import plain
from ..runtime.provenance import package_versions
from ..runtime.regular_files import read_json
from .configuration import Config, features_of
from .seeds import FIRST_VALIDATION_SEED, validation_seeds
from .training_envs import training_task

_SQUASHED = ("sac", "td3")  # algorithms with a tanh behind the policy's output


@dataclass
class Progress:
    """Progress of a run; ``progress.json`` in its folder."""

    __pydantic_config__ = STRICT

    steps: list[int] = field(default_factory=list)  # at each validation
    # after 3 s, mean over the validation episodes; without errors minus the mean return
    rmse_m: list[float] = field(default_factory=list)
    by_error: bool = True
    lost: list[int] = field(default_factory=list)  # episodes of each validation
    best: int = -1  # index of the best
    seconds: float = 0.0  # in all parts of the run, with validation

    @property
    def best_rmse(self) -> float:
        """The smallest validation RMSE, m."""
        return self.rmse_m[self.best]

    def words(self, index: int) -> str:
        """Return a validation's figure in words."""
        figure = self.rmse_m[index]
        return f"RMSE after 3 s {figure:.3f} m" if self.by_error else f"return {-figure:.1f}"


def progress_from(data: Any, path: Path) -> Progress:
    """Return the progress from a file's data.

    Raises:
        InputError: the file holds something else.
    """
    with suppress(InputError):
        progress = checked(Progress, data, str(path))
        count = len(progress.steps)
        if count == len(progress.rmse_m) == len(progress.lost) and -1 <= progress.best < count:
            return progress
    raise InputError(
        f"{path}: does not hold the progress of a training "
        f"({', '.join(f.name for f in fields(Progress))}); delete {path.parent} to start anew"
    )


def read_progress(folder: Path) -> Progress | None:
    """Return the progress of the run in ``folder``; None without a run.

    Raises:
        InputError: the file cannot be read, or holds something else.
    """
    path = folder / "progress.json"
    told = "the progress of a training"
    return progress_from(read_json(path, told), path) if path.exists() else None


def _versions() -> dict[str, str]:
    """Return the versions behind a trained policy."""
    return {"windwrench": __version__, "python": platform.python_version(), **package_versions()}


def origin(algorithm: str, scenario: str, seed: int, steps: int, activation: str) -> dict[str, Any]:
    """Return the shared entries of all learned policies' cards."""
    return {
        "algorithm": algorithm,
        "scenario": scenario,
        "seed": seed,
        "steps": steps,
        "activation": activation,
        "squash": algorithm in _SQUASHED,
        "versions": _versions(),
    }


def card_of(config: Config, scenario: str, seed: int, steps: int) -> dict[str, Any]:
    """Return the card of a policy: everything needed to fly the policy, and to train another."""
    last = FIRST_VALIDATION_SEED + config["validation"]["episodes"] - 1
    return {
        **origin(config["algorithm"], scenario, seed, steps, config["activation"]),
        "features": asdict(features_of(config)),
        "repeat": 1,  # decisions that a command is held
        "seeds": {
            "training": [0, FIRST_VALIDATION_SEED - 1],
            "validation": [FIRST_VALIDATION_SEED, last],
        },
        "config": config,
    }


def flight_of(task: TaskDefinition) -> Any:
    """Return a task's numbers for a flight of its policy elsewhere: the kind of observation (None:
    the task's own) with limits and divisors, the action with its commands, decisions a second, and
    the gains of the flight loop.
    """
    own = task.chosen is None and type(task).observe is not TaskDefinition.observe
    numbers = {
        **vars(task.flown),
        "action": task.action,
        "observation": None if own else task.observation,
        "decision_hz": task.decision_hz,
        "gains": task.gains or FlightGains(),
        "limits": task.kept,
        "divisors": task.divisors,
    }
    return plain(numbers)


def validate(
    policy: TrainedPolicy | TaskPolicy, env: Any, episodes: int
) -> tuple[float, int, bool]:
    """Fly validation episodes with the full filter.

    Returns:
        The mean RMSE after 3 s (m), or minus the mean return; how many episodes were lost; and
            whether the task states an error.
    """
    flown = [fly_episode(env, policy, seed) for seed in validation_seeds(episodes)]
    by_error = all(len(e.error) for e in flown)
    figures = [e.rmse_settled if by_error else -e.total_reward for e in flown]
    return float(np.mean(figures)), sum(e.lost for e in flown), by_error


class Run:
    """A run of training in its folder.

    The folder holds ``training.json`` (the run's request), ``progress.json``, and the policies
    ``last.npz`` and ``best.npz`` with their cards.

    Args:
        config: as of ``load_config``.
        scenario: scenario or tier to train in.
        seed: the run's.
        folder: for its files.
        task: a name, as of ``evaluation.tasks.task_of``.
        reward: one's own, as of ``evaluation.rewards.find_reward``; None: the task's.
        observation: one of ``OBSERVATIONS``; None: the task's own, or features.

    Raises:
        InputError: an unknown name, or a folder with another run.
    """

    def __init__(
        self,
        config: Config,
        scenario: str,
        seed: int,
        folder: Path,
        task: str,
        reward: str | None,
        observation: str | None,
    ) -> None:
        known = training_task(task)
        self.judge = known.make(scenario, reward, observation=observation)
        self.config = config
        self.scenario = scenario
        self.seed = seed
        self.folder = folder
        chosen = {"reward": reward, "observation": observation}
        self.own = {name: value for name, value in chosen.items() if value is not None}
        if task != STANDARD_TASK or observation:
            self.own["task"] = known.name
        self._claim()
        self.progress = Progress()
        self._begun = time.perf_counter()
        self.best = folder / "best.npz"

    def _claim(self) -> None:
        """Write the run's request into its folder."""
        path = self.folder / "training.json"
        run = {"config": self.config, "scenario": self.scenario, "seed": self.seed, **self.own}
        if path.exists():
            earlier_run = read_json(path, "what a training in this folder is")
            if not isinstance(earlier_run, dict):
                raise InputError(
                    f"{path}: does not say what the training in its folder is ({', '.join(run)}); "
                    f"give another --out, or delete {self.folder}"
                )
            if {k: earlier_run.get(k) for k in run} != run:
                raise InputError(
                    f"{self.folder}: holds a run with another configuration, scenario or seed; "
                    "give another --out, or delete it"
                )
        write_json({**run, "versions": _versions()}, path)

    def card(self, steps: int) -> dict[str, Any]:
        """Return the card of the policy after ``steps`` decisions."""
        card = card_of(self.config, self.scenario, self.seed, steps) | self.own
        if "task" in card:
            del card["features"], card["repeat"]
            world = self.judge.unwrapped
            if isinstance(world, TaskDefinition):
                card["flight"] = flight_of(world)
        return card

    def take_stock(self, policy: TrainedPolicy | TaskPolicy) -> None:
        """Validate a policy, and save the policy as the last, and as the best if no earlier policy
        is better.
        """
        episodes = self.config["validation"]["episodes"]
        rmse, lost, by_error = validate(policy, self.judge, episodes)
        card = policy.card
        now = self.progress
        now.by_error = by_error
        now.steps.append(card["steps"])
        now.rmse_m.append(rmse)
        now.lost.append(lost)
        card["validation"] = {"rmse_m": rmse, "lost": lost, "episodes": episodes}
        save_policy(card, policy.weights, self.folder / "last.npz")
        if now.best < 0 or rmse < now.best_rmse:
            now.best = len(now.rmse_m) - 1
            save_policy(card, policy.weights, self.best)
        self.write_progress()

    def write_progress(self) -> None:
        """Write the run's progress to ``progress.json``."""
        now = time.perf_counter()
        self.progress.seconds += now - self._begun
        self._begun = now
        write_json(asdict(self.progress), self.folder / "progress.json")
