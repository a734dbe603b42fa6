"""A linear law of any task, fitted to the best commands in hindsight: a baseline.

Each quantity of the observation passes through first-order low-passes of several times; a command
is a weighted sum of all of them. No sum suits two levels of noise: fitted to
``hindsight.MIX``, the law has 2.7 times the error on WindTrajectory's base after 3 s (24 validation
episodes). The weights are a ridge regression (Hoerl and
Kennard, Technometrics 12(1), 1970) on all flights so far, in rounds as of ``task_policies``.
"""

from typing import Any

import numpy as np
import torch

from ..controllers.trained_policy import Weights
from ..runtime.arrays import Single
from .taught_network import Sequences

# decisions of the low-passes; 1: the newest observation itself
MEMORY = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 32.0)
RIDGE = 3e-3  # share of the quantities' variances


class LinearLaw:
    """The law as ``Flights`` flies it."""

    def __init__(self) -> None:
        self._rates: Single = (1.0 / np.array(MEMORY, dtype=np.float32))[:, None]

    def _remember(self, memory: Single | None, frames: Single) -> Single:
        """Return the low-passes (n, memory, quantities) after frames (n, quantities)."""
        if memory is None:
            return np.repeat(frames[:, None], len(MEMORY), axis=1)
        return memory + self._rates * (frames[:, None] - memory)

    def __call__(self, frames: torch.Tensor, state: Any = None) -> tuple[Any, None, Single]:
        """Return what is taught (1, n, taught), no deviations, and the state for frames (1, n,
        quantities).
        """
        state = self._remember(state, frames[0].numpy())
        output = state.reshape(len(state), -1) @ self._weight.T + self._bias
        return torch.from_numpy(output[None]), None, state

    def fit(self, flown: Sequences) -> None:
        """Fit the weights to all counting decisions."""
        memory = None
        all_kept = []
        for frames in flown.seen:
            memory = self._remember(memory, frames)
            all_kept.append(memory)
        some = flown.counts > 0.0
        seen = np.array(all_kept)[some].reshape(int(some.sum()), -1).astype(np.float64)
        mean = seen.mean(axis=0)
        deviation = seen.std(axis=0) + 1e-9
        seen = (seen - mean) / deviation
        wanted = flown.truth[some].astype(np.float64)
        middle = wanted.mean(axis=0)
        square = seen.T @ seen / len(seen) + RIDGE * np.eye(len(mean))
        weight = np.linalg.solve(square, seen.T @ (wanted - middle) / len(seen)).T / deviation
        self._weight = weight.astype(np.float32)
        self._bias = (middle - weight @ mean).astype(np.float32)

    def weights(self, shares: Single) -> Weights:
        """Return the weights of the policy that commands ``shares`` (axes, taught)."""
        return {"weight0": shares @ self._weight, "bias0": shares @ self._bias}
