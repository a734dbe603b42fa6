"""Steps of each kind of environment, which compile what most tests of them need."""

import gymnasium as gym
import numpy as np

import windwrench  # noqa: F401  registers the environments


def compile_environments():
    """Step a single environment and a vector of them with each estimator; compiled code is kept,
    so that a second call takes no time.
    """
    for estimator in ("ukf", "constant-gain"):
        env = gym.make("windwrench/FanTracking-v0", estimator=estimator)
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape, dtype=np.float32))
        env.close()
        envs = gym.make_vec(
            "windwrench/FanTracking-v0",
            num_envs=9,
            vectorization_mode="vector_entry_point",
            estimator=estimator,
        )
        envs.reset(seed=0)
        envs.step(np.zeros(envs.action_space.shape, dtype=np.float32))
        envs.close()
