"""Policies of the tasks beside ``FanTracking``: a GRU that is taught by a law that knows, and SAC.

``python -m windwrench.training.task_policies --task WindHover --kind gru --seed 0 --out FOLDER``.

``gru`` is imitation with a memory (``imitation``): the task's oracle says of every decision what it
would do; in ``FanTracking2D`` the simulator says where the fan is and how it moves. ``sac`` is that
of stable-baselines3 on the task's version 1.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from ..controllers import make_controller
from ..controllers.trained_policy import TaskPolicy, save_policy
from ..envs.plant import TICK
from ..evaluation.tasks import TASKS
from .belief_network import BeliefNetwork
from .configuration import load_config
from .flown_sequences import Flights
from .imitation import rounds as taught_in_rounds
from .learners import make_learner, weights_of
from .run import origin, validate

Array = NDArray[np.float32]

_STATE, _NET, _ACTIVATION = 48, [32], "tanh"  # of the GRU and the layer after it
_FIT = {"batch_size": 16, "learning_rate": 3e-3}  # episodes
# of the error added to half of the flights: a share of the largest action, and s that it lasts
_WANDER, _WANDER_TIME = 0.3, 0.5
_SAC = (
    "learner.gamma=0.9",
    "learner.learning_rate=0.001",
    "learning_rate_end=0.001",
    "learner.tau=0.005",
    "learner.train_freq=2",
    "learner.gradient_steps=1",
)
# signs of a frame of FanTracking2D after half a turn about the jet's axis: it changes the sign of
# all that is taught
_TURNED = np.array([1, -1, -1, 1, -1, -1, -1, -1, -1, -1], dtype=np.float32)
_GAINS = (1.2, 2.0, 3.0)  # 1/s, on what it says of the fan's offset; one is chosen
VALIDATION = 10  # episodes
SCENARIO = "base"


class TaskLesson:
    """A task: scaled observations, and the oracle's action; in FanTracking2D the fan's offset from
    the vehicle (m) and its velocity (m/s), both in the plane of the commands.
    """

    def __init__(self, task: str) -> None:
        kind = TASKS[task].environment
        self.of_fan, self._task = task == "FanTracking2D", task
        self.decisions, self.period = kind.decisions(), TICK * kind.decision_ticks
        self.largest, self.scale = kind.largest_action, np.array(kind.scales, dtype=np.float32)

    def card(self, kind: str, seed: int, steps: int, activation: str) -> dict[str, Any]:
        """Return the card of a policy."""
        scale = [float(f"{x:.6g}") for x in self.scale]
        told = {"task": self._task, "scale": scale, "largest": self.largest}
        return origin(kind, SCENARIO, seed, steps, activation) | told

    def begin(self, count: int) -> None:
        """Start ``count`` episodes."""
        self._oracles = [make_controller("oracle", self._task) for _ in range(count)]
        self._truth: list[Any] = []

    def look(self, observations: Array, infos: dict[str, Any]) -> tuple[Array, Any]:
        """Return scaled observations (n, quantities) and the oracle's actions (n, axes)."""
        wanted = np.array(
            [
                oracle(observations[i], {name: values[i] for name, values in infos.items()})
                for i, oracle in enumerate(self._oracles)
            ]
        )
        if self.of_fan:
            offset, velocity = infos["fan"] - infos["position"], infos["fan_velocity"]
            self._truth.append(np.concatenate([offset[:, :2], velocity[:, :2]], axis=1))
        else:
            self._truth.append(wanted)
        return observations / self.scale, wanted

    def taught(self, kept: NDArray[np.bool_]) -> tuple[Any, NDArray[np.bool_]]:
        """Return what is taught (decisions, n, 4 or 3), and what counts (decisions, n)."""
        return np.array(self._truth[:-1]), kept[:-1]

    def shares(self, gain: float) -> Array:
        """Return what is commanded (axes, 4 or 3) of each quantity that is taught."""
        if not self.of_fan:
            return np.eye(3, dtype=np.float32)
        return np.array([[gain, 0.0, 1.0, 0.0], [0.0, gain, 0.0, 1.0]], dtype=np.float32)


def _environment(task: str) -> Any:
    """Return the task's environment, with what its oracle must see."""
    env = TASKS[task].environment(SCENARIO)
    env.foresight = make_controller("oracle", task).foresight
    return env


def teach(task: str, seed: int, rounds: int, episodes: int, epochs: int) -> TaskPolicy:
    """Return a GRU that was taught in rounds of DAgger of so many episodes each."""
    lesson = TaskLesson(task)
    config = {
        **_FIT,
        "rounds": rounds,
        "epochs": epochs,
        "last_epochs": 3 * epochs,
        "wander": {"size": _WANDER * lesson.largest, "time": _WANDER_TIME},
    }
    torch.manual_seed(seed)
    network = BeliefNetwork(
        len(lesson.scale), 4 if lesson.of_fan else 3, "gru", _STATE, _NET, _ACTIVATION
    )
    envs = SyncVectorEnv(
        [lambda: _environment(task)] * episodes, autoreset_mode=AutoresetMode.NEXT_STEP
    )
    flights = Flights([envs], lesson, config, seed)
    mirrored = _TURNED if lesson.of_fan else None
    for last in taught_in_rounds(
        network, flights, lesson.shares(_GAINS[1]), config, seed, mirrored
    ):
        print(f"{flights.episodes} episodes{', the last' if last else ''}", flush=True)
    card = lesson.card("gru", seed, flights.episodes * lesson.decisions, _ACTIVATION)
    tried = [
        TaskPolicy({**card, "gain": gain}, network.policy_weights(lesson.shares(gain)))
        for gain in (_GAINS if lesson.of_fan else _GAINS[:1])
    ]
    env = _environment(task)
    return min(tried, key=lambda each: validate(each, env, VALIDATION, task)[0])


def sac(task: str, seed: int, steps: int) -> TaskPolicy:
    """Return what SAC learns in ``steps`` decisions."""
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    name = f"windwrench/{task}-v1"
    env = DummyVecEnv([lambda: Monitor(gym.make(name, scenario=SCENARIO))])
    entropy = f"learner.target_entropy={-float(env.action_space.shape[0])}"
    config = load_config("sac", [*_SAC, entropy, f"steps={steps}"])
    learner = make_learner(config, env, seed)
    learner.learn(steps)
    card = TaskLesson(task).card("sac", seed, steps, "relu")
    return TaskPolicy(card, weights_of(learner, "sac"))


def main() -> None:
    """Train one policy and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=[*TASKS], required=True)
    parser.add_argument("--kind", choices=["gru", "sac"], default="gru")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=4, help="of DAgger")
    parser.add_argument("--episodes", type=int, default=16, help="of each round")
    parser.add_argument("--epochs", type=int, default=12, help="of each round; the last, thrice")
    parser.add_argument("--steps", type=int, default=20_000, help="decisions of SAC")
    parser.add_argument("--out", type=Path, default=Path("training/policies/tasks"))
    given = parser.parse_args()
    torch.set_num_threads(1)
    began = time.process_time()
    if given.kind == "sac":
        policy = sac(given.task, given.seed, given.steps)
    else:
        policy = teach(given.task, given.seed, given.rounds, given.episodes, given.epochs)
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / f"{given.task}-{given.kind}-{given.seed}.npz"
    env = TASKS[given.task].environment(SCENARIO)
    rmse, lost = validate(policy, env, VALIDATION, given.task)
    policy.card |= {
        "validation": {"episodes": VALIDATION, "rmse_m": round(rmse, 5), "lost": lost},
        "training_cpu_s": round(time.process_time() - began),
    }
    save_policy(policy.card, policy.weights, path)
    print(f"{path}: {rmse:.4f} m on validation, {lost} lost, {time.process_time() - began:.0f} s")


if __name__ == "__main__":
    main()
