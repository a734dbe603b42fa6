"""Episodes of a law as a Minari dataset: what offline learners read.

Episodes have seeds of the training range, so that nothing of a benchmark is in them.
"""

import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from ..envs.scenarios import SCENARIOS
from ..runtime.errors import InputError, unknown_name
from ..runtime.extras import need
from .benchmark import make_pilot
from .briefing import briefing_of
from .task_benchmark import TASKS, make_task_pilot

# below them training draws its episodes, from them on validation and test do
FIRST_HELD_OUT_SEED = 900_000
_EPISODES = 10_000  # of a seed, at most
_PLACE = "MINARI_DATASETS_PATH"  # the variable by which Minari finds its folder


@dataclass(frozen=True)
class Dataset:
    """A written dataset; returns are sums of reward over an episode."""

    id: str
    task: str
    scenario: str
    controller: str
    episodes: int
    decisions: int
    mean_return: float
    lost: int


def dataset_id(task: str, scenario: str, controller: str) -> str:
    """Return the name that Minari knows a dataset by; of a file, its stem."""
    return f"windwrench/{task}/{scenario}-{Path(controller.split(':')[0]).stem}-v0"


def check_dataset_request(
    task: str, controllers: list[str], scenarios: list[str], episodes: int, seed: int
) -> None:
    """Check what ``write_dataset`` is asked for, before anything is flown.

    Raises:
        InputError: Minari is not installed, an unknown name, or numbers out of range.
    """
    need("minari", "minari")
    if task not in ("FanTracking", *TASKS):
        raise unknown_name("task", task, ["FanTracking", *TASKS])
    known: Mapping[str, Any] = SCENARIOS if task == "FanTracking" else TASKS[task].scenarios
    for name in scenarios:
        if name not in known:
            raise unknown_name("scenario", name, known)
    for name in controllers:
        _pilot(task, name)
    if not 1 <= episodes <= _EPISODES:
        raise InputError(f"minari: --episodes must lie between 1 and {_EPISODES}, got {episodes}")
    last = FIRST_HELD_OUT_SEED // _EPISODES - 1
    if not 0 <= seed <= last:
        raise InputError(f"minari: --seed must lie between 0 and {last}, got {seed}")


def _pilot(task: str, name: str) -> Any:
    return make_pilot(name) if task == "FanTracking" else make_task_pilot(name, task)


@contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    before = os.environ.get(_PLACE)
    os.environ[_PLACE] = str(folder.absolute())
    try:
        yield
    finally:
        if before is None:
            del os.environ[_PLACE]
        else:
            os.environ[_PLACE] = before


def write_dataset(
    task: str,
    scenario: str,
    controller: str,
    episodes: int,
    seed: int,
    folder: Path,
    each: Callable[[], None] = lambda: None,
) -> Dataset:
    """Fly a law and write its episodes as a dataset of Minari below ``folder``.

    Args:
        task: FanTracking or one of ``TASKS``.
        scenario: its name.
        controller: a name, a trained policy's path, or FILE.py:CLASS.
        episodes: how many.
        seed: the episodes' seeds are ``10 000 seed + i``.
        folder: Minari's, for which its variable MINARI_DATASETS_PATH stands.
        each: called after each episode.

    Raises:
        InputError: as ``check_dataset_request``, or there is such a dataset already.
    """
    check_dataset_request(task, [controller], [scenario], episodes, seed)
    from minari import DataCollector

    name = dataset_id(task, scenario, controller)
    if (folder / name).exists():
        raise InputError(f"minari: {folder / name} is there already; remove it or choose --out")
    pilot = _pilot(task, controller)
    returns, decisions, lost = [], 0, 0
    with _kept_in(folder):
        env = DataCollector(gymnasium.make(f"windwrench/{task}-v0", scenario=scenario))
        inner: Any = env.unwrapped
        for i in range(episodes):
            if hasattr(inner, "preview"):
                inner.preview = getattr(pilot, "preview", 0.0)
            observation, info = env.reset(seed=_EPISODES * seed + i)
            if hasattr(pilot, "brief"):
                pilot.brief(briefing_of(env))
            pilot.reset()
            total, over = 0.0, False
            while not over:
                action = np.asarray(pilot(observation, info), dtype=np.float32)
                observation, reward, ended, late, info = env.step(action)
                total, over, decisions = total + float(reward), ended or late, decisions + 1
            returns.append(total)
            lost += bool(info["lost"])
            each()
        with warnings.catch_warnings():
            # of author, address and permalink, which the one who publishes it knows
            warnings.simplefilter("ignore", UserWarning)
            env.create_dataset(
                name,
                algorithm_name=controller,
                description=f"{controller} in {task}, scenario {scenario}; seeds from "
                f"{_EPISODES * seed} on",
                requirements=["windwrench"],
            )
        env.close()
    return Dataset(
        name, task, scenario, controller, episodes, decisions, float(np.mean(returns)), lost
    )
