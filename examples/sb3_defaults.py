"""What ``normalize=True`` is worth: stable-baselines3's SAC with its defaults, with it and without.

Install:  pip install '.[rl]'    (in a checkout)
Run:      python examples/sb3_defaults.py 3000 3    (decisions, seeds)
"""

import sys

import gymnasium as gym
import numpy as np
from stable_baselines3 import SAC
from stable_baselines3.common.monitor import Monitor

import windwrench  # noqa: F401  (registers the environment)

EPISODES = 10
FIRST = 900_000  # of validation


def score(steps, normalize, seed):
    """Return the mean return of ``EPISODES`` after ``steps`` decisions of training."""
    env = Monitor(gym.make("windwrench/FanTracking-v0", scenario="base", normalize=normalize))
    learner = SAC("MlpPolicy", env, seed=seed, device="cpu").learn(steps)
    returns = []
    for k in range(EPISODES):
        seen, _ = env.reset(seed=FIRST + k)
        total, over = 0.0, False
        while not over:
            action, _ = learner.predict(seen, deterministic=True)
            seen, reward, lost, late, _ = env.step(action)
            total, over = total + float(reward), lost or late
        returns.append(total)
    return float(np.mean(returns))


def main(steps=3000, seeds=3):
    """Print and return the scores of each seed, with and without."""
    found = {}
    for normalize in (True, False):
        found[normalize] = [score(steps, normalize, seed) for seed in range(seeds)]
        told = ", ".join(f"{x:.0f}" for x in found[normalize])
        print(f"normalize={normalize}: {np.mean(found[normalize]):.0f} ({told})", flush=True)
    return found


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
