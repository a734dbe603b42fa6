"""The training environments as stable-baselines3 wants them, in FanTracking with the policy's
features for observations.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from ..controllers.features import Features, History
from ..envs.definition import LOST_OFFSET
from ..evaluation.episodes import error_of
from ..evaluation.rewards import Reward, total_of
from ..runtime.arrays import Mask, Single
from .seeds import training_seed

_seed_of_run_0 = partial(training_seed, 0)


class FeatureVecEnv(VecEnv):  # type: ignore[misc]
    """An SB3 ``VecEnv`` over a Gymnasium vector environment.

    At an episode's end, ``infos[i]["terminal_observation"]`` holds the environment's last features.
    ``infos[i]["TimeLimit.truncated"]`` is True if the clock alone ended the episode. The returned
    observation is the first of the next episode. Every episode's seed is given by ``seed_of``.
    ``episode`` (n,) holds the numbers of the episodes in flight. With the numbers of another run,
    ``reset`` continues with that run's next episodes.

    Args:
        envs: Gymnasium's, with the option ``reset_mask``.
        features: a FanTracking policy's; None: the observations as they are.
        seed_of: from environment and episode to the episode's seed; default: those of run 0.
        reward: computed from ``infos``; None: the environments' own.
    """

    render_mode: str | None = None  # SB3 asks for it

    def __init__(
        self,
        envs: Any,
        features: Features | None = None,
        seed_of: Callable[[int, int], int] = _seed_of_run_0,
        reward: Reward | None = None,
    ) -> None:
        self.envs = envs
        self.features = features
        self._seed_of = seed_of
        self._reward = reward
        space = envs.single_observation_space
        if features is not None:
            space = gym.spaces.Box(-10.0, 10.0, (features.size,), np.float32)
        super().__init__(envs.num_envs, space, envs.single_action_space)
        self._history = None if features is None else History(features, self.num_envs)
        self.episode = np.full(self.num_envs, -1)  # none has begun
        self._length = np.zeros(self.num_envs, dtype=np.int64)  # decisions since the start
        self._returns, self._squares = np.zeros(self.num_envs), np.zeros(self.num_envs)
        self._commands = np.zeros((self.num_envs, 1), dtype=np.float32)

    def _look(self, observations: Single, begun: Mask | None = None) -> Single:
        """Return the learner's observations (n, size); episodes have ``begun`` in some."""
        if self._history is None or self.features is None:
            return np.array(observations, dtype=np.float32)
        frames = self.features.frames(observations)
        if begun is None:
            self._history.push(frames)
        else:
            self._history.restart(frames, begun)
        return self._history.flat()

    def _begin(self, which: Mask) -> Single:
        """Start the next episode of the environments ``which``; return all observations."""
        self.episode[which] += 1
        seeds = [self._seed_of(i, int(e)) for i, e in enumerate(self.episode)]
        observations, _ = self.envs.reset(seed=seeds, options={"reset_mask": which.copy()})
        for sums in (self._length, self._returns, self._squares):
            sums[which] = 0
        return self._look(observations, which)

    def reset(self) -> Single:
        """Start the next episode everywhere; return the features (n, size) of its beginning."""
        return self._begin(np.ones(self.num_envs, dtype=np.bool_))

    def step_async(self, actions: Single) -> None:
        """Keep the actions (n, 1) for ``step_wait``."""
        self._commands = np.array(actions, dtype=np.float32)

    def step_wait(self) -> tuple[Single, Single, Mask, list[dict[str, Any]]]:
        """Fly one decision everywhere; return features (n, size), rewards (n,), dones (n,) and
        infos.
        """
        observations, rewards, lost, over, infos = self.envs.step(self._commands)
        if self._reward is not None:
            rewards = total_of(self._reward, infos)[0]
        rewards = rewards.astype(np.float32)
        error = error_of(infos)
        self._returns += rewards
        self._squares += np.nan if error is None else np.minimum(error, LOST_OFFSET) ** 2
        self._length += 1
        last = self._look(observations)
        dones = lost | over
        learner_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            for i in np.flatnonzero(dones).tolist():
                length = int(self._length[i])
                learner_infos[i] = {
                    "terminal_observation": last[i],
                    "TimeLimit.truncated": bool(over[i] and not lost[i]),
                    "episode": {"r": float(self._returns[i]), "l": length, "t": 0.0},
                    "rmse": float(np.sqrt(self._squares[i] / length)),
                }
            last = self._begin(dones)
        return last, rewards, dones, learner_infos

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
