"""Laws by name, and policies that are taught for a vehicle in the kit's own plant.

``linear`` and ``gru`` are ``windwrench.training.task_policies`` for another vehicle: hindsight in
four rounds of DAgger, in the kit's lanes, with the kit's motors. No policy sees the other
simulator before it flies there.
"""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from windwrench.controllers.briefing import Briefing
from windwrench.controllers.trained_policy import TaskPolicy, load_policy, save_policy
from windwrench.dynamics.vehicle import Vehicle
from windwrench.envs.lanes.vector import TaskLanes
from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.evaluation.tasks import make_pilot
from windwrench.training.flown_sequences import Flights
from windwrench.training.hindsight import WindLesson
from windwrench.training.linear_policy import MEMORY, LinearLaw
from windwrench.training.run import origin
from windwrench.training.taught_network import TaughtNetwork, fit

Array = NDArray[Any]
TASK, SCENARIO, SEED = "WindHover", "base", 0
TAUGHT = ("linear", "gru")
_ROUNDS, _EPOCHS, _BATCH, _RATE = 4, 4, 32, 5e-3
_EPISODES = {"linear": 64, "gru": 256}  # of a round
_WANDER = (0.3, 0.5)  # error of the commands: share of the largest, and s
_SHARES = np.eye(3, dtype=np.float32)


class _Lesson(WindLesson):
    """The lesson of WindHover for another vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(TASK)
        self._vehicle, self._oracle.vehicle = vehicle, vehicle

    def begin(self, envs: TaskLanes, leads: bool) -> None:
        """Start an episode in each of ``envs``; ``lqg`` flies the vehicle where it leads."""
        super().begin(envs, leads)
        for law in self._laws:
            law.brief(Briefing(self._vehicle))


def taught_path(kind: str, vehicle: Vehicle, folder: Path) -> Path:
    """Return the file of a policy that is taught for a vehicle; it is taught where there is none.

    Args:
        kind: one of ``TAUGHT``.
        vehicle: as declared, and as it flies in training.
        folder: of the policies.
    """
    path = folder / f"{kind}-{vehicle.name}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        torch.set_num_threads(1)
        torch.manual_seed(SEED)
        save_policy(*(_linear if kind == "linear" else _gru)(vehicle), path)
    return path


def _flights(kind: str, vehicle: Vehicle) -> Flights:
    envs = TaskLanes(_EPISODES[kind], task=WindHoverEnv, scenario=SCENARIO, vehicle=vehicle)
    return Flights([envs], _Lesson(vehicle), _WANDER, SEED)


def _card(kind: str, flights: Flights) -> dict[str, Any]:
    steps = flights.episodes * WindLesson.decisions
    scale = [float(x) for x in WindHoverEnv.scales]
    origins = origin(kind, SCENARIO, SEED, steps, "tanh")
    return origins | {"task": TASK, "scale": scale, "largest": WindLesson.largest}


def _linear(vehicle: Vehicle) -> tuple[dict[str, Any], Any]:
    law, flights = LinearLaw(), _flights("linear", vehicle)
    for number in range(_ROUNDS):
        flights.fly(law if number else None, _SHARES)
        law.fit(flights.sequences())
    return _card("linear", flights) | {"memory": list(MEMORY)}, law.weights(_SHARES)


def _gru(vehicle: Vehicle) -> tuple[dict[str, Any], Any]:
    network = TaughtNetwork(len(WindHoverEnv.scales), 3, "gru", 64, [64], "tanh")
    flights, order = _flights("gru", vehicle), torch.Generator().manual_seed(SEED)
    for number in range(_ROUNDS):
        flights.fly(network if number else None, _SHARES)
        flown, last = flights.sequences(), number == _ROUNDS - 1
        if number == 0:
            network.whiten(flown.seen)
        rates = _RATE, 0.0 if last else 0.1 * _RATE
        fit(network, flown, _EPOCHS * (3 if last else 1), _BATCH, rates, order, None)
    return _card("gru", flights), network.policy_weights(_SHARES)


class LearnedRates:
    """A policy of stable-baselines3 on ``WindHover-v2`` with body rates and thrust as actions."""

    arguments: ClassVar[dict[str, Any]] = {
        "action": "rates",
        "observation": "wrench",
        "normalize": True,
    }

    def __init__(self, path: str) -> None:
        from stable_baselines3 import PPO

        self._learner = PPO.load(path, device="cpu")

    def __call__(self, observation: Array, info: Any = None) -> Array:
        """Return the action (4,), -1 to 1."""
        action: Array = self._learner.predict(observation, deterministic=True)[0]
        return action


def pilot_of(name: str, vehicle: Vehicle, folder: Path) -> Any:
    """Return a controller of WindHover.

    Args:
        name: a law, one of ``TAUGHT``, or the path of a ``LearnedRates`` (.zip). A class attribute
            ``arguments`` has the arguments of its environment.
        vehicle: as declared.
        folder: of the taught policies.
    """
    if name in TAUGHT:
        policy: TaskPolicy = load_policy(taught_path(name, vehicle, folder))
        return policy
    return LearnedRates(name) if name.endswith(".zip") else make_pilot(name, TASK)
