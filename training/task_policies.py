"""Policies taught by a law with knowledge in rounds of DAgger.

``python -m windwrench.training.task_policies --task WindHover --seed 0 --out FOLDER``.

In every round of DAgger (Ross, Gordon and Bagnell, 2011) the newest network flies, with the inputs
of any policy. For every decision a law with knowledge gives the answer, and the network is fitted
to all answers so far, over whole episodes. In the wind and in ``FanTracking`` the answers are the
best commands in view of the future (``hindsight``, ``fan_hindsight``), in a mix of scenarios. In
``FanTracking2D`` the simulator gives place and motion of the fan. ``linear`` is a linear law of any
observation, fitted to the same answers in one scenario, in seconds.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..controllers.features import Features
from ..controllers.trained_policy import TaskPolicy, TrainedPolicy, Weights, save_policy
from ..envs.observations import OBSERVATIONS, as_numbers
from ..evaluation.tasks import TASKS
from ..runtime.arrays import Mask, Single
from .fan_hindsight import FEATURES, FanHindsight
from .flown_sequences import Flights
from .hindsight import FAN_MIX, MIX, WindLesson, lanes_of
from .linear_policy import MEMORY, LinearLaw
from .run import origin, validate
from .taught_network import TaughtNetwork, fit

FAN = "FanTracking"
FAN_PLANE = "FanTracking2D"
WIND = "wind"
LINEAR = "linear"
# for each kind of task. Network: cell, its size, sizes of the layers after. DAgger: rounds, their
# episodes, epochs of a fit (in the last round three times as many). Fit: episodes in a batch,
# learning rate. Error in half of the flights: share of the largest action, duration in s
_FIT: dict[str, dict[str, Any]] = {
    FAN: {"cell": "lstm", "state": 96, "net": [64], "rounds": 4, "episodes": 1024, "epochs": 5}
    | {"batch_size": 32, "learning_rate": 3e-3, "wander": (0.4, 1.0)},
    FAN_PLANE: {"cell": "gru", "state": 48, "net": [32], "rounds": 4, "episodes": 256, "epochs": 4}
    | {"batch_size": 16, "learning_rate": 3e-3, "wander": (0.3, 0.5)},
    WIND: {"cell": "gru", "state": 64, "net": [64], "rounds": 4, "episodes": 256, "epochs": 4}
    | {"batch_size": 32, "learning_rate": 5e-3, "wander": (0.3, 0.5)},
}
_LINEAR = {"rounds": 4, "episodes": 64}
_LEAST_RATE = 0.1  # share of the learning rate at the end of a round
_ACTIVATION = "tanh"
# signs of a frame of FanTracking2D after half a turn about the jet's axis; taught quantities change
# their signs, too
_TURNED = np.array([1, -1, -1, 1, -1, -1, -1, -1, -1, -1], dtype=np.float32)
_GAINS = (1.2, 2.0, 3.0)  # 1/s, on the network's offset of the fan; validation chooses one
VALIDATION = 10  # episodes
BASE = "base"


def _fit_of(task: str) -> dict[str, Any]:
    return _FIT.get(task, _FIT[WIND])


def _card(
    task: str, kind: str, scenario: str, seed: int, steps: int, observation: str | None = None
) -> dict[str, Any]:
    """Return the card of a policy."""
    card = origin(kind, scenario, seed, steps, _ACTIVATION)
    if task == FAN and kind != LINEAR:
        return card | {"features": asdict(FEATURES), "repeat": 1}
    env = TASKS[task].environment(observation=observation)
    scale = [float(f"{x:.6g}") for x in env.bounds()[1]]
    seen = {"task": task, "observation": observation, "scale": scale}
    return card | seen | {"largest": env.largest_action}


class _FanPlaneLesson:
    """FanTracking2D: scaled observations; the fan's offset from the vehicle (m) and its velocity
    (m/s), both in the plane of the commands. A law with sight of both flies the first round.
    """

    _kind = TASKS[FAN_PLANE].environment
    decisions = _kind.decisions()
    period = 1.0 / _kind.decision_hz
    largest = _kind.largest_action

    def begin(self, envs: Any, leads: bool) -> None:
        """Start an episode in each of ``envs``."""
        self._truth: list[Any] = []
        self._scale = as_numbers(envs.task.bounds()[1] or 1.0)

    def look(self, observations: Single, infos: dict[str, Any]) -> tuple[Single, Any]:
        """Return scaled observations (n, quantities) and the law's commands (n, 2)."""
        truth = np.hstack([infos["fan"] - infos["position"], infos["fan_velocity"]])
        self._truth.append(truth)
        return observations / self._scale, truth @ _shares(FAN_PLANE).T

    def taught(self, in_flight: Mask) -> tuple[Any, Mask]:
        """Return the taught quantities (decisions, n, 4), and weights (decisions, n)."""
        return np.array(self._truth[:-1]), in_flight[:-1]


def _shares(task: str, gain: float = _GAINS[1]) -> Single:
    """Return the shares (axes, taught) of each taught quantity in the command."""
    if task == FAN:
        return np.eye(3, dtype=np.float32)[:1]
    if task == FAN_PLANE:
        return np.array([[gain, 0.0, 1.0, 0.0], [0.0, gain, 0.0, 1.0]], dtype=np.float32)
    return np.eye(3, dtype=np.float32)


def _lesson_of(task: str, features: Features | None) -> Any:
    """Return the lesson of a task; ``features``: a policy's of FanTracking, if any."""
    if task == FAN:
        return FanHindsight(features)
    return _FanPlaneLesson() if task == FAN_PLANE else WindLesson(task)


def teach(task: str, scenario: str, seed: int, **changed: Any) -> TaskPolicy | TrainedPolicy:
    """Return a recurrent policy taught in rounds of DAgger.

    Args:
        task: its name.
        scenario: a scenario of the task, or one of ``hindsight.MIXES``.
        seed: for flights and network.
        **changed: entries of ``_FIT`` in place of the task's: ``rounds``, ``episodes``, ``epochs``.
    """
    settings = _fit_of(task) | changed
    lesson = _lesson_of(task, FEATURES)
    envs = lanes_of(task, scenario, settings["episodes"])
    quantities = FEATURES.size if task == FAN else len(TASKS[task].environment.scales)
    mirrored = {FAN: FEATURES.mirrored, FAN_PLANE: _TURNED}.get(task)
    shares = _shares(task)
    torch.manual_seed(seed)
    shape = settings["cell"], settings["state"], settings["net"], _ACTIVATION
    network = TaughtNetwork(quantities, shares.shape[1], *shape)
    flights = Flights(envs, lesson, settings["wander"], seed)
    order = torch.Generator().manual_seed(seed)
    for number in range(settings["rounds"]):
        flights.fly(network if number else None, shares)
        flown = flights.sequences()
        last = number == settings["rounds"] - 1
        if number == 0 and task != FAN_PLANE:
            network.whiten(flown.seen)
        epochs, rate = settings["epochs"] * (3 if last else 1), settings["learning_rate"]
        rates = rate, 0.0 if last else _LEAST_RATE * rate
        fit(network, flown, epochs, settings["batch_size"], rates, order, mirrored)
        print(f"{flights.episodes} episodes, {time.process_time():.0f} s", flush=True)
    card = _card(task, settings["cell"], scenario, seed, flights.episodes * lesson.decisions)
    card |= {"fit": {name: value for name, value in settings.items() if name != "cell"}}
    return _chosen(card, network.policy_weights)


def _chosen(
    card: dict[str, Any], weights: Callable[[Single], Weights]
) -> TaskPolicy | TrainedPolicy:
    """Return the policy of ``weights`` of shares; in FanTracking2D with the gain that is best on
    validation episodes in the scenario of its training.
    """
    task = card.get("task", FAN)
    kind = TaskPolicy if "task" in card else TrainedPolicy
    if task != FAN_PLANE:
        return kind(card, weights(_shares(task)))
    tried = [TaskPolicy({**card, "gain": gain}, weights(_shares(task, gain))) for gain in _GAINS]
    env = TASKS[task].make(card["scenario"], observation=card.get("observation"))
    return min(tried, key=lambda each: validate(each, env, VALIDATION)[0])


def linear(
    task: str, scenario: str, seed: int, observation: str | None = None, **changed: Any
) -> TaskPolicy | TrainedPolicy:
    """Return a linear law of a task; ``observation``: one of ``OBSERVATIONS`` in place of the
    task's own; other arguments as of ``teach``.
    """
    settings = _LINEAR | changed
    lesson = _lesson_of(task, None)
    envs = lanes_of(task, scenario, settings["episodes"], observation)
    law = LinearLaw()
    flights = Flights(envs, lesson, _fit_of(task)["wander"], seed)
    for number in range(settings["rounds"]):
        flights.fly(law if number else None, _shares(task))
        law.fit(flights.sequences())
    flown = flights.episodes * lesson.decisions
    card = _card(task, LINEAR, scenario, seed, flown, observation)
    return _chosen(card | {"fit": settings, "memory": list(MEMORY)}, law.weights)


def main() -> None:
    """Train one policy and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=[*TASKS], required=True)
    parser.add_argument("--kind", choices=["taught", LINEAR], default="taught")
    parser.add_argument(
        "--observation", choices=OBSERVATIONS, help="of a linear law; default: the task's own"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--scenario", help=f"of the wind; default: {BASE} for a linear law, else a mix: {MIX}"
    )
    for name, help_text in (
        ("rounds", "of DAgger"),
        ("episodes", "of each round"),
        ("epochs", "of each round; the last, thrice"),
    ):
        parser.add_argument(f"--{name}", type=int, help=f"{help_text}; default: the task's")
    parser.add_argument("--out", type=Path, help="folder; default: that of the kit's policies")
    options = parser.parse_args()
    taught = options.kind != LINEAR
    asked = vars(options)
    if taught and options.observation:
        parser.error("--observation: expected --kind linear")
    torch.set_num_threads(1)
    began = time.process_time()
    task = options.task
    changed = {name: asked[name] for name in ("rounds", "episodes", "epochs") if asked[name]}
    usual = {FAN: FAN_MIX, FAN_PLANE: BASE}.get(task, MIX) if taught else BASE
    scenario = usual if taught and task == FAN else options.scenario or usual
    if not taught:
        changed |= {"observation": options.observation}
    policy = (teach if taught else linear)(task, scenario, options.seed, **changed)
    folder, start = "training/policies/tasks", f"{task}-"
    if isinstance(policy, TrainedPolicy):
        folder, start = "training/policies", ""
    name = f"{start}{policy.card['algorithm']}-{options.seed}.npz"
    path = Path(options.out or folder, name)
    env = TASKS[task].make(BASE, observation=options.observation)
    rmse, lost, _ = validate(policy, env, VALIDATION)
    policy.card |= {
        "validation": {"episodes": VALIDATION, "rmse_m": round(rmse, 5), "lost": lost},
        "training_cpu_s": round(time.process_time() - began),
    }
    save_policy(policy.card, policy.weights, path)
    print(f"{path}: {rmse:.4f} m on validation, {lost} lost, {time.process_time() - began:.0f} s")


if __name__ == "__main__":
    main()
