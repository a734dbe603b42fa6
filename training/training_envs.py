"""The environments of training: a scenario, or in FanTracking a tier, a mix of several."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np

from ..controllers.registry import STANDARD_TASK
from ..envs.closed_loop import ClosedLoop
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.scenarios import SCENARIOS
from ..evaluation.tasks import BenchmarkTask, task_of
from ..runtime.errors import InputError

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


class MixedFanTracking(FanTrackingEnv):
    """FanTracking in a scenario, or with each episode in one of a tier's, drawn from the episode's
    seed.
    """

    scenarios: ClassVar[Mapping[str, Any]] = {**SCENARIOS, **TIERS}

    def __init__(self, scenario: Any, **named: Any) -> None:
        self.mixes = isinstance(scenario, tuple)
        self._names = scenario if self.mixes else ()
        super().__init__(scenario[0] if self.mixes else scenario, **named)

    def draw_loop(self, rng: np.random.Generator, kept: dict[Any, ClosedLoop]) -> ClosedLoop:
        """Draw a scenario; return the closed loop of an episode in it.

        The state of the episode's generator seeds another one for the scenario: a draw of the
        former would settle the fan's motion, too.
        """
        if self.mixes:
            state = rng.bit_generator.state["state"]["state"]
            generator = np.random.default_rng((state, _SCENARIO))
            name = self._names[int(generator.integers(len(self._names)))]
            self.scenario = SCENARIOS[name]
            self.fan = replace(self.fan, turbulence=self.scenario.turbulence)
        return super().draw_loop(rng, kept)


def training_task(name: str) -> BenchmarkTask:
    """Return a task by its name, as of ``evaluation.tasks.task_of``; FanTracking has tiers, too."""
    task = task_of(name)
    return replace(task, environment=MixedFanTracking) if name == STANDARD_TASK else task


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
    given: dict[str, Any] = {"observation": observation} if observation else {}
    if task == STANDARD_TASK:
        given["normalize"] = observation is not None
        if estimator == LANES and name in TIERS:
            raise InputError(f"training: {LANES} flies one scenario, got {name!r}")
    if estimator != "ukf":
        given |= {"plant": "lanes"} if estimator == LANES else {"estimator": estimator}
    return training_task(task).make_many(count, name, **given)
