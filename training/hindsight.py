"""What a law that had known all that came would have commanded: the teacher of the wind tasks.

The model of the flight loop and the vehicle under it is linear (``controllers.axis_models``). What
a flight did beside it, from one decision to the next, is a disturbance, whatever it comes from:
wind, a vehicle that is not the declared one, errors of the estimate that the flight loop flies by,
a reference that turns. Once flown it is known, and the linear-quadratic regulator with preview
(``controllers.preview``) says of each decision what would have been best in view of all that came.
The mean of that command, given what can be seen at the time, is the best command there is
(certainty equivalence), and it is what a network learns that is fitted to it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..controllers import make_controller
from ..controllers.preview import WindOracle, preview
from ..controllers.wind_observation import LAST_ACTION, MAX_ACCELERATION, WIND_PERIOD
from ..envs.lanes.vector import TaskLanes
from ..evaluation.tasks import TASKS

Array = NDArray[np.float64]
Frames = NDArray[np.float32]

AHEAD = 14  # decisions, of which a command knows the disturbances
# a mix: scenarios, and how many of eight episodes each has
_MIXES = {
    "wide": {"base": 2}
    | dict.fromkeys(("turbulent", "noisy", "varied", "gusts", "wash", "fan-wall"), 1)
}


def mix_of(name: str, episodes: int) -> dict[str, int]:
    """Return how many of ``episodes`` fly in each scenario of a mix, or in the one scenario."""
    parts = _MIXES.get(name, {name: 1})
    return {each: episodes * part // sum(parts.values()) for each, part in parts.items()}


class WindLesson:
    """A task in the wind: scaled observations, and the command that hindsight holds best.

    ``lqg`` flies the first round. An episode of a lesson is the first half of one of the task.
    """

    decisions, period, largest = 250, WIND_PERIOD, MAX_ACCELERATION

    def __init__(self, task: str) -> None:
        self._task, self._oracle = task, WindOracle()
        self.scale = np.array(TASKS[task].environment.scales, dtype=np.float32)
        self._models = []
        for A, B, _ in self._oracle.steps(self._oracle.vehicle):
            gains = preview(A, B, np.eye(len(A)), self._oracle.effort, AHEAD)
            self._models.append((A, B[:, 0], *gains))

    def environments(self, scenarios: dict[str, int]) -> list[TaskLanes]:
        """Return so many environments of each scenario."""
        kind = TASKS[self._task].environment
        return [TaskLanes(count, task=kind, scenario=name) for name, count in scenarios.items()]

    def begin(self, envs: TaskLanes, leads: bool) -> None:
        """Start an episode in each of ``envs``; ``leads``: ``lqg`` flies."""
        self._envs = envs
        self._commands: list[Array] = []
        self._states: list[list[Array]] = []  # of each axis (n, its states)
        self._laws = [make_controller("lqg", self._task) for _ in range(envs.num_envs * leads)]

    def look(self, observations: Frames, infos: dict[str, Any]) -> tuple[Frames, Any]:
        """Return scaled observations (n, 27), and the commands (n, 3) of ``lqg`` where it flies."""
        seen = observations.astype(np.float64)
        self._states.append(self._oracle.states(seen, infos | self._envs.truth()))
        self._commands.append(seen[:, LAST_ACTION:])
        wanted = [law(each) for law, each in zip(self._laws, observations, strict=False)]
        return observations / self.scale, np.array(wanted)

    def taught(self, kept: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Return what would have been best (decisions, n, 3), and what counts (decisions, n):
        decisions after which the vehicle was seen to fly on for ``AHEAD`` more.
        """
        best, given = [], np.array(self._commands[1:])
        for i, (A, B, gain, ahead) in enumerate(self._models):
            x = np.array([states[i] for states in self._states])
            came = x[1:] - x[:-1] @ A.T - given[..., i : i + 1] * B
            wanted = x[:-1] @ gain
            for k, share in enumerate(ahead):
                wanted[: len(came) - k] += came[k:] @ share
            best.append(-wanted)
        counts = np.zeros_like(kept[1:])
        counts[: 1 - AHEAD] = kept[AHEAD:]
        return np.clip(np.stack(best, axis=-1), -self.largest, self.largest), counts
