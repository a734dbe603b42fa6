"""Policies of the tasks beside ``FanTracking``: a GRU taught by a law with knowledge.

``python -m windwrench.training.task_policies --task WindHover --seed 0 --out FOLDER``.

``gru`` is imitation with a memory (``imitation``): in the wind it is taught the best commands in
view of the future (``hindsight``), in a mix of scenarios or in one. In ``FanTracking2D`` the
simulator gives place and motion of the fan, on ``base``.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers.trained_policy import TaskPolicy, save_policy
from ..evaluation.tasks import TASKS
from .belief_network import BeliefNetwork
from .flown_sequences import Flights
from .hindsight import MIX, WindLesson, lanes_of
from .imitation import rounds as taught_in_rounds
from .run import origin, validate

Array = NDArray[np.float32]

# of FanTracking2D and of the wind: sizes of the GRU and of the layer after it, rounds of DAgger,
# episodes of a batch, and the learning rate
_FIT: dict[bool, dict[str, Any]] = {
    True: {"state": 48, "net": [32], "batch_size": 16, "learning_rate": 3e-3},
    False: {"state": 64, "net": [64], "batch_size": 32, "learning_rate": 5e-3},
}
_ACTIVATION = "tanh"
# of the error added to half of the flights: a share of the largest action, and s that it lasts
_WANDER, _WANDER_TIME = 0.3, 0.5
# signs of a frame of FanTracking2D after half a turn about the jet's axis: it changes the sign of
# all that is taught
_TURNED = np.array([1, -1, -1, 1, -1, -1, -1, -1, -1, -1], dtype=np.float32)
_GAINS = (1.2, 2.0, 3.0)  # 1/s, on what it says of the fan's offset; one is chosen
VALIDATION = 10  # episodes
BASE = "base"


def _card(task: str, scenario: str, seed: int, steps: int) -> dict[str, Any]:
    """Return the card of a policy."""
    env = TASKS[task].environment
    told = {"task": task, "scale": [float(f"{x:.6g}") for x in env.scales]}
    own = origin("gru", scenario, seed, steps, _ACTIVATION)
    return own | told | {"largest": env.largest_action}


class FanPlaneLesson:
    """FanTracking2D: scaled observations; the fan's offset from the vehicle (m) and its velocity
    (m/s), both in the plane of the commands. A law with sight of both flies the first round.
    """

    _kind = TASKS["FanTracking2D"].environment
    decisions, period = _kind.decisions(), 1.0 / _kind.decision_hz
    largest, scale = _kind.largest_action, np.array(_kind.scales, dtype=np.float32)

    def begin(self, envs: Any, leads: bool) -> None:
        """Start an episode in each of ``envs``."""
        self._truth: list[Any] = []

    def look(self, observations: Array, infos: dict[str, Any]) -> tuple[Array, Any]:
        """Return scaled observations (n, quantities) and the law's commands (n, 2)."""
        truth = np.hstack([infos["fan"] - infos["position"], infos["fan_velocity"]])
        self._truth.append(truth)
        return observations / self.scale, truth @ _shares(True, _GAINS[1]).T

    def taught(self, kept: NDArray[np.bool_]) -> tuple[Any, NDArray[np.bool_]]:
        """Return the taught quantities (decisions, n, 4), and weights (decisions, n)."""
        return np.array(self._truth[:-1]), kept[:-1]


def _shares(of_fan: bool, gain: float) -> Array:
    """Return the shares (axes, 4 or 3) of each taught quantity in the command."""
    if not of_fan:
        return np.eye(3, dtype=np.float32)
    return np.array([[gain, 0.0, 1.0, 0.0], [0.0, gain, 0.0, 1.0]], dtype=np.float32)


def teach(
    task: str, scenario: str, seed: int, rounds: int, episodes: int, epochs: int
) -> TaskPolicy:
    """Return a GRU taught in rounds of DAgger of so many episodes each."""
    of_fan = task == "FanTracking2D"
    lesson = FanPlaneLesson() if of_fan else WindLesson(task)
    config = {
        **_FIT[of_fan],
        "rounds": rounds,
        "epochs": epochs,
        "last_epochs": 3 * epochs,
        "wander": {"size": _WANDER * lesson.largest, "time": _WANDER_TIME},
    }
    torch.manual_seed(seed)
    shape = "gru", config["state"], config["net"], _ACTIVATION
    network = BeliefNetwork(len(lesson.scale), 4 if of_fan else 3, *shape)
    flights = Flights(lanes_of(task, scenario, episodes), lesson, config, seed)
    mirrored = _TURNED if of_fan else None
    shares = _shares(of_fan, _GAINS[1])
    for last in taught_in_rounds(network, flights, shares, config, seed, mirrored, not of_fan):
        print(f"{flights.episodes} episodes{', the last' if last else ''}", flush=True)
    card = _card(task, scenario, seed, flights.episodes * lesson.decisions)
    if not of_fan:
        return TaskPolicy(card, network.policy_weights(shares))
    tried = [
        TaskPolicy({**card, "gain": gain}, network.policy_weights(_shares(of_fan, gain)))
        for gain in _GAINS
    ]
    env = TASKS[task].environment(BASE)
    return min(tried, key=lambda each: validate(each, env, VALIDATION)[0])


def main() -> None:
    """Train one policy and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=[*TASKS], required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=4, help="of DAgger")
    parser.add_argument("--scenario", default=MIX, help=f"of the wind, or a mix of them: {MIX}")
    parser.add_argument("--episodes", type=int, default=256, help="of each round")
    parser.add_argument("--epochs", type=int, default=4, help="of each round; the last, thrice")
    parser.add_argument("--out", type=Path, default=Path("training/policies/tasks"))
    given = parser.parse_args()
    torch.set_num_threads(1)
    began = time.process_time()
    scenario = BASE if given.task == "FanTracking2D" else given.scenario
    policy = teach(given.task, scenario, given.seed, given.rounds, given.episodes, given.epochs)
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / f"{given.task}-gru-{given.seed}.npz"
    env = TASKS[given.task].environment(BASE)
    rmse, lost, _ = validate(policy, env, VALIDATION)
    policy.card |= {
        "validation": {"episodes": VALIDATION, "rmse_m": round(rmse, 5), "lost": lost},
        "training_cpu_s": round(time.process_time() - began),
    }
    save_policy(policy.card, policy.weights, path)
    print(f"{path}: {rmse:.4f} m on validation, {lost} lost, {time.process_time() - began:.0f} s")


if __name__ == "__main__":
    main()
