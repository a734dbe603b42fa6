"""The commands of a law with knowledge of the future: the teacher of the wind tasks.

The model of the flight loop and its vehicle is linear (``controllers.axis_models``). A flight's
difference to the model, from one decision to the next, is a disturbance of any origin: wind, a
vehicle other than the declared one, errors of the flight loop's estimate, a turning reference.
After a flight all disturbances are known. The linear-quadratic regulator with preview
(``controllers.preview``) gives the best command of each decision for all later disturbances. Delays
of commands or poses enter the model's motors; otherwise the effect of a late command would count as
a disturbance, too. The mean of the best command, given the observations so far, is the best causal
command (certainty equivalence). A network fitted to the best commands learns this mean.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from ..controllers import make_controller
from ..controllers.axis_models import MOTOR_LAG, axis_models
from ..controllers.preview import WindOracle, preview
from ..controllers.wind_observation import LAST_ACTION, MAX_ACCELERATION, WIND_PERIOD
from ..envs.lanes.vector import TaskLanes
from ..envs.observations import as_numbers
from ..envs.wind_scenarios import WIND_SCENARIOS, WindVariation
from ..evaluation.tasks import TASKS
from ..runtime.arrays import Array, Mask, Single

AHEAD = 14  # decisions, of which a command knows the disturbances
LATE = "late"
_LATE = replace(
    WIND_SCENARIOS["varied"],
    summary="varied, with delays and lost poses drawn anew",
    variation=WindVariation(
        actuator_delay=(0.0, 0.02),
        pose_delay=(0.0, 0.02),
        imu_delay=(0.0, 0.02),
        dropout=(0.0, 0.1),
    ),
)
MIX, FAN_MIX = "wide-late", "wide"  # tasks in the wind, and FanTracking
# parts of the episodes in each scenario
MIXES = {
    MIX: {"base": 2, "turbulent": 3, "noisy": 5, LATE: 2}
    | dict.fromkeys(("varied", "gusts", "wash", "fan-wall"), 1),
    FAN_MIX: {"base": 4, "fast": 3, "varied": 4, "far": 4}
    | dict.fromkeys(("static", "noisy", "gusty", "slow-filter"), 1),
}


def mix_of(name: str, episodes: int) -> dict[str, int]:
    """Return how many of ``episodes`` fly in each scenario of a mix, at least one, or in the one
    scenario.
    """
    parts = MIXES.get(name, {name: 1})
    return {each: max(1, episodes * n // sum(parts.values())) for each, n in parts.items()}


def lanes_of(
    task: str, scenario: str, episodes: int, observation: str | None = None
) -> list[TaskLanes]:
    """Return environments of a task for so many episodes in a scenario, or in one of ``MIXES``;
    ``observation``: one of ``OBSERVATIONS`` in place of the task's own.
    """
    kind = TASKS[task].environment
    return [
        TaskLanes(
            count, task=kind, scenario=_LATE if name == LATE else name, observation=observation
        )
        for name, count in mix_of(scenario, episodes).items()
    ]


@lru_cache(maxsize=32)
def _models(oracle: WindOracle, late: float) -> list[tuple[Array, ...]]:
    """Return for each axis A (n, n) and B (n,) of a decision with commands ``late`` by so many s,
    and the gains of ``preview``.
    """
    models: list[tuple[Array, ...]] = []
    for axis in axis_models(oracle.vehicle, lag=MOTOR_LAG + late):
        A, B, _ = axis.held(WIND_PERIOD)
        models.append((A, B[:, 0], *preview(A, B, np.eye(len(A)), oracle.effort, AHEAD)))
    return models


class WindLesson:
    """A task in the wind: scaled observations, and the best command in hindsight.

    The environment has any observation; the teacher and ``lqg`` get the task's. ``lqg`` flies the
    first round. An episode of a lesson is the first half of the task's.
    """

    decisions = 250
    period = WIND_PERIOD
    largest = MAX_ACCELERATION

    def __init__(self, task: str, limit: float = 1.5) -> None:
        """Take a task.

        Args:
            task: WindHover or WindTrajectory.
            limit: largest taught command, in largest actions. The mean of limited commands is not
                the limited mean. Noise brings many commands beyond 1 (40 % along x and y of ``lqg``
                in WindHover, 7 % on ``base``). Yet a few far beyond would rule the fit. Tried with
                one seed, RMSE against ``lqg`` on 96 validation episodes at 1, 1.5 and 4:
                WindHover's ``noisy`` -7, -10 and -8 %, WindTrajectory's ``noisy`` -11, -12 and -12
                % and ``turbulent`` -2, 0 and 0 %; ``base`` the same within 1 %.
        """
        self._task, self._oracle, self._limit = task, WindOracle(), limit * self.largest

    def begin(self, envs: TaskLanes, leads: bool) -> None:
        """Start an episode in each of ``envs``; ``leads``: ``lqg`` flies."""
        self._envs, self._late = envs, envs.late()
        self._scale = as_numbers(envs.task.bounds()[1] or 1.0)
        self._commands: list[Array] = []
        self._states: list[list[Array]] = []  # for each axis (n, its states)
        self._laws = [make_controller("lqg", self._task) for _ in range(envs.num_envs * leads)]

    def look(self, observations: Single, infos: dict[str, Any]) -> tuple[Single, Any]:
        """Return scaled observations (n, k), and the commands (n, 3) of ``lqg`` in flight."""
        raw = as_numbers(self._envs.task.observe(self._envs.state))
        seen = raw.astype(np.float64)
        self._states.append(self._oracle.states(seen, infos | self._envs.truth()))
        self._commands.append(seen[:, LAST_ACTION:])
        wanted = [law(each) for law, each in zip(self._laws, raw, strict=False)]
        return observations / self._scale, np.array(wanted)

    def taught(self, in_flight: Mask) -> tuple[Array, Mask]:
        """Return the best commands (decisions, n, 3), and weights (decisions, n): the vehicle flew
        on for at least ``AHEAD`` further decisions.
        """
        commands = np.array(self._commands[1:])
        best = np.empty_like(commands)
        for late in np.unique(self._late):
            some = self._late == late
            for i, (A, B, gain, ahead) in enumerate(_models(self._oracle, late)):
                x = np.array([states[i][some] for states in self._states])
                came = x[1:] - x[:-1] @ A.T - commands[:, some, i, None] * B
                wanted = x[:-1] @ gain
                for k, share in enumerate(ahead):
                    wanted[: len(came) - k] += came[k:] @ share
                best[:, some, i] = -wanted
        counts = np.zeros_like(in_flight[1:])
        counts[: 1 - AHEAD] = in_flight[AHEAD:]
        return np.clip(best, -self._limit, self._limit), counts
