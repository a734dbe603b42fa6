"""Training flights of the vector environment as sequences, with what the simulator knows of the
fan.
"""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.features import History
from ..controllers.observation import DECISION_PERIOD, MAX_COMMAND, VELOCITY_Y
from ..envs.vector import FanTrackingVectorEnv
from ..evaluation.episodes import DECISIONS
from .belief_network import BeliefNetwork, Sequences
from .configuration import Config, features_of
from .seeds import training_seed
from .training_envs import scenarios_of

Array = NDArray[np.float64]

_ORACLE_GAIN = 2.0  # 1/s, of the oracle, which flies the first round and whose commands are taught
_CALM = 0.5  # share of the episodes, after the first round, in which nothing leads off the axis


class Flights:
    """Training flights, in the vector environment of each scenario of a tier, and what came of
    them.
    """

    def __init__(self, config: Config, scenario: str, seed: int, rng: np.random.Generator) -> None:
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

    @property
    def decisions_a_round(self) -> int:
        """How many a round has."""
        return sum(env.num_envs for env in self._envs) * DECISIONS

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
