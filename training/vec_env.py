"""The training environments as stable-baselines3 wants them, with the policy's features
for observations.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from ..controllers.features import Features, History
from ..envs.fan_tracking import LOST_OFFSET
from ..envs.vector import TaskVectorEnv

Array = NDArray[np.float32]


class FeatureVecEnv(VecEnv):  # type: ignore[misc]
    """An SB3 ``VecEnv`` over a Gymnasium vector environment of fan-tracking environments.

    Each environment on its own: at an episode's end, ``infos[i]["terminal_observation"]`` holds its
    last features, and ``infos[i]["TimeLimit.truncated"]`` is True where only the clock ended the
    episode. The returned observation is the first of the next episode. Every episode's seed is
    given by ``seed_of``. ``episode`` (n,) holds the numbers of the episodes in flight: set to those
    of another run, ``reset`` goes on with the episodes that follow.

    Args:
        envs: of FanTracking.
        features: of the policy.
        seed_of: from environment and episode to the episode's seed.
        reward: weights of the terms ``tracking``, ``change`` and ``squared`` (minus the squared
            offset in m2).
    """

    render_mode: str | None = None  # SB3 asks for it

    def __init__(
        self,
        envs: TaskVectorEnv,
        features: Features,
        seed_of: Callable[[int, int], int],
        reward: Mapping[str, float] | None = None,
    ) -> None:
        self.envs, self.features = envs, features
        self._seed_of = seed_of
        self._weights = dict(reward or {"tracking": 1.0, "change": 1.0, "squared": 0.0})
        space = gym.spaces.Box(-10.0, 10.0, (features.size,), np.float32)
        super().__init__(envs.num_envs, space, envs.single_action_space)
        self._history = History(features, self.num_envs)
        self.episode = np.full(self.num_envs, -1)  # none has begun
        self._length = np.zeros(self.num_envs, dtype=np.int64)  # decisions since the start
        self._returns, self._squares = np.zeros(self.num_envs), np.zeros(self.num_envs)
        self._commands = np.zeros((self.num_envs, 1), dtype=np.float32)

    def _begin(self, which: NDArray[np.bool_]) -> None:
        """Start the next episode of the environments ``which``."""
        self.episode[which] += 1
        seeds = [self._seed_of(i, int(e)) for i, e in enumerate(self.episode)]
        observations, _ = self.envs.reset(seed=seeds, options={"reset_mask": which.copy()})
        self._history.restart(self.features.frames(observations), which)
        for sums in (self._length, self._returns, self._squares):
            sums[which] = 0

    def reset(self) -> Array:
        """Start the next episode everywhere; return the features (n, size) of its beginning."""
        self._begin(np.ones(self.num_envs, dtype=np.bool_))
        return self._history.flat()

    def step_async(self, actions: Array) -> None:
        """Keep the actions (n, 1) for ``step_wait``."""
        self._commands = np.array(actions, dtype=np.float32)

    def step_wait(self) -> tuple[Array, Array, NDArray[np.bool_], list[dict[str, Any]]]:
        """Fly one decision everywhere; return features (n, size), rewards (n,), dones (n,) and
        infos.
        """
        observations, _, lost, over, infos = self.envs.step(self._commands)
        offset = np.minimum(np.abs(infos["offset"]), LOST_OFFSET)
        rewards = (
            self._weights["tracking"] * infos["reward_tracking"]
            + self._weights["change"] * infos["reward_change"]
            - self._weights["squared"] * offset**2
        ).astype(np.float32)
        self._returns += rewards
        self._squares += offset**2
        self._length += 1
        self._history.push(self.features.frames(observations))
        dones = lost | over
        told: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            last = self._history.flat()
            for i in np.flatnonzero(dones).tolist():
                length = int(self._length[i])
                told[i] = {
                    "terminal_observation": last[i],
                    "TimeLimit.truncated": bool(over[i] and not lost[i]),
                    "episode": {"r": float(self._returns[i]), "l": length, "t": 0.0},
                    "rmse": float(np.sqrt(self._squares[i] / length)),
                }
            self._begin(dones)
        return self._history.flat(), rewards, dones, told

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of this adapter for each environment asked for."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: the environments share their settings."""
        raise AttributeError(f"FeatureVecEnv: {attr_name} cannot be set on single environments")

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Refuse: the environments are stepped together."""
        raise AttributeError(
            f"FeatureVecEnv: {method_name} cannot be called on single environments"
        )

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Tell SB3 to read ``infos[i]["episode"]``: episodes are counted here."""
        return [wrapper_class.__name__ == "Monitor" for _ in self._get_indices(indices)]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Do nothing: every episode's seed follows from the run's seed and the episode's number."""
        return [None] * self.num_envs
