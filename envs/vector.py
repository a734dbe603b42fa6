"""Many fan-tracking environments in one process."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

from ..dynamics.errors import InputError
from .fan_tracking import FanTrackingEnv

Frames = NDArray[np.float32]


class FanTrackingVectorEnv(SyncVectorEnv):
    """``num_envs`` environments side by side, each bit for bit the single one with its seed.

    ``reset(seed=s)`` seeds them with s, s + 1, ...; a list gives each its own. An environment whose episode has ended
    starts its next one at the following step, whose action it ignores (``AutoresetMode.NEXT_STEP``).

    Args:
        num_envs: how many.
        max_episode_steps: decisions after which an episode is truncated.
        **kwargs: of ``FanTrackingEnv``.

    Raises:
        InputError: ``num_envs`` is not positive, or what ``FanTrackingEnv`` refuses.
    """

    def __init__(self, num_envs: int = 1, max_episode_steps: int = 250, **kwargs: Any) -> None:
        if num_envs < 1:
            raise InputError(f"FanTracking: num_envs must be at least 1, got {num_envs}")

        def make() -> gym.Env[Frames, Frames]:
            return TimeLimit(FanTrackingEnv(**kwargs), max_episode_steps)

        super().__init__([make] * num_envs, autoreset_mode=AutoresetMode.NEXT_STEP)
