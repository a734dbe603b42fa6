"""Imitation of a teacher with knowledge (DAgger): a network learns a teacher's command, or where
the fan is.

In every round of DAgger (Ross, Gordon and Bagnell, 2011) the newest network flies. It has the
inputs of any policy. For every decision the simulator gives the teacher's command, or the fan axis'
offset and next velocity (privileged supervision, as of Chen and others, *Learning by cheating*,
2020). The network is fitted to all answers so far. With a recurrent cell the fit is over whole
episodes, and the output comes close to the posterior mean under the trained motions. The command is
a tracker's for such a mean: the fan's velocity, a gain on the offset and a damping of the
difference of velocities. All this is linear in the network's output, so it is folded into the last
layer. Gain and damping are chosen on the validation episodes.
"""

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.trained_policy import TrainedPolicy
from ..evaluation.episodes import DECISIONS
from .belief_network import BeliefNetwork, fit
from .configuration import Config, features_of
from .flown_sequences import Flights, fan_flights
from .run import Run

Array = NDArray[np.float32]

_LEAST_RATE = 0.1  # share of the learning rate that is left at the end of a round


def rounds(
    network: BeliefNetwork,
    flights: Flights,
    shares: Array,
    config: Config,
    seed: int,
    mirrored: Array | None,
    whitened: bool = False,
) -> Iterator[bool]:
    """Fly and fit round after round; yield after each whether the round was the last.

    Args:
        network: to teach.
        flights: to fly.
        shares: (axes, taught) of the network's means that are commanded.
        config: ``rounds``, ``epochs``, ``last_epochs``, ``batch_size`` and ``learning_rate``.
        seed: of the order of the episodes.
        mirrored: as of ``belief_network.fit``.
        whitened: whether the network sees frames as ``BeliefNetwork.whiten`` has them, by the
            first round.
    """
    order, rate = torch.Generator().manual_seed(seed), config["learning_rate"]
    for number in range(config["rounds"]):
        flights.fly(None if number == 0 else network, shares)
        last = number == config["rounds"] - 1
        flown = flights.sequences()
        if whitened and number == 0:
            network.whiten(flown.seen)
        fit(
            network,
            flown if network.cell else flown.single_decisions(),
            config["last_epochs" if last else "epochs"],
            config["batch_size"],
            (rate, 0.0 if last else _LEAST_RATE * rate),
            order,
            mirrored,
        )
        yield last


def imitate(run: Run, advance: Callable[[int], None]) -> Path:
    """Teach the policy of a run; return the path of the best one on the validation episodes.

    Args:
        run: of ``imitation`` or ``recurrent-imitation``; there is no checkpoint, a run that was
            killed starts anew.
        advance: called with the number of decisions flown so far.

    Raises:
        InputError: as ``fan_flights``.
    """
    if run.is_finished():
        return run.best
    config, seed, features = run.config, run.seed, features_of(run.config)
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    taught = 1 if config["says"] == "command" else 3
    network = BeliefNetwork(
        features.size, taught, *(config[key] for key in ("cell", "state", "net", "activation"))
    )
    pairs = list(itertools.product(config["gains"], config["dampings"]))
    shares = _shares(config, *pairs[len(pairs) // 2])
    flights = fan_flights(config, run.scenario, seed, advance)
    for last in rounds(network, flights, shares, config, seed, features.mirrored):
        flown = flights.episodes * DECISIONS
        if not run.is_due(flown, last):
            continue
        card = run.card(flown)
        if last and taught > 1:
            card["gain"], card["damping"] = best = _best_pair(run, network, card, pairs)
            shares = _shares(config, *best)
        run.take_stock(TrainedPolicy(card, network.policy_weights(shares)))
    return run.best


def _shares(config: Config, gain: float, damping: float) -> Array:
    """Return what is commanded (1, taught) of each quantity that is taught: offset, the fan's
    velocity, and its difference to the own; or the command itself.
    """
    shares = [1.0] if config["says"] == "command" else [gain, 1.0, damping]
    return np.array([shares], dtype=np.float32)


def _best_pair(
    run: Run, network: BeliefNetwork, card: dict[str, Any], pairs: list[tuple[float, float]]
) -> tuple[float, float]:
    """Return gain and damping with the smallest mean RMSE on the validation episodes."""

    def rmse(pair: tuple[float, float]) -> float:
        weights = network.policy_weights(_shares(run.config, *pair))
        return run.validate(TrainedPolicy(card, weights))[0]

    return min(pairs, key=rmse)
