"""Copies of an environment in the middle of an episode, by the wrapper of version 1.0."""

import copy
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym

from ..runtime.errors import InputError


class Copyable(gym.Wrapper[Any, Any, Any, Any]):
    """An environment with a method ``copy``. Deprecated: ``copy.deepcopy(env)`` and ``pickle`` copy
    every environment of this kit at its state.

    Args:
        make: makes the environment.

    Raises:
        InputError: ``make`` cannot be called, or returns no environment.
    """

    def __init__(self, make: Callable[[], gym.Env[Any, Any]]) -> None:
        env = make() if callable(make) else None
        if not isinstance(env, gym.Env):
            raise InputError(
                "Copyable: expected a function that makes an environment, such as "
                "lambda: gym.make(...)"
            )
        warnings.warn(
            "Copyable is deprecated; call copy.deepcopy(env)", DeprecationWarning, stacklevel=2
        )
        super().__init__(env)

    def copy(self) -> "Copyable":
        """Return an environment at the same state of the same episode."""
        return copy.deepcopy(self)
