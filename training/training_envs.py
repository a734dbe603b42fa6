"""The environments of training: a scenario, or a tier, a mix of several."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..envs.closed_loop import ClosedLoop
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.lanes.vector import TaskLanes
from ..envs.scenarios import SCENARIOS
from ..envs.vector import TaskVectorEnv
from ..evaluation.episodes import DECISIONS
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


def check_training_env(name: str) -> None:
    """Check the name of a training environment.

    Raises:
        InputError: neither a scenario nor a tier.
    """
    if name not in SCENARIOS and name not in TIERS:
        raise unknown_name("scenario", name, [*SCENARIOS, *TIERS])


class MixedFanTracking(FanTrackingEnv):
    """Each episode in one of several scenarios, drawn from the episode's seed."""

    def __init__(self, scenario: Sequence[str], **named: Any) -> None:
        super().__init__(scenario[0], **named)
        self._names = scenario
        self._loops: dict[str, ClosedLoop | None] = {}  # of the scenarios that were flown

    def draw_loop(self) -> None:
        """Draw a scenario, and the closed loop of an episode in it.

        The state of the episode's generator seeds another one for the scenario: a draw of the
        former would settle the fan's motion, too.
        """
        state = self.np_random.bit_generator.state["state"]["state"]
        generator = np.random.default_rng((state, _SCENARIO))
        name = self._names[int(generator.integers(len(self._names)))]
        self.scenario, self._loop = SCENARIOS[name], self._loops.get(name)
        self.fan = replace(self.fan, turbulence=self.scenario.turbulence)
        super().draw_loop()
        self._loops[name] = self._loop


def make_training_env(name: str, **given: Any) -> FanTrackingEnv:
    """Return the environment of a scenario or a tier, with other arguments of ``FanTrackingEnv``.

    Raises:
        InputError: a name that does not exist.
    """
    check_training_env(name)
    return (
        MixedFanTracking(TIERS[name], **given) if name in TIERS else FanTrackingEnv(name, **given)
    )


def make_training_envs(name: str, count: int, estimator: str = "ukf") -> TaskVectorEnv:
    """Return ``count`` training environments side by side.

    Args:
        name: scenario or tier.
        count: how many.
        estimator: of the environments: ``ukf``, ``constant-gain``, its fast stand-in, or
            ``ukf-lanes``: the full filter, plant and flight loop in the lanes of a vector unit.

    Raises:
        InputError: an unknown name, or ``ukf-lanes`` with a tier.
    """
    check_training_env(name)
    if estimator == LANES:
        if name in TIERS:
            raise InputError(f"training: {LANES} flies one scenario, got {name!r}")
        return TaskLanes(count, DECISIONS, scenario=name)
    kind = MixedFanTracking if name in TIERS else FanTrackingEnv
    world = TIERS.get(name, name)
    return TaskVectorEnv(count, DECISIONS, task=kind, scenario=world, estimator=estimator)
