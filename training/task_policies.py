"""Policies of the tasks beside ``FanTracking``: a GRU that is taught by a law that knows, and SAC.

``python -m windwrench.training.task_policies --task WindHover --kind gru --seed 0 --out FOLDER``.

``gru`` is imitation with a memory (as ``recurrent_imitation``): in rounds of DAgger the newest
network flies, the task's oracle says of every decision what it would do (in ``FanTracking2D`` where
the fan is and how it moves), and the network is fitted to whole episodes of that. ``sac`` is that
of stable-baselines3 on ``normalize=True``.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..controllers import make_controller
from ..controllers.observation import MAX_COMMAND
from ..controllers.trained_policy import TaskPolicy, save_policy
from ..controllers.wind_observation import MAX_ACCELERATION, OBSERVATION_SCALES
from ..envs.fan_tracking_2d import SCALES_2D
from ..evaluation.tasks import TASKS
from .belief_network import BeliefNetwork, Sequences, fit
from .learners import weights_of
from .run import origin, validate
from .seeds import training_seed

Array = NDArray[np.float32]

_STATE, _NET, _ACTIVATION = 48, [32], "tanh"  # of the GRU and the layer after it
# of the error added to half of the flights: a share of the largest action, and what is kept of it
# from decision to decision
_WANDER, _KEEP = 0.3, 0.9
_CUT = 125  # decisions of a sequence that is learned from
# signs of a frame of FanTracking2D after half a turn about the jet's axis: it changes the sign of
# all that is taught
_TURNED = np.array([1, -1, -1, 1, -1, -1, -1, -1, -1, -1], dtype=np.float32)
_GAINS = (1.2, 2.0, 3.0)  # 1/s, on what it says of the fan's offset; one is chosen
VALIDATION = 10  # episodes
SCENARIO = "base"


class _Student:
    """A network in flight."""

    def __init__(self, network: BeliefNetwork, scale: Array, shares: Array) -> None:
        self._network, self._scale = network, scale
        self._shares, self._state = torch.from_numpy(shares), None

    def __call__(self, observation: Array) -> Array:
        with torch.no_grad():
            x = torch.from_numpy((observation / self._scale)[None, None])
            said, _, self._state = self._network(x, self._state)
            action: Array = (self._shares @ said[0, 0]).numpy()
        return action


def teach(task: str, seed: int, rounds: int, episodes: int, epochs: int) -> TaskPolicy:
    """Return a GRU that was taught in rounds of DAgger of so many episodes each."""
    known, oracle = TASKS[task], make_controller("oracle", task)
    env = known.environment(SCENARIO)
    env.preview = getattr(oracle, "preview", 0.0)
    of_fan = task == "FanTracking2D"
    scale, taught = _scale(task), 4 if of_fan else 3
    torch.manual_seed(seed)
    rng, order = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    network = BeliefNetwork(len(scale), taught, "gru", _STATE, _NET, _ACTIVATION)
    shares = _shares(of_fan, _GAINS[1])
    cut = known.decisions if of_fan else _CUT  # where a fan is takes long to find out
    parts: list[tuple[Array, Array, Array]] = []
    for number in range(rounds):
        for k in range(episodes):
            flown = number * episodes + k
            student = _Student(network, scale, shares) if number else None
            wander = _WANDER * _largest(task) * (k % 2)
            parts += _flown(
                env, oracle, student, training_seed(seed, 0, flown), known.decisions, wander, rng,
                of_fan, cut, scale,
            )  # fmt: skip
        seen, truth, counts = (np.stack(x, axis=1) for x in zip(*parts, strict=True))
        last = number == rounds - 1
        loss = fit(
            network,
            Sequences(seen, truth, counts),
            3 * epochs if last else epochs,
            32,
            (3e-3, 1e-4 if last else 1e-3),
            order,
            _TURNED if of_fan else None,
        )
        print(f"round {number}: {len(parts)} sequences, loss {loss:.4f}", flush=True)
    card = card_of(task, "gru", seed, rounds * episodes * known.decisions, _ACTIVATION)

    def policy(gain: float) -> TaskPolicy:
        return TaskPolicy(
            card | ({"gain": gain} if of_fan else {}),
            network.policy_weights(_shares(of_fan, gain)),
        )

    tried = [policy(gain) for gain in (_GAINS if of_fan else _GAINS[:1])]
    return min(tried, key=lambda each: validate(each, env, VALIDATION, task)[0])


def _shares(of_fan: bool, gain: float) -> Array:
    if not of_fan:
        return np.eye(3, dtype=np.float32)
    return np.array([[gain, 0.0, 1.0, 0.0], [0.0, gain, 0.0, 1.0]], dtype=np.float32)


def _flown(
    env: Any,
    oracle: Any,
    student: _Student | None,
    seed: int,
    decisions: int,
    wander: float,
    rng: np.random.Generator,
    of_fan: bool,
    cut: int,
    scale: Array,
) -> list[tuple[Array, Array, Array]]:
    """Return an episode's frames, what is taught, and what counts, in sequences of ``cut``."""
    observation, info = env.reset(seed=seed)
    oracle.reset()
    seen = np.zeros((decisions, len(scale)), dtype=np.float32)
    truth = np.zeros((decisions, 4 if of_fan else 3), dtype=np.float32)
    counts = np.zeros(decisions, dtype=np.float32)
    error = np.zeros(env.action_space.shape, dtype=np.float32)
    for k in range(decisions):
        wanted = oracle(observation, info)
        seen[k], counts[k] = observation / scale, 1.0
        truth[k] = (
            [*(info["fan"] - info["position"])[:2], *info["fan_velocity"][:2]] if of_fan else wanted
        )
        error = _KEEP * error + np.sqrt(1.0 - _KEEP**2) * wander * rng.standard_normal(error.shape)
        action = (wanted if student is None else student(observation)) + error
        observation, _, lost, _, info = env.step(np.asarray(action, dtype=np.float32))
        if lost:
            break
    return [
        (seen[i : i + cut], truth[i : i + cut], counts[i : i + cut])
        for i in range(0, decisions - cut + 1, cut)
        if counts[i : i + cut].any()
    ]


def sac(task: str, seed: int, steps: int) -> TaskPolicy:
    """Return what SAC learns in ``steps`` decisions."""
    import gymnasium
    from stable_baselines3 import SAC
    from stable_baselines3.common.monitor import Monitor

    torch.set_num_threads(1)
    env = Monitor(gymnasium.make(f"windwrench/{task}-v0", scenario=SCENARIO, normalize=True))
    learner = SAC(
        "MlpPolicy",
        env,
        gamma=0.9,
        learning_rate=1e-3,
        learning_starts=1000,
        train_freq=2,
        gradient_steps=1,
        policy_kwargs={"net_arch": [64, 64]},
        seed=seed,
        device="cpu",
    )
    learner.learn(steps)
    return TaskPolicy(card_of(task, "sac", seed, steps, "relu"), weights_of(learner, "sac"))


def card_of(task: str, kind: str, seed: int, steps: int, activation: str) -> dict[str, Any]:
    """Return the card of a policy."""
    return {
        **origin(kind, SCENARIO, seed, steps, activation),
        "task": task,
        "scale": [float(f"{x:.6g}") for x in _scale(task)],
        "largest": _largest(task),
    }


def _scale(task: str) -> Array:
    scale = SCALES_2D if task == "FanTracking2D" else OBSERVATION_SCALES
    return np.array(scale, dtype=np.float32)


def _largest(task: str) -> float:
    return MAX_COMMAND if task == "FanTracking2D" else MAX_ACCELERATION


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
