"""What CleanRL's published SAC script asks of the old ``gym`` (0.23), made of Gymnasium.

``install()`` puts a module of the name ``gym`` in place that has just that: ``make`` of an
environment whose ``reset`` returns an observation and whose ``step`` returns ``done``; a
``SyncVectorEnv`` of them that restarts one within the step and keeps its last observation as
``terminal_observation``; and ``RecordEpisodeStatistics``.
"""

import sys
import types

import gymnasium
import numpy as np


class OldApi(gymnasium.Wrapper):
    """An environment of the interface before gym 0.26."""

    def seed(self, seed):
        """Keep a seed for the next reset."""
        self._seed = seed

    def reset(self):
        """Return the first observation."""
        observation, _ = self.env.reset(seed=self.__dict__.pop("_seed", None))
        return observation

    def step(self, action):
        """Return observation, reward, done, info."""
        observation, reward, lost, over, info = self.env.step(action)
        info = {**info, "TimeLimit.truncated": over and not lost}
        return observation, reward, lost or over, info


class OldVector:
    """Environments one after the other; a list of ``info``, one for each."""

    def __init__(self, makers):
        self.envs = [make() for make in makers]
        self.num_envs = len(self.envs)
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        batch = gymnasium.vector.utils.batch_space
        self.action_space = batch(self.single_action_space, self.num_envs)
        self.observation_space = batch(self.single_observation_space, self.num_envs)

    def reset(self):
        """Return the first observations."""
        return np.stack([env.reset() for env in self.envs])

    def step(self, actions):
        """Step each; one that is done is reset at once."""
        seen, rewards, done, infos = zip(
            *(env.step(a) for env, a in zip(self.envs, actions, strict=True)), strict=True
        )
        seen = list(seen)
        for i, over in enumerate(done):
            if over:
                infos[i]["terminal_observation"] = seen[i]
                seen[i] = self.envs[i].reset()
        return np.stack(seen), np.array(rewards), np.array(done), list(infos)

    def close(self):
        """Close each."""
        for env in self.envs:
            env.close()


def make(name, **settings):
    """Return an environment of the old interface, with an episode's return in its last ``info``."""
    made = gymnasium.make(name, **settings)
    return OldApi(gymnasium.wrappers.RecordEpisodeStatistics(made))


def install():
    """Make this what ``import gym`` finds."""
    old, vector, wrappers = (types.ModuleType(n) for n in ("gym", "gym.vector", "gym.wrappers"))
    old.make, old.spaces, old.Wrapper = make, gymnasium.spaces, gymnasium.Wrapper
    vector.SyncVectorEnv = OldVector
    wrappers.RecordEpisodeStatistics = lambda env: env  # ``make`` did that
    old.vector, old.wrappers = vector, wrappers
    sys.modules.update({"gym": old, "gym.vector": vector, "gym.wrappers": wrappers})
