"""Imitation with a memory: a recurrent network learns where the fan is from a simulator that knows.

In every round of DAgger (Ross, Gordon and Bagnell, 2011) the newest network flies. It sees what any
policy may see; the simulator says, of every decision, how far the fan's axis was and how fast it
moved next (privileged supervision, as of Chen and others, *Learning by cheating*, 2020), and the
network is fitted to whole episodes of that. What it says then is close to the mean of the posterior
under the motions that it was trained on. The command is what a tracker makes of such a mean: the
fan's velocity, a gain on the offset and a damping of the difference of velocities. All of it is
linear in what the network says, so it is folded into the last layer, and what flies is a GRU with
one output. Gain and damping are chosen on the validation episodes.
"""

import itertools
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.features import History
from ..controllers.observation import DECISION_PERIOD, MAX_COMMAND, VELOCITY_Y
from ..controllers.trained_policy import TrainedPolicy
from ..envs.vector import FanTrackingVectorEnv
from ..evaluation.episodes import DECISIONS
from .belief_network import BeliefNetwork, Sequences, fit
from .configuration import Config, features_of
from .seeds import training_seed, validation_seeds
from .train import Progress, card_of, claim, read_progress, take_stock, validate, write_json
from .training_envs import check_training_env, make_training_env, scenarios_of

Array = NDArray[np.float64]

# the oracle that flies the first round, and gives commands to learn: 1/s
_ORACLE_GAIN = 2.0
_LEAST_RATE = 0.1  # share of the learning rate that is left at the end of a round
_CALM = 0.5  # share of the episodes, after the first round, in which nothing leads off the axis


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
    check_training_env(scenario)
    features = features_of(config)
    claim(folder, config, scenario, seed)
    done = read_progress(folder)
    if done is not None and done.steps and done.steps[-1] >= config["steps"]:
        return folder / "best.npz"
    began, progress = time.perf_counter(), Progress()
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    order, rng = torch.Generator().manual_seed(seed), np.random.default_rng(seed)
    taught = 1 if config["says"] == "command" else 3
    network = BeliefNetwork(
        features.size, taught, config["gru"], config["net"], config["activation"]
    )
    judge = make_training_env(scenario, sources=features.sources)
    seeds = validation_seeds(config["validation"]["episodes"])
    pairs = list(itertools.product(config["gains"], config["dampings"]))
    shares = _shares(config, *pairs[len(pairs) // 2])
    flights = _Flights(config, scenario, seed, rng)
    flown, validated = 0, 0
    for number in range(config["rounds"]):
        flights.fly(None if number == 0 else network, shares, advance)
        last = number == config["rounds"] - 1
        rate = config["learning_rate"]
        fit(
            network,
            flights.sequences(),
            config["last_epochs" if last else "epochs"],
            config["batch_size"],
            (rate, 0.0 if last else _LEAST_RATE * rate),
            order,
        )
        flown = flights.decisions
        if not last and flown // config["validation"]["every"] == validated:
            continue
        validated = flown // config["validation"]["every"]
        card = card_of(config, scenario, seed, flown, squash=False)
        if last and taught > 1:
            tried = {
                pair: validate(
                    TrainedPolicy(card, network.policy_weights(_shares(config, *pair))),
                    judge,
                    seeds,
                )[0]
                for pair in pairs
            }
            card["gain"], card["damping"] = best = min(tried, key=lambda pair: tried[pair])
            shares = _shares(config, *best)
        policy = TrainedPolicy(card, network.policy_weights(shares))
        take_stock(policy, card, progress, judge, seeds, folder)
        progress.seconds = time.perf_counter() - began
        write_json(asdict(progress), folder / "progress.json")
        report(progress)
    return folder / "best.npz"


def _shares(config: Config, gain: float, damping: float) -> NDArray[np.float32]:
    """Return what is commanded of each quantity that is taught: offset, the fan's velocity, and
    its difference to the own; or the command itself.
    """
    shares = [1.0] if config["says"] == "command" else [gain, 1.0, damping]
    return np.array(shares, dtype=np.float32)


class _Flights:
    """Training flights, in the vector environment of each scenario of a tier, and what came of
    them.
    """

    def __init__(
        self, config: Config, scenario: str, seed: int, rng: np.random.Generator
    ) -> None:
        self._config, self._seed, self._rng = config, seed, rng
        self._features = features_of(config)
        scenarios = scenarios_of(scenario)
        episodes = -(-config["steps"] // (config["rounds"] * DECISIONS))
        each = -(-episodes // len(scenarios))
        self._envs = [
            FanTrackingVectorEnv(
                each * scenarios.count(name),
                DECISIONS,
                scenario=name,
                estimator=config["estimator"],
            )
            for name in dict.fromkeys(scenarios)
        ]
        self._flown: list[Sequences] = []
        self._episodes = 0

    @property
    def decisions(self) -> int:
        """How many were flown."""
        return self._episodes * DECISIONS

    def sequences(self) -> Sequences:
        """Return all that were flown."""
        return Sequences(
            *(
                np.concatenate([getattr(one, name) for one in self._flown], axis=1)
                for name in ("seen", "truth", "counts")
            )
        )

    def fly(
        self,
        network: BeliefNetwork | None,
        shares: NDArray[np.float32],
        advance: Callable[[int], None],
    ) -> None:
        """Fly a round, with the oracle where there is no network."""
        for env in self._envs:
            n = env.num_envs
            size = self._config["wander"]["size"] * self._rng.random(n)
            if network is not None:
                size *= self._rng.random(n) >= _CALM
            self._flown.append(self._fly(env, network, shares, size, advance))
            self._episodes += n

    def _fly(
        self,
        env: FanTrackingVectorEnv,
        network: BeliefNetwork | None,
        shares: NDArray[np.float32],
        size: Array,
        advance: Callable[[int], None],
    ) -> Sequences:
        config, features, n = self._config, self._features, env.num_envs
        history, state = History(features, n), None
        keep = np.exp(-DECISION_PERIOD / config["wander"]["time"])
        off, flying = size * self._rng.standard_normal(n), np.ones(n, dtype=np.bool_)
        seen = np.zeros((DECISIONS, n, features.size), dtype=np.float32)
        fan, own, speed = (np.zeros((DECISIONS + 1, n)) for _ in range(3))
        kept = np.zeros((DECISIONS + 1, n), dtype=np.bool_)
        oracle = np.zeros((DECISIONS, n))
        first = self._episodes
        observation, infos = env.reset(
            seed=[training_seed(self._seed, 0, first + i) for i in range(n)]
        )
        for k in range(DECISIONS + 1):
            fan[k], own[k], speed[k] = infos["fan_y"], infos["y"], observation[:, VELOCITY_Y]
            kept[k] = flying
            if k == DECISIONS:
                break
            frames = features.frames(observation, infos)
            if k == 0:
                history.restart(frames, list(range(n)))
            else:
                history.push(frames)
            seen[k] = history.flat()
            oracle[k] = infos["fan_velocity"] + _ORACLE_GAIN * (fan[k] - own[k])
            if network is None:
                command = oracle[k]
            else:
                with torch.no_grad():
                    said, _, state = network(torch.from_numpy(seen[k])[None], state)
                command = said[0].numpy() @ shares
            off = keep * off + np.sqrt(1.0 - keep**2) * size * self._rng.standard_normal(n)
            given = np.clip(command + off, -MAX_COMMAND, MAX_COMMAND).astype(np.float32)
            observation, _, lost, _, infos = env.step(given[:, None])
            flying &= ~lost
            advance(first * DECISIONS + (k + 1) * n)
        ahead = np.minimum(np.arange(DECISIONS) + config["ahead"], DECISIONS)
        # one that was lost begins anew elsewhere: what was to come is not known before that
        counts = kept[ahead].astype(np.float32)
        if config["says"] == "command":
            truth = np.clip(oracle, -MAX_COMMAND, MAX_COMMAND)[..., None]
        else:
            seconds = DECISION_PERIOD * (ahead - np.arange(DECISIONS))
            velocity = (fan[ahead] - fan[:-1]) / seconds[:, None]
            truth = np.stack([(fan - own)[:-1], velocity, velocity - speed[:-1]], axis=-1)
        return Sequences(seen, truth.astype(np.float32), counts)


__all__ = ["recurrent_imitation"]
