"""Imitation with a memory: a recurrent network learns where the fan is from a simulator that knows.

In every round of DAgger (Ross, Gordon and Bagnell, 2011) the newest network flies. It sees what any
policy may see; the simulator says, of every decision, how far the fan's axis was and how fast it
moved next (privileged supervision, as of Chen and others, *Learning by cheating*, 2020), and the
network is fitted to whole episodes of that. What it says then is close to the mean of the posterior
under the motions that it was trained on. The command is what a tracker makes of such a mean: the
fan's velocity, a gain on the offset and a damping of the difference of velocities. All of it is
linear in what the network says, so it is folded into the last layer, and what flies is a recurrent
cell with one output. Gain and damping are chosen on the validation episodes.
"""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.trained_policy import TrainedPolicy
from .belief_network import BeliefNetwork, fit
from .configuration import Config, features_of
from .flown_sequences import Flights
from .run import Progress, Run

_LEAST_RATE = 0.1  # share of the learning rate that is left at the end of a round


def recurrent_imitation(
    config: Config,
    scenario: str,
    seed: int,
    folder: Path,
    advance: Callable[[int], None] = lambda steps: None,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Path:
    """Learn what the simulator knows; return the path of the best policy on the validation
    episodes.

    The files are those of ``train``, without a checkpoint: a run that was killed starts anew.

    Raises:
        InputError: as ``train``.
    """
    run = Run(config, scenario, seed, folder, report)
    if run.is_finished():
        return run.best
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    order, rng = torch.Generator().manual_seed(seed), np.random.default_rng(seed)
    features, taught = features_of(config), 1 if config["says"] == "command" else 3
    network = BeliefNetwork(
        features.size,
        taught,
        config["cell"],
        config["state"],
        config["net"],
        config["activation"],
    )
    pairs = list(itertools.product(config["gains"], config["dampings"]))
    shares = _shares(config, *pairs[len(pairs) // 2])
    flights = Flights(config, scenario, seed, rng)
    rate = config["learning_rate"]
    for number in range(config["rounds"]):
        flying, fitting = _halves(advance, flights.decisions, flights.decisions_a_round)
        flights.fly(None if number == 0 else network, shares, flying)
        last = number == config["rounds"] - 1
        fit(
            network,
            flights.sequences(),
            config["last_epochs" if last else "epochs"],
            config["batch_size"],
            (rate, 0.0 if last else _LEAST_RATE * rate),
            order,
            features.mirrored,
            fitting,
        )
        if not run.is_due(flights.decisions, last):
            continue
        card = run.card(flights.decisions)
        if last and taught > 1:
            card["gain"], card["damping"] = best = _best_pair(run, network, card, pairs)
            shares = _shares(config, *best)
        run.take_stock(TrainedPolicy(card, network.policy_weights(shares)))
    return run.best


def _halves(
    advance: Callable[[int], None], start: int, count: int
) -> tuple[Callable[[int], None], Callable[[float], None]]:
    """Return what tells ``advance`` of a round from decision ``start`` on: of the decisions flown
    so far, which are its first half, and of the share of the fit that is done.
    """
    return (
        lambda flown: advance(start + (flown - start) // 2),
        lambda share: advance(start + round(count * (1.0 + share) / 2.0)),
    )


def _shares(config: Config, gain: float, damping: float) -> NDArray[np.float32]:
    """Return what is commanded of each quantity that is taught: offset, the fan's velocity, and
    its difference to the own; or the command itself.
    """
    shares = [1.0] if config["says"] == "command" else [gain, 1.0, damping]
    return np.array(shares, dtype=np.float32)


def _best_pair(
    run: Run,
    network: BeliefNetwork,
    card: dict[str, Any],
    pairs: list[tuple[float, float]],
) -> tuple[float, float]:
    """Return gain and damping with the smallest mean RMSE on the validation episodes."""

    def rmse(pair: tuple[float, float]) -> float:
        weights = network.policy_weights(_shares(run.config, *pair))
        return run.validate(TrainedPolicy(card, weights))[0]

    return min(pairs, key=rmse)
