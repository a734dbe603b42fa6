"""A recurrent network with taught quantities as its output, and its fit to episodes."""

from typing import Any, NamedTuple

import numpy as np
import torch

from ..controllers.trained_policy import Weights, layers_of
from ..runtime.arrays import Single
from .learners import cell_weights, dense_layers, dense_weights

CELLS: dict[str, Any] = {"lstm": torch.nn.LSTM, "gru": torch.nn.GRU}
_SURE = -4.0  # bounds of an output's logarithmic standard deviation
_UNSURE = 1.5
_MIRRORED = 0.5  # share of the episodes
_SMALLEST = 1.4e-3  # smallest relevant size of a scaled quantity
_STEEPEST = 1.0  # norm to which a gradient is cut


class Sequences(NamedTuple):
    """Whole episodes to learn from, time first."""

    seen: Single  # (decisions, episodes, quantities), frames
    truth: Single  # (decisions, episodes, quantities that are taught)
    counts: Single  # (decisions, episodes), 0 where the vehicle is lost or the truth unknown


class TaughtNetwork(torch.nn.Module):
    """A recurrent cell, dense layers, and for each taught quantity a mean and the logarithm
    of a standard deviation.

    Args:
        quantities: numbers in a frame.
        taught: quantities of the output.
        cell: ``gru`` or ``lstm``; torch fits an LSTM in half the time.
        state: size of the cell.
        net: sizes of the dense layers between.
        activation: the layers'.
    """

    def __init__(
        self, quantities: int, taught: int, cell: str, state: int, net: list[int], activation: str
    ) -> None:
        super().__init__()
        self.taught = taught
        self._name = cell
        self._white: tuple[torch.Tensor, torch.Tensor] | None = None
        self.cell = CELLS[cell](quantities, state)
        if cell == "lstm":  # starts with open forget gates, or long memory is never learned
            with torch.no_grad():
                self.cell.bias_ih_l0[state : 2 * state] = 1.0
        self.dense = dense_layers([state, *net, 2 * taught], activation)

    def forward(
        self, frames: torch.Tensor, state: Any = None
    ) -> tuple[torch.Tensor, torch.Tensor, Any]:
        """Return means and logarithmic deviations (decisions, episodes, taught) and the cell's
        state for frames (decisions, episodes, quantities).
        """
        if self._white is not None:
            turn, mean = self._white
            frames = (frames - mean) @ turn
        remembered, state = self.cell(frames, state)
        output = self.dense(remembered)
        deviations = output[..., self.taught :].clamp(_SURE, _UNSURE)
        return output[..., : self.taught], deviations, state

    def whiten(self, seen: Single) -> None:
        """Whiten the cell's input by the frames ``seen`` (decisions, episodes, quantities): a small
        difference of two quantities then counts as much as their sum. The policy has the whitening
        in the weights of its cell.
        """
        flat = seen.reshape(-1, seen.shape[-1]).astype(np.float64)
        sizes, axes = np.linalg.eigh(np.cov(flat.T))
        turn = (axes / np.sqrt(sizes + _SMALLEST**2)) @ axes.T
        self._white = (
            torch.from_numpy(np.float32(turn)),
            torch.from_numpy(np.float32(flat.mean(axis=0))),
        )

    def policy_weights(self, shares: Single) -> Weights:
        """Return the weights of the policy that commands ``shares`` (axes, taught) of the means."""
        weights = dense_weights(self.dense)
        last = layers_of(weights) - 1
        for name in (f"weight{last}", f"bias{last}"):
            weights[name] = shares @ weights[name][: self.taught]
        weights |= cell_weights(self._name, self.cell)
        if self._white is not None:
            turn, mean = (x.numpy() for x in self._white)
            seen = weights[f"{self._name}_input"] = weights[f"{self._name}_input"] @ turn
            weights[f"{self._name}_input_bias"] -= seen @ mean
        return weights


def fit(
    network: TaughtNetwork,
    episodes: Sequences,
    epochs: int,
    batch_size: int,
    rates: tuple[float, float],
    generator: torch.Generator,
    mirrored: Single | None = None,
) -> None:
    """Fit means and deviations to the taught quantities, over whole episodes.

    The loss is the likelihood of normal errors, each times the deviation of the output. Samples
    with a fan hard to locate count less. They count more than by the likelihood alone, which would
    give up hard episodes (beta-NLL with beta 0.5: Seitzer and others, *On the pitfalls of
    heteroscedastic uncertainty estimation with probabilistic neural networks*, 2022).

    Args:
        network: to fit.
        episodes: to fit it to.
        epochs: over all of them.
        batch_size: episodes.
        rates: learning rate at first and in the end; it falls as a cosine.
        generator: for the order, and the choice of mirrored episodes.
        mirrored: signs (quantities,) of a frame where left and right change places, and all taught
            quantities change their signs. At each use an episode is mirrored or not. Default: none
            is.
    """
    seen, truth, counts = (
        torch.from_numpy(x) for x in (episodes.seen, episodes.truth, episodes.counts)
    )
    count = seen.shape[1]
    flips = None if mirrored is None else torch.from_numpy(mirrored)
    updates = epochs * -(-count // batch_size)
    optimiser = torch.optim.Adam(network.parameters(), lr=rates[0], fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, updates, eta_min=rates[1])
    for _ in range(epochs):
        for batch in torch.randperm(count, generator=generator).split(batch_size):  # type: ignore[no-untyped-call]
            frames = seen[:, batch]
            taught = truth[:, batch]
            if flips is not None:
                some = torch.rand((len(batch), 1), generator=generator) < _MIRRORED
                frames = torch.where(some, frames * flips, frames)
                taught = torch.where(some, -taught, taught)
            mean, deviation, _ = network(frames)
            wrong = (mean - taught) * torch.exp(-deviation)
            each = (0.5 * wrong**2 + deviation) * torch.exp(deviation.detach())
            counted = counts[:, batch]
            loss = (each.sum(dim=-1) * counted).sum() / counted.sum()
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), _STEEPEST)
            optimiser.step()
            schedule.step()
