"""The base of all tasks: array functions over n worlds, for one environment or a vector."""

from typing import Any

import gymnasium as gym
import numpy as np

from ..runtime.arrays import Array, Picture, Single
from ..runtime.errors import InputError, unknown_name
from .closed_loop import ClosedLoop
from .definition import TaskDefinition
from .lanes.vector import TaskLanes
from .truth import true_motion
from .vector import JudgedStep, TaskVectorEnv

PLANTS: dict[str, type[TaskVectorEnv]] = {"mujoco": TaskVectorEnv, "lanes": TaskLanes}


class Task(TaskDefinition, gym.Env[Single, Single]):
    """The base class of tasks: a quadrotor whose agent commands the flight loop.

    A subclass overrides class attributes and up to five functions of arrays with a row for each
    world: ``start``, ``observe``, ``reward_terms``, ``is_lost`` and ``info``. ``s`` is a ``State``.
    Overrides hold in a single environment, in MuJoCo's vector and in lanes (a SIMD batch):

    ```python
    class Land(windwrench.envs.Task):
        decision_hz, action, episode_s = 25, "acceleration", 10.0

        def reward_terms(self, s):
            tracking = 1.0 / (1.0 + (s.distance / 0.1) ** 2)
            return {"tracking": tracking, "soft": -0.1 * s.velocity[:, 2] ** 2}

    gym.register("me/Land-v0", entry_point=Land, vector_entry_point=Land.vector)
    ```

    An episode is truncated after ``episode_s``.

    Args:
        scenario: a name, a YAML path, or a scenario of the task's kind.
        render_mode: ``"human"`` (needs a display), ``"rgb_array"`` or None.
        vehicle: the declared vehicle of filter and flight loop: preset, YAML path or ``Vehicle``.
        effects: undeclared effects of the true vehicle.
        truth: the true vehicle, before ``effects``; default: as declared.
        settings: motor lag, unmodelled disturbance, delays and losses of the plant.
        estimator: ``"ukf"``, or the faster ``"constant-gain"``: the filter's converged gain.
        normalize: whether observations are divided by fixed scales, and velocities and
            accelerations by the largest.
        width: pixels of a picture.
        height: likewise.
        stages: a user's own ``windwrench.envs.Stage``, in the pipeline of a tick.
        action: one of ``windwrench.envs.ACTIONS``; see ``make_action``.
        observation: one of ``windwrench.envs.OBSERVATIONS``; see ``envs.observations.parts``.
        decision_hz: decisions a second, Hz: 200 over a whole number.
        episode_s: s, until an episode is truncated.
        winds: in place of the scenario's: any objects with ``velocity(points, time)``.
        model_in_loop: whether the flight loop counters the effects that ``vehicle`` declares.
        gains: the flight loop's.
        randomise: ``"vehicle"``: the true vehicle is drawn anew each episode, by the section
            ``uncertainty`` of its file; filter, flight loop and laws keep the declared one.

    Raises:
        InputError: an argument names nothing known.
    """

    _many: TaskVectorEnv | None = None
    foresight = 0  # decisions ahead in ``info``, for the oracle

    @classmethod
    def vector(cls, num_envs: int = 1, plant: str = "mujoco", **given: Any) -> TaskVectorEnv:
        """Return ``num_envs`` environments side by side.

        Args:
            num_envs: number of environments.
            plant: ``"mujoco"``, the reference (``TaskVectorEnv``), or ``"lanes"``, the same flight
                in the lanes of a vector unit (``TaskLanes``): several times as fast.
            **given: arguments of these, and of this class.

        Raises:
            InputError: an unknown plant, a class with its own ``step`` or ``reset``, never called
                side by side, or a refusal of the class.
        """
        for name in ("step", "reset"):
            if getattr(cls, name) is not getattr(Task, name):
                raise InputError(
                    f"{cls.__name__}: {name} of its own is not called side by side; expected "
                    "start, observe, reward_terms, is_lost or info, or vector modes sync and async"
                )
        if plant not in PLANTS:
            raise unknown_name("plant", str(plant), PLANTS, f"{cls.name}: plant")
        if "precision" in given and plant == "mujoco":
            raise InputError(f"{cls.name}: precision is of plant='lanes'; MuJoCo's is double")
        return PLANTS[plant](num_envs, task=cls, **given)

    @property
    def many(self) -> TaskVectorEnv:
        """The vector of one environment."""
        if self._many is None:
            self._many = TaskVectorEnv(1, task=self)
        return self._many

    @property
    def loop(self) -> ClosedLoop:
        """The vehicle in flight."""
        return self.many.loops[0]

    @property
    def path(self) -> Array:
        """Path (m, 2) m of the fan's y and height, a row a tick."""
        y, height = self.many.episodes[2:4]
        return np.stack(np.broadcast_arrays(y[0], height[0]), axis=1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Single, dict[str, Any]]:
        """Start an episode; the same seed gives the same episode, bit for bit.

        Raises:
            InputError: any ``options``.
        """
        if options:
            raise InputError(
                f"{self.name}: reset: unknown option(s) {', '.join(map(repr, options))}; expected "
                f"none: scenario and all else are arguments of the environment"
            )
        super().reset(seed=seed)
        judged = self.many.begin(self.np_random)
        return judged.observations[0].copy(), self._info_with_truth(judged)

    def step(self, action: Single) -> tuple[Single, float, bool, bool, dict[str, Any]]:
        """Fly a decision with an action of ``action_space``, clipped to its range.

        Raises:
            InputError: the action has another shape or is not finite, or there was no reset.
        """
        many = self.many
        judged = many.go_on(action, self.np_random)
        seen, lost, over = judged.observations[0].copy(), bool(judged.lost[0]), many.truncated[0]
        return seen, float(judged.rewards[0]), lost, bool(over), self._info_with_truth(judged)

    def _info_with_truth(self, judged: JudgedStep) -> dict[str, Any]:
        """Return ``info``, with the truth for a controller with foresight."""
        info = {}
        for name, values in judged.values.items():
            rows = np.asarray(values)
            info[name] = rows[0].copy() if rows.ndim > 1 else rows.item()
        return info | self._truth() if self.foresight else info

    def _truth(self) -> dict[str, Any]:
        """Return the oracle's knowledge beyond ``info``: the true motion and the integral of the
        flight loop, world axes, SI units. A task adds wind or fan to come.
        """
        record, world = self.loop.record[0], self.loop.world
        speeds, integral = record["plant"]["speeds"], record["flight"]["sum"]
        return true_motion(self.vehicle, world.qpos, world.qvel, speeds, integral)

    def render(self) -> Picture | None:
        """Return a picture (height, width, 3) of vehicle, wind and wrench, or show it in a window.

        Raises:
            InputError: not reset yet, or this machine cannot draw.
        """
        picture: Picture | None = self.many.render()[0]
        return picture

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._many is not None:
            self._many.close_extras()
