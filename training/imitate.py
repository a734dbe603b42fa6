"""Imitation of the oracle (DAgger): how far what a policy may see can take it.

In every round the newest policy flies, the oracle says what it would have commanded in each place,
and a network is fitted to all that was said so far. What remains of the error then is what the
observation does not hold, or the network cannot.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.fan_laws import Oracle
from ..controllers.features import History
from ..controllers.trained_policy import TrainedPolicy
from ..evaluation.episodes import DECISIONS
from .configuration import Config, features_of
from .learners import dense_layers, dense_weights
from .run import Progress, Run
from .seeds import training_seed
from .training_envs import make_training_env

Array = NDArray[np.float32]


def imitate(
    config: Config,
    scenario: str,
    seed: int,
    folder: Path,
    advance: Callable[[int], None] = lambda steps: None,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Path:
    """Learn the oracle's commands; return the path of the best policy on the validation episodes.

    The files are those of ``train``, without a checkpoint: a run that was killed starts anew.

    Raises:
        InputError: as ``train``.
    """
    run = Run(config, scenario, seed, folder, report)
    if run.is_finished():
        return run.best
    features = features_of(config)
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    env = make_training_env(scenario, config["estimator"], features.sources)
    network = dense_layers([features.size, *config["net"], 1], config["activation"])
    inputs: list[Array] = []
    labels: list[Array] = []
    flown, oracle, pilot = 0, Oracle(config["gain"]), None
    per_round = -(-config["steps"] // config["rounds"])
    while flown < config["steps"]:
        until = min(flown + per_round, config["steps"])
        while flown < until:
            seen, said = _fly(env, pilot, oracle, config, training_seed(seed, 0, len(inputs)))
            inputs.append(seen)
            labels.append(said)
            flown += len(said)
            advance(flown)
        _fit(network, np.concatenate(inputs), np.concatenate(labels), config, seed + flown)
        pilot = TrainedPolicy(run.card(flown), dense_weights(network))
        if run.is_due(flown, flown >= config["steps"]):
            run.take_stock(pilot)
    return run.best


def _fly(
    env: Any, pilot: TrainedPolicy | None, oracle: Oracle, config: Config, seed: int
) -> tuple[Array, Array]:
    """Fly one episode (the oracle where there is no pilot); return what a policy saw (n, size) and
    was told (n,).
    """
    features = features_of(config)
    history = History(features, 1)
    observation, info = env.reset(seed=seed)
    if pilot is not None:
        pilot.reset()
    seen, said = [], []
    command = np.zeros(1, dtype=np.float32)
    for k in range(DECISIONS):
        best = np.asarray(oracle(observation, info), dtype=np.float32)
        if k % config["repeat"] == 0:
            frames = features.frames(
                observation[None], {s: np.asarray(info[s])[None] for s in features.sources}
            )
            if k == 0:
                history.restart(frames, [0])
            else:
                history.push(frames)
            seen.append(history.flat()[0])
            said.append(float(best[0]))
            command = best
        if pilot is not None:
            command = pilot(observation, info)
        observation, _, lost, _, info = env.step(command)
        if lost:
            break
    return np.array(seen, dtype=np.float32), np.array(said, dtype=np.float32)


def _fit(
    network: torch.nn.Sequential, inputs: Array, labels: Array, config: Config, seed: int
) -> None:
    """Fit the network to commands, by least squares with a learning rate that falls to zero."""
    generator = torch.Generator().manual_seed(seed)
    x, y = torch.from_numpy(inputs), torch.from_numpy(labels)[:, None]
    size = config["batch_size"]
    updates = config["epochs"] * -(-len(x) // size)
    optimiser = torch.optim.Adam(network.parameters(), lr=config["learning_rate"], fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, updates)
    for _ in range(config["epochs"]):
        for batch in torch.randperm(len(x), generator=generator).split(size):  # type: ignore[no-untyped-call]
            loss = torch.mean((torch.tanh(network(x[batch])) - y[batch]) ** 2)
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            schedule.step()
