"""Copies of an environment in the middle of an episode, made by flying the episode again.

An episode is its seed and its actions: the same ones give the same flight, bit for bit. So a copy
needs no state of the simulator, of the filter or of a compiled loop: it is a new environment to
which the same was done. That costs as much time as the episode took so far, and it holds for every
environment of this kit.
"""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from ..runtime.errors import InputError


class Copyable(gym.Wrapper[Any, Any, Any, Any]):
    """An environment that can be copied at any time: for planning, tree search and "what if".

    ```python
    env = Copyable(lambda: gym.make("windwrench/FanTracking-v0", scenario="gusty"))
    env.reset(seed=3)
    env.step([0.1])
    other = env.copy()          # the same state; what is done to one leaves the other alone
    ```

    ``copy.deepcopy(env)`` does the same. An episode that begins without a seed is given one, drawn
    from the last seed that was given, so that it can be flown again; it is not the episode that the
    bare environment would draw.

    Args:
        make: makes the environment; each call must give a new one with the same arguments.

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
        super().__init__(env)
        self.make = make
        self._seeds: np.random.Generator | None = None
        self._episode: tuple[int, dict[str, Any] | None] | None = None  # seed, options
        self._actions: list[Any] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode; without a seed it is given one."""
        if seed is not None or self._seeds is None:
            self._seeds = np.random.default_rng(seed)
        used = int(self._seeds.integers(2**31)) if seed is None else seed
        found = self.env.reset(seed=used, options=options)
        self._episode, self._actions = (used, options), []
        return found

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Do a step, and remember its action."""
        found = self.env.step(action)
        self._actions.append(np.array(action))
        return found

    def copy(self) -> "Copyable":
        """Return a new environment at the same state of the same episode.

        Before the first ``reset`` it is a new environment. Later episodes of both are the same too.
        """
        other = Copyable(self.make)
        if self._episode is not None:
            seed, options = self._episode
            other.env.reset(seed=seed, options=options)
            for action in self._actions:
                other.env.step(action)
            other._episode, other._actions = self._episode, list(self._actions)
        if self._seeds is not None:
            other._seeds = np.random.default_rng()
            other._seeds.bit_generator.state = self._seeds.bit_generator.state
        return other

    def __deepcopy__(self, memory: dict[int, Any]) -> "Copyable":
        return self.copy()
