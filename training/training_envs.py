"""The environments of training: a scenario, or in FanTracking a tier, a mix of several."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np

from ..controllers.registry import STANDARD_TASK
from ..envs.closed_loop import ClosedLoop
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.lanes.vector import TaskLanes
from ..envs.scenarios import SCENARIOS
from ..envs.vector import TaskVectorEnv
from ..evaluation.episodes import DECISIONS
from ..evaluation.tasks import task_of
from ..runtime.errors import InputError, unknown_name

LANES = "ukf-lanes"
_SCENARIO = 1  # second word of the seed of an episode's scenario

# a repeated scenario is drawn twice as often
TIERS: dict[str, tuple[str, ...]] = {
    "base-fast": ("base", "fast"),
    "wide": (
        "static",
        "base",
        "base",
        "fast",
        "fast",
        "slow-filter",
        "noisy",
        "gusty",
        "far",
        "varied",
    ),
}


def check_training_env(name: str, task: str = STANDARD_TASK) -> None:
    """Check the name of a training environment.

    Raises:
        InputError: neither a scenario of the task nor, in FanTracking, a tier.
    """
    if task != STANDARD_TASK:
        task_of(task).scenario(name)
    elif name not in SCENARIOS and name not in TIERS:
        raise unknown_name("scenario", name, [*SCENARIOS, *TIERS])


class MixedFanTracking(FanTrackingEnv):
    """Each episode in one of several scenarios, drawn from the episode's seed."""

    mixes = True

    def __init__(self, scenario: Sequence[str], **named: Any) -> None:
        super().__init__(scenario[0], **named)
        self._names = scenario

    def draw_loop(self, rng: np.random.Generator, kept: dict[Any, ClosedLoop]) -> ClosedLoop:
        """Draw a scenario; return the closed loop of an episode in it.

        The state of the episode's generator seeds another one for the scenario: a draw of the
        former would settle the fan's motion, too.
        """
        generator = np.random.default_rng((rng.bit_generator.state["state"]["state"], _SCENARIO))
        name = self._names[int(generator.integers(len(self._names)))]
        self.scenario = SCENARIOS[name]
        self.fan = replace(self.fan, turbulence=self.scenario.turbulence)
        return super().draw_loop(rng, kept)


def make_training_env(
    name: str,
    task: str = STANDARD_TASK,
    reward: str | None = None,
    observation: str | None = None,
) -> Any:
    """Return the environment of a scenario or a tier, in SI units; ``reward`` is one's own.

    Raises:
        InputError: a name that does not exist.
    """
    check_training_env(name, task)
    if name in TIERS and task == STANDARD_TASK:
        return MixedFanTracking(TIERS[name], observation=observation)
    return task_of(task).make(name, reward, observation=observation)


def make_training_envs(
    name: str,
    count: int,
    estimator: str = "ukf",
    task: str = STANDARD_TASK,
    observation: str | None = None,
) -> gym.vector.VectorEnv:
    """Return ``count`` training environments side by side.

    Args:
        name: scenario or tier.
        count: how many.
        estimator: the environments': ``ukf``, ``constant-gain``, its fast stand-in, or
            ``ukf-lanes``: the full filter, plant and flight loop in the lanes of a vector unit.
        task: a name, as of ``evaluation.tasks.task_of``.
        observation: one of ``OBSERVATIONS``, normalised, in place of the task's own.

    Raises:
        InputError: an unknown name, or ``ukf-lanes`` with a tier.
    """
    check_training_env(name, task)
    arguments: dict[str, Any] = {"observation": observation} if observation else {}
    if task != STANDARD_TASK:
        if estimator != "ukf":
            arguments |= {"plant": "lanes"} if estimator == LANES else {"estimator": estimator}
        return task_of(task).make_many(count, name, **arguments)
    arguments |= {"normalize": observation is not None}
    if estimator == LANES:
        if name in TIERS:
            raise InputError(f"training: {LANES} flies one scenario, got {name!r}")
        return TaskLanes(count, DECISIONS, task=FanTrackingEnv, scenario=name, **arguments)
    kind = MixedFanTracking if name in TIERS else FanTrackingEnv
    world = TIERS.get(name, name)
    arguments |= {"scenario": world, "estimator": estimator}
    return TaskVectorEnv(count, DECISIONS, task=kind, **arguments)
