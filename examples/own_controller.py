"""Your own controller in the plain Gymnasium loop, beside hovering and the paper's law.

``Lead`` commands a velocity against the estimated yaw torque and against the torque's rate,
smoothed over 0.2 s. The rate brakes the vehicle before the fan's axis.

Install:  pip install .    (in a checkout)
Run:      python examples/own_controller.py
"""

import gymnasium as gym
import numpy as np

import windwrench  # noqa: F401  (registers the environment)
from windwrench.controllers import make_controller

DECISION = 0.08  # s
DECISIONS = 250  # of an episode
LOST = 2.5  # m, at which the remaining time of a lost vehicle counts


class Lead:
    """Velocity against the yaw torque (``gain``, m/s per Nm) and its rate (``rate_gain``, m per
    Nm).
    """

    def __init__(self, gain=18.0, rate_gain=2.0, smoothing=0.2):
        self.gain, self.rate_gain, self.smoothing = gain, rate_gain, smoothing
        self.reset()

    def reset(self):
        """Forget the last episode."""
        self.last, self.rate = None, 0.0

    def __call__(self, observation, info=None):
        """Return the velocity (1,) m/s along world y for an observation (8,)."""
        # Nm, world: positive if the vehicle is on the fan's left
        torque_z = float(observation[5])
        change = 0.0 if self.last is None else (torque_z - self.last) / DECISION
        self.rate += DECISION / self.smoothing * (change - self.rate)
        self.last = torque_z
        return np.clip([-self.gain * torque_z - self.rate_gain * self.rate], -1.0, 1.0).astype(
            np.float32
        )


def rmse(env, controller, seed):
    """Return the root-mean-square offset from the fan's axis over one episode, m."""
    controller.reset()
    observation, info = env.reset(seed=seed)
    offsets, terminated, truncated = [], False, False
    while not (terminated or truncated):
        observation, _, terminated, truncated, info = env.step(controller(observation, info))
        offsets.append(info["offset"])
    rest = [LOST] * (DECISIONS - len(offsets))
    return float(np.sqrt(np.mean(np.square([*offsets, *rest]))))


def main(episodes=20, scenario="base"):
    """Fly all on the same episodes; print and return their mean RMSE in m."""
    env = gym.make("windwrench/FanTracking-v1", scenario=scenario, normalize=False)
    laws = {
        "hover": make_controller("hover"),
        "admittance": make_controller("admittance"),
        "own": Lead(),
    }
    errors = {
        name: float(np.mean([rmse(env, law, seed) for seed in range(episodes)]))
        for name, law in laws.items()
    }
    env.close()
    for name, value in errors.items():
        print(f"{name:10s} {value:.3f} m off the axis (RMSE, mean of {episodes} episodes)")
    return errors


if __name__ == "__main__":
    main()
