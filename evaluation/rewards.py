"""A user's rewards by name, as functions of ``info``.

Entries of ``info`` are numbers, or arrays with a row for each environment, so one function serves a
single environment and a vector.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from ..envs.definition import LOST_OFFSET
from ..runtime.errors import InputError, unknown_name
from ..runtime.python_file import is_file_name, named_in_file
from ..runtime.yaml_file import read_yaml
from .episodes import error_of

# from ``info`` to the reward: a number or an array, or named terms, which add up
Reward = Callable[[Mapping[str, Any]], Any]
_WHAT = "a Python file with a function of info that returns a reward, or a dictionary of its terms"


@dataclass(frozen=True)
class WeightedTerms:
    """A weighted sum of the terms ``reward_NAME`` of ``info``, and of two terms of the error.

    Errors count at most 2.5 m. ``error`` is 1 minus the error over 2.5 m: its return ranks
    controllers as their RMSE after 3 s does. ``squared`` is minus the squared error, m2.
    """

    weights: Mapping[str, float]

    def __call__(self, info: Mapping[str, Any]) -> dict[str, Any]:
        """Return the weighted terms by name."""
        return {name: weight * _term(name, info) for name, weight in self.weights.items()}


def _term(name: str, info: Mapping[str, Any]) -> Any:
    if f"reward_{name}" in info:
        return info[f"reward_{name}"]
    error = error_of(info)
    if name not in ("squared", "error") or error is None:
        terms = [key.removeprefix("reward_") for key in info if key.startswith("reward_")]
        raise unknown_name("term", name, [*terms, "squared", "error"], "reward")
    limited = np.minimum(error, LOST_OFFSET)
    return -(limited**2) if name == "squared" else 1.0 - limited / LOST_OFFSET


# rewards by name; a user's own file may add some: ``REWARDS["me/soft"] = soft``
REWARDS: dict[str, Reward] = {"error": WeightedTerms({"error": 1.0})}


def find_reward(name: str) -> Reward:
    """Return a reward by its name in ``REWARDS``, of ``FILE.py:NAME``, or of a YAML file with
    weights by term: ``tracking: 1.0``.

    Raises:
        InputError: no reward has this name, or a file holds none.
    """
    if is_file_name(name):
        reward: Reward = named_in_file(name, "reward", _WHAT, callable)
        return reward
    if name.endswith((".yaml", ".yml")):
        weights = read_yaml(Path(name), "a reward's file")
        if not isinstance(weights, dict) or not all(
            isinstance(weight, int | float) for weight in weights.values()
        ):
            raise InputError(f"{name}: expected weights by term, such as tracking: 1.0")
        return WeightedTerms(weights)
    if name not in REWARDS:
        raise unknown_name("reward", name, REWARDS)
    return REWARDS[name]


def total_of(reward: Reward, info: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Return a reward and its named terms, as entries ``reward_NAME`` of ``info``."""
    terms = reward(info)
    if not isinstance(terms, Mapping):
        return terms, {}
    return sum(terms.values()), {f"reward_{name}": term for name, term in terms.items()}


class OwnReward(gym.Wrapper[Any, Any, Any, Any]):
    """An environment with a user's reward; ``info`` has the terms."""

    def __init__(self, env: Any, reward: Reward) -> None:
        super().__init__(env)
        self._reward = reward

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Fly a decision with an action of ``action_space``."""
        observation, _, terminated, truncated, info = self.env.step(action)
        reward, terms = total_of(self._reward, info)
        return observation, float(reward), terminated, truncated, info | terms
