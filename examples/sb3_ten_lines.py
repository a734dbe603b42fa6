"""Train stable-baselines3's SAC on the Gymnasium environment, in ten lines.

3000 decisions take one or two minutes of one core. The policy then follows the fans of ``base`` (a
return of about 204 of 250; hover 100 to 115, the paper's law 210). Better policies:
docs/learning.md.

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
    """The policy of ``evaluate_policy`` that commands nothing."""

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
    rewards = {}
    for name, policy in (("learned", learner), ("hover", Hover())):
        env.reset(seed=1_000_000)
        rewards[name], spread = evaluate_policy(policy, env, episodes)
        print(
            f"{name:8s} {rewards[name]:6.1f} of at most 250 reward an episode "
            f"(+- {spread:.1f} over {episodes} episodes)"
        )
    return rewards


if __name__ == "__main__":
    main()
