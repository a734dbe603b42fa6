"""Training flights as sequences: a policy's inputs, and the simulator's truth of each decision."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.features import History
from ..controllers.observation import DECISION_PERIOD, MAX_COMMAND, VELOCITY_Y
from ..evaluation.episodes import DECISIONS
from .belief_network import BeliefNetwork, Sequences
from .configuration import Config, features_of
from .seeds import training_seed
from .training_envs import make_training_envs, scenarios_of

Array = NDArray[np.float64]
Frames = NDArray[np.float32]

_CALM = 0.5  # share of the episodes, after the first round, in which nothing leads off the path


class FanLesson:
    """FanTracking: the command of a law with sight of the fan (its velocity, and a gain on the
    offset), or the fan's place ``ahead`` decisions later.
    """

    decisions, period, largest = DECISIONS, DECISION_PERIOD, MAX_COMMAND

    def __init__(self, config: Config) -> None:
        self._config, self._features = config, features_of(config)

    def begin(self, envs: Any, leads: bool) -> None:
        """Start an episode in each of ``envs``; ``leads``: the teacher flies."""
        self._history: History | None = None
        self._known: list[Array] = []

    def look(self, observations: Frames, infos: dict[str, Any]) -> tuple[Frames, Array]:
        """Return frames (n, quantities) of the next decision, and the teacher's command (n, axes)
        there; after the last decision once more.
        """
        frames = self._features.frames(observations)
        if self._history is None:
            self._history = History(self._features, len(frames))
            self._history.restart(frames, list(range(len(frames))))
        else:
            self._history.push(frames)
        fan, own = infos["fan_y"], infos["y"]
        wanted = infos["fan_velocity"] + self._config["gain"] * (fan - own)
        self._known.append(np.array([fan, own, observations[:, VELOCITY_Y], wanted]))
        return self._history.flat(), wanted[:, None]

    def taught(self, kept: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Return the taught quantities of the episodes since ``begin``, and weights (decisions, n);
        ``kept`` (decisions + 1, n): the vehicle still flies.

        Taught is the command (decisions, n, 1), or the fan's offset, its velocity and that less the
        vehicle's own (decisions, n, 3).
        """
        fan, own, speed, wanted = np.stack(self._known, axis=1)
        now = np.arange(self.decisions)
        ahead = np.minimum(now + self._config["ahead"], self.decisions)
        if self._config["says"] == "command":
            truth = np.clip(wanted[:-1], -MAX_COMMAND, MAX_COMMAND)[..., None]
        else:
            velocity = (fan[ahead] - fan[:-1]) / (self.period * (ahead - now))[:, None]
            truth = np.stack([(fan - own)[:-1], velocity, velocity - speed[:-1]], axis=-1)
        # one that was lost begins anew elsewhere: what was to come is not known before that
        return truth, kept[ahead]


class Flights:
    """Training flights side by side, and their results.

    Args:
        envs: vector environments of each round; after a loss of its vehicle one goes on with
            another episode.
        lesson: inputs and taught quantities: a ``FanLesson``, or an object with its constants and
            methods.
        config: ``rounds``, ``wander`` (``size`` and ``time``, s, of an error of the commands).
        seed: the run's.
        advance: called with the number of decisions flown so far.
    """

    def __init__(
        self,
        envs: list[Any],
        lesson: Any,
        config: Config,
        seed: int,
        advance: Callable[[int], None] = lambda decisions: None,
    ) -> None:
        self._envs, self._lesson, self._wander = envs, lesson, config["wander"]
        self._seed, self._rng, self._advance = seed, np.random.default_rng(seed), advance
        self._flown: list[Sequences] = []
        self.episodes = 0

    def sequences(self) -> Sequences:
        """Return all flown sequences."""
        return Sequences(
            *(
                np.concatenate([getattr(one, name) for one in self._flown], axis=1)
                for name in ("seen", "truth", "counts")
            )
        )

    def fly(self, network: BeliefNetwork | None, shares: Frames) -> None:
        """Fly a round at ``shares`` (axes, taught) of the network's means, or with the teacher
        where there is no network.
        """
        for env in self._envs:
            n = env.num_envs
            size = self._wander["size"] * self._rng.random(n)
            if network is not None:
                size *= self._rng.random(n) >= _CALM
            self._flown.append(self._fly(env, network, shares, size[:, None]))
            self.episodes += n

    def _fly(
        self, env: Any, network: BeliefNetwork | None, shares: Frames, size: Array
    ) -> Sequences:
        lesson, n, state = self._lesson, env.num_envs, None
        shape = n, env.single_action_space.shape[0]
        keep = np.exp(-lesson.period / self._wander["time"])
        off, flying = size * self._rng.standard_normal(shape), np.ones(n, dtype=np.bool_)
        seen, kept = [], [flying]
        seeds = [training_seed(self._seed, 0, self.episodes + i) for i in range(n)]
        observation, infos = env.reset(seed=seeds)
        lesson.begin(env, network is None)
        for k in range(lesson.decisions):
            frames, command = lesson.look(observation, infos)
            seen.append(frames)
            if network is not None:
                with torch.no_grad():
                    said, _, state = network(torch.from_numpy(frames)[None], state)
                command = said[0].numpy() @ shares.T
            off = keep * off + np.sqrt(1.0 - keep**2) * size * self._rng.standard_normal(shape)
            given = np.clip(command + off, -lesson.largest, lesson.largest).astype(np.float32)
            observation, _, lost, _, infos = env.step(given)
            flying = flying & ~lost
            kept.append(flying)
            self._advance(self.episodes * lesson.decisions + n * (k + 1))
        lesson.look(observation, infos)
        truth, counts = lesson.taught(np.array(kept))
        return Sequences(np.array(seen), truth.astype(np.float32), counts.astype(np.float32))


def fan_flights(
    config: Config,
    scenario: str,
    seed: int,
    advance: Callable[[int], None] = lambda decisions: None,
) -> Flights:
    """Return flights of FanTracking in each scenario of a tier.

    Raises:
        InputError: as ``make_training_envs``.
    """
    scenarios = scenarios_of(scenario)
    episodes = -(-config["steps"] // (config["rounds"] * DECISIONS))
    each = -(-episodes // len(scenarios))
    envs = [
        make_training_envs(name, each * scenarios.count(name), config["estimator"])
        for name in dict.fromkeys(scenarios)
    ]
    return Flights(envs, FanLesson(config), config, seed, advance)
