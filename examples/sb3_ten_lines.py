"""Train stable-baselines3's SAC straight on the Gymnasium environment: ten lines for training and
scoring.

3000 decisions take a minute or two on one core. That is enough to stay with the fans of ``base``
(some 204 of 250 reward, where hover has 100 to 115), close to the law of the paper (some 210) but
not beyond it: docs/learning.md says what it takes.

Install:  pip install '.[rl]'    (in a checkout)
Run:      python examples/sb3_ten_lines.py
"""

import gymnasium as gym
import numpy as np
from stable_baselines3 import SAC
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

import windwrench  # noqa: F401  (registers the environment)


class Hover:
    """What ``evaluate_policy`` asks of a policy, for a vehicle that stays where it is."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        """Return actions (n, 1) for observations (n, 8)."""
        return np.zeros((len(observation), 1), dtype=np.float32), state


def main(steps=3000, episodes=20, seed=0):
    """Train for ``steps`` decisions; print and return the mean reward of an episode, learned and
    hovering.
    """
    env = Monitor(gym.make("windwrench/FanTracking-v1", scenario="base"))
    learner = SAC("MlpPolicy", env, learning_starts=min(100, steps // 2), seed=seed)
    learner.learn(steps)
    found = {}
    for name, policy in (("learned", learner), ("hover", Hover())):
        env.reset(seed=1_000_000)
        found[name], spread = evaluate_policy(policy, env, episodes)
        print(
            f"{name:8s} {found[name]:6.1f} of at most 250 reward an episode (+- {spread:.1f} over "
            f"{episodes} episodes)"
        )
    return found


if __name__ == "__main__":
    main()
