"""Training flights as sequences: a policy's inputs, and the simulator's truth of each decision."""

from typing import Any

import numpy as np
import torch

from ..runtime.arrays import Array, Single
from .linear_policy import LinearLaw
from .seeds import training_seed
from .taught_network import Sequences, TaughtNetwork

_CALM = 0.5  # share of the episodes, after the first round, in which nothing leads off the path


class Flights:
    """Training flights side by side, and their results.

    Args:
        envs: vector environments of each round; after a loss of its vehicle one goes on with
            another episode.
        lesson: inputs and taught quantities: a ``FanHindsight``, or an object with its constants
            and methods.
        wander: size of an error of the commands, as a share of the largest, and its duration, s.
        seed: the run's.
    """

    def __init__(
        self,
        envs: list[Any],
        lesson: Any,
        wander: tuple[float, float],
        seed: int,
    ) -> None:
        self._envs = envs
        self._lesson = lesson
        self._size = wander[0] * lesson.largest
        self._time = wander[1]
        self._seed = seed
        self._rng = np.random.default_rng(seed)
        self._flown: list[Sequences] = []
        self.episodes = 0

    def sequences(self) -> Sequences:
        """Return all flown sequences."""
        parts = zip(*self._flown, strict=True)
        return Sequences(*(np.concatenate(part, axis=1) for part in parts))

    def fly(self, network: TaughtNetwork | LinearLaw | None, shares: Single) -> None:
        """Fly a round at ``shares`` (axes, taught) of the network's means, or with the teacher
        where there is no network.
        """
        for env in self._envs:
            n = env.num_envs
            size = self._size * self._rng.random(n)
            if network is not None:
                size *= self._rng.random(n) >= _CALM
            self._flown.append(self._fly(env, network, shares, size[:, None]))
            self.episodes += n

    def _fly(
        self, env: Any, network: TaughtNetwork | LinearLaw | None, shares: Single, size: Array
    ) -> Sequences:
        lesson = self._lesson
        n = env.num_envs
        state = None
        shape = n, env.single_action_space.shape[0]
        keep = np.exp(-lesson.period / self._time)
        off = size * self._rng.standard_normal(shape)
        flying = np.ones(n, dtype=np.bool_)
        seen = []
        in_flight = [flying]
        seeds = [training_seed(self._seed, 0, self.episodes + i) for i in range(n)]
        observation, infos = env.reset(seed=seeds)
        lesson.begin(env, network is None)
        for _ in range(lesson.decisions):
            frames, command = lesson.look(observation, infos)
            seen.append(frames)
            if network is not None:
                with torch.no_grad():
                    output, _, state = network(torch.from_numpy(frames)[None], state)
                command = output[0].numpy() @ shares.T
            off = keep * off + np.sqrt(1.0 - keep**2) * size * self._rng.standard_normal(shape)
            flown_command = np.clip(command + off, -lesson.largest, lesson.largest).astype(
                np.float32
            )
            observation, _, lost, _, infos = env.step(flown_command)
            flying = flying & ~lost
            in_flight.append(flying)
        lesson.look(observation, infos)
        truth, counts = lesson.taught(np.array(in_flight))
        return Sequences(np.array(seen), truth.astype(np.float32), counts.astype(np.float32))
