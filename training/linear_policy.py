"""A linear law of a task in the wind, fitted to the best commands in hindsight: a baseline.

Each quantity of the observation passes through first-order low-passes of several times; an axis'
command is a weighted sum of its own quantities. No sum suits two levels of noise: taught in
``hindsight.MIX`` the law has 2.7 times the error on WindTrajectory's base after 3 s (24 validation
episodes). The weights are a ridge regression (Hoerl and
Kennard, Technometrics 12(1), 1970) on all flights so far, in rounds as of ``task_policies``.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.trained_policy import Weights
from .taught_network import Sequences

Array = NDArray[np.float32]

# decisions of the low-passes; 1: the newest observation itself
MEMORY = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 32.0)
RIDGE = 3e-3  # of the quantities' variances
# columns of each axis' quantities in an observation: position error, velocity, velocity and
# acceleration of the reference, force, tilting torque, specific forces, last action
_AXES = (
    (0, 3, 6, 9, 12, 16, 18, 21, 24),
    (1, 4, 7, 10, 13, 15, 19, 22, 25),
    (2, 5, 8, 11, 14, 20, 23, 26),
)


class LinearLaw:
    """The law as ``Flights`` flies it."""

    def __init__(self) -> None:
        self._rates: Array = (1.0 / np.array(MEMORY, dtype=np.float32))[:, None]

    def _remember(self, kept: Array | None, frames: Array) -> Array:
        """Return the low-passes (n, memory, quantities) after frames (n, quantities)."""
        if kept is None:
            return np.repeat(frames[:, None], len(MEMORY), axis=1)
        return kept + self._rates * (frames[:, None] - kept)

    def __call__(self, frames: torch.Tensor, state: Any = None) -> tuple[Any, None, Array]:
        """Return commands (1, n, 3), no deviations, and the state for frames (1, n, quantities)."""
        state = self._remember(state, frames[0].numpy())
        said = state.reshape(len(state), -1) @ self._weight.T + self._bias
        return torch.from_numpy(said[None]), None, state

    def fit(self, flown: Sequences) -> None:
        """Fit the weights to all counting decisions."""
        kept, all_kept = None, []
        for frames in flown.seen:
            kept = self._remember(kept, frames)
            all_kept.append(kept)
        some, size = flown.counts > 0.0, flown.seen.shape[-1]
        inputs, wanted = np.array(all_kept)[some], flown.truth[some]
        weight = np.zeros((len(_AXES), len(MEMORY), size))
        bias = np.zeros(len(_AXES))
        for i, columns in enumerate(_AXES):
            seen = inputs[:, :, columns].reshape(len(inputs), -1).astype(np.float64)
            mean, deviation = seen.mean(axis=0), seen.std(axis=0) + 1e-9
            white = (seen - mean) / deviation
            best = wanted[:, i] - wanted[:, i].mean()
            square = white.T @ white / len(white) + RIDGE * np.eye(white.shape[1])
            found = np.linalg.solve(square, white.T @ best / len(white)) / deviation
            weight[i][:, columns] = found.reshape(len(MEMORY), -1)
            bias[i] = wanted[:, i].mean() - mean @ found
        self._weight = weight.reshape(len(_AXES), -1).astype(np.float32)
        self._bias = bias.astype(np.float32)

    def weights(self) -> Weights:
        """Return the weights of the policy."""
        return {"weight0": self._weight, "bias0": self._bias}
