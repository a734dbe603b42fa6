"""Environments of the tasks, one or many, and what their flights return."""

import gymnasium as gym
import numpy as np
from numpy.random import default_rng

import windwrench  # noqa: F401  registers the environment

TASKS = ("FanTracking", "FanTracking2D", "WindHover", "WindTrajectory")
NUMBERS = (
    *("reward_tracking", "reward_change", "fan_y", "fan_velocity", "y", "offset"),
    *("force", "torque", "time", "lost"),
)


def make(num_envs, plant="mujoco", task="FanTracking", **kwargs):
    return gym.make_vec(
        f"windwrench/{task}-v1",
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        **{"plant": plant, "normalize": False, **kwargs},
    )


def make_single(task="FanTracking", **kwargs):
    return gym.make(f"windwrench/{task}-v1", **{"normalize": False, **kwargs})


def fly(envs, decisions, seed=3):
    """Everything that the first decisions return, as one array (decisions, n, .), frames first. The
    random actions of one environment do not depend on how many there are.
    """
    rng = default_rng(seed)
    rows = []
    envs.reset(seed=seed)
    for _ in range(decisions):
        drawn = rng.uniform(-1, 1, (100, *envs.action_space.shape[1:])).astype(np.float32)
        seen, rewards, lost, over, infos = envs.step(drawn[: envs.num_envs])
        numbers = [infos[name].reshape(envs.num_envs, -1) for name in NUMBERS if name in infos]
        rows.append(np.column_stack([seen, rewards, lost, over, *numbers]))
    envs.close()
    return np.array(rows)


def fly_alone(env, decisions=4, seed=None):
    """Frame, reward, true position, force and torque (decisions, .) of random commands, after a
    reset where there is a seed.
    """
    rng = default_rng(1)
    rows = []
    if seed is not None:
        env.reset(seed=seed)
    for _ in range(decisions):
        action = rng.uniform(-0.5, 0.5, env.action_space.shape).astype(np.float32)
        frame, reward, _, _, info = env.step(action)
        place = env.unwrapped.loop.position
        rows.append(np.concatenate([frame, [reward], place, info["force"], info["torque"]]))
    return np.array(rows)
