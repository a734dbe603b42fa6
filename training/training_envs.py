"""The environments that policies are trained in: a scenario, or a tier that mixes several."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

from ..envs.fan_tracking import TRUTH, FanTrackingEnv, scenario_env
from ..envs.lanes.vector import TaskLanes
from ..envs.scenarios import SCENARIOS
from ..envs.vector import TaskVectorEnv
from ..evaluation.episodes import DECISIONS
from ..runtime.errors import InputError, unknown_name

Frame = NDArray[np.float32]

LANES = "ukf-lanes"
_SCENARIO = 1  # second word of the seed from which the scenario of an episode is drawn

# a scenario that comes twice is drawn twice as often
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


def scenarios_of(name: str) -> tuple[str, ...]:
    """Return the scenarios of a tier, as often as they are drawn, or the one scenario."""
    return TIERS.get(name, (name,))


class MixedFanTracking(gym.Env[Frame, Frame]):
    """Each episode in one of several scenarios, drawn from the episode's seed."""

    def __init__(self, scenarios: tuple[str, ...], **kwargs: Any) -> None:
        self.envs = {name: FanTrackingEnv(name, **kwargs) for name in dict.fromkeys(scenarios)}
        self._scenarios = scenarios
        self._env = self.envs[scenarios[0]]
        self.observation_space, self.action_space = (
            self._env.observation_space,
            self._env.action_space,
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Frame, dict[str, Any]]:
        """Draw a scenario and start an episode in it.

        The episode is that of the scenario with the same seed; which scenario it is, is drawn by
        itself, or it would settle the fan's motion, too.
        """
        super().reset(seed=seed)
        inner = int(self.np_random.integers(2**31)) if seed is None else seed
        drawn = np.random.default_rng((inner, _SCENARIO)).integers(len(self._scenarios))
        self._env = self.envs[self._scenarios[drawn]]
        return self._env.reset(seed=inner, options=options)

    @property
    def current(self) -> FanTrackingEnv:
        """The environment of this episode's scenario."""
        return self._env

    def step(self, action: Frame) -> tuple[Frame, float, bool, bool, dict[str, Any]]:
        """Step in the scenario of this episode."""
        return self._env.step(action)


class Repeat(gym.Wrapper[Frame, Frame, Frame, Frame]):
    """Hold each command for several decisions; the reward and its terms are their means."""

    def __init__(self, env: gym.Env[Frame, Frame], times: int) -> None:
        super().__init__(env)
        self._times = times

    def step(self, action: Frame) -> tuple[Frame, float, bool, bool, dict[str, Any]]:
        """Fly ``times`` decisions with one command, or fewer where the vehicle is lost."""
        terms = []
        for _ in range(self._times):
            frame, reward, lost, over, info = self.env.step(action)
            terms.append((float(reward), info["reward_tracking"], info["reward_change"]))
            if lost or over:
                break
        mean = np.mean(terms, axis=0)
        info["reward_tracking"], info["reward_change"] = float(mean[1]), float(mean[2])
        return frame, float(mean[0]), lost, over, info


def make_training_env(
    name: str, estimator: str = "ukf", sources: frozenset[str] = frozenset()
) -> gym.Env[Frame, Frame]:
    """Return a training environment.

    Args:
        name: scenario or tier.
        estimator: of the environment: ``ukf``, or ``constant-gain``, its fast stand-in.
        sources: what ``info`` must hold beyond the environment's own (see
            ``envs.fan_tracking``).

    Raises:
        InputError: a name that does not exist.
    """
    check_training_env(name)
    if name not in TIERS:
        return scenario_env(name, sources, estimator)
    if sources - TRUTH:
        raise InputError(
            f"training: quantities beside the filter's estimate need one scenario, not the tier "
            f"{name!r}"
        )
    return MixedFanTracking(TIERS[name], estimator=estimator)


def make_training_envs(
    name: str,
    count: int,
    estimator: str = "ukf",
    repeat: int = 1,
    sources: frozenset[str] = frozenset(),
    autoreset: AutoresetMode = AutoresetMode.DISABLED,
) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Return ``count`` training environments side by side.

    Args:
        name: scenario or tier.
        count: how many.
        estimator: of the environments: ``ukf``, ``constant-gain``, or ``ukf-lanes``: the full
            filter, with plant and flight loop beside it in the lanes of a vector unit.
        repeat: decisions for which a command is held.
        sources: as of ``make_training_env``.
        autoreset: whether an episode that has ended is followed by another, or whoever steps the
            environments resets them.

    Raises:
        InputError: a name that does not exist, or ``ukf-lanes`` with what does not fly in lanes.
    """
    if DECISIONS % repeat:
        raise InputError(
            f"training: repeat must divide the {DECISIONS} decisions of an episode, got {repeat}"
        )
    check_training_env(name)
    plain = name in SCENARIOS and repeat == 1 and not sources - TRUTH
    if estimator == LANES:
        if not plain:
            raise InputError(
                f"training: {LANES} flies one scenario, with repeat 1 and features of the filter's "
                f"estimate, got {name!r}"
            )
        return TaskLanes(count, DECISIONS, scenario=name)
    if plain:
        return TaskVectorEnv(count, DECISIONS, scenario=name, estimator=estimator)

    def make() -> gym.Env[Frame, Frame]:
        env = make_training_env(name, estimator, sources)
        return TimeLimit(Repeat(env, repeat) if repeat > 1 else env, DECISIONS // repeat)

    return SyncVectorEnv([make] * count, autoreset_mode=autoreset)
