"""The two ends of the scale: a vehicle that does nothing, and one that sees the fan."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.errors import InputError
from .observation import MAX_COMMAND

Array = NDArray[np.floating[Any]]


class Hover:
    """Stays where it is: the lower bound, score 0."""

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (1,) m/s for an observation (8,)."""
        return np.zeros(1, dtype=np.float32)


class Oracle:
    """Sees the fan: moves with it and towards its axis. The upper bound, score 1.

    Args:
        gain: 1/s, from the true offset to velocity.
    """

    def __init__(self, gain: float = 2.0) -> None:
        self.gain = gain

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (1,) m/s; ``info`` is the environment's, with the fan in it.

        Raises:
            InputError: no ``info``.
        """
        if info is None:
            raise InputError(
                "oracle: needs the environment's info (fan_y, fan_velocity, y), which only a "
                "simulator has"
            )
        command = info["fan_velocity"] + self.gain * (info["fan_y"] - info["y"])
        return np.array([np.clip(command, -MAX_COMMAND, MAX_COMMAND)], dtype=np.float32)
