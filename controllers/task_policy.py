"""Trained policies of the tasks beside ``FanTracking``: weights and a card, flown in NumPy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.errors import InputError
from .trained_policy import Weights, cell_of, dense, gru, layers_of, read_policy

Array = NDArray[np.floating[Any]]


class TaskPolicy:
    """A learned policy of a task: scaled observations, a GRU where there is one, dense layers.

    Args:
        card: ``task``; ``scale`` (n,), what each number of the observation is divided by;
            ``largest``, of the action; ``activation``; ``squash`` (the output goes through a tanh
            and is a share of ``largest``).
        weights: as those of a ``TrainedPolicy``.

    Raises:
        InputError: card and weights do not go together.
    """

    def __init__(self, card: Mapping[str, Any], weights: Weights, name: str = "policy") -> None:
        self.card, self.weights = dict(card), weights
        try:
            self.task = str(card["task"])
            self._scale = np.array(card["scale"], dtype=np.float32)
            self._largest = float(card["largest"])
            self._activation, self._squash = str(card["activation"]), bool(card["squash"])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{name}: the card lacks or spoils an entry: {error}") from error
        self._recurrent = cell_of(weights) == "gru"
        entry = weights.get("gru_input" if self._recurrent else "weight0")
        if entry is None or self._scale.ndim != 1 or entry.shape[1] != len(self._scale):
            raise InputError(f"{name}: the first layer must take as many numbers as scale has")
        if layers_of(weights) == 0:
            raise InputError(f"{name}: has no dense layer")
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        size = self.weights["gru_hidden"].shape[1] if self._recurrent else 0
        self._hidden = np.zeros(size, dtype=np.float32)

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the action of the task, in its units, for an observation in SI units."""
        x = (np.asarray(observation) / self._scale).astype(np.float32)
        if self._recurrent:
            x = self._hidden = gru(self.weights, x, self._hidden)
        out = dense(self.weights, self._activation, x)
        if self._squash:
            out = np.tanh(out) * np.float32(self._largest)
        return np.clip(out, -self._largest, self._largest).astype(np.float32)


def load_task_policy(path: str | Path) -> TaskPolicy:
    """Read a policy of a task from its ``.npz`` or its card.

    Raises:
        InputError: as ``load_policy``.
    """
    file, card, weights = read_policy(path)
    return TaskPolicy(card, weights, str(file))
