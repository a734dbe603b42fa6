"""The base of all tasks: one environment around one flight loop.

A task states its spaces, its scenarios and its decision as data. Its ``hover`` draws an episode and
hovers at the start; its ``look``, compiled, writes observation, reward and ``info``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from ..controllers.briefing import Briefing
from ..dynamics.effects import check_setting
from ..dynamics.motion import Array
from ..dynamics.rotation import quaternion_to_matrix
from ..dynamics.vehicle import EffectSetting, Mocap, Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..estimator.tuning import UKFTuning
from ..runtime.compiled import Record, compiled, specialised
from ..runtime.errors import InputError, unknown_name
from .closed_loop import ESTIMATORS, REFERENCE_SIZE, ClosedLoop, Stage, is_healthy
from .display import modes_shown, need_display
from .fan import Fan
from .observing import Episodes, Motion, View
from .plant import TICK, PlantSettings
from .scenarios import Drawn, find_scenario

Frame = NDArray[np.float32]

# entries of ``info`` that all tasks have
COMMON_VALUES: list[tuple[Any, ...]] = [
    ("reward_tracking", "f8"),
    ("reward_change", "f8"),
    ("force", "f8", (3,)),
    ("torque", "f8", (3,)),
    ("time", "f8"),
    ("lost", "?"),
]
_ONE, _ALL = np.ones(1, dtype=np.bool_), slice(None)
_NO_REFERENCE = np.zeros((0, REFERENCE_SIZE))
EPISODE_SECONDS = 20.0
SETTLE_TICKS = 300  # the filter settles before an episode starts
LOST_OFFSET = 2.5  # m, of the vehicle from where it should be
UPRIGHT = 0.34  # cosine of 70 degrees
_NUMBERS = {1: "one finite number", 2: "two finite numbers", 3: "three finite numbers"}


@compiled
def keep_within(frame: Frame, limits: Array) -> None:
    """Limit the numbers of a frame (n,) to ``limits`` (n,) on either side; 0 where not finite."""
    for i in range(len(frame)):
        seen = frame[i]
        frame[i] = min(max(seen, -limits[i]), limits[i]) if math.isfinite(seen) else 0.0


@compiled
def is_flying(state: Array, position: Array, velocity: Array) -> bool:
    """Return whether a vehicle still flies: finite, no faster than one can be, and upright."""
    tilted = position[4] * position[4] + position[5] * position[5]
    return is_healthy(state, velocity) and 1.0 - 2.0 * tilted >= UPRIGHT


@compiled
def vehicle_of(motion: Motion, n: int | np.integer[Any]) -> tuple[Array, Array, Array, Array]:
    """Return pose (7,), velocity (6,), true wrench (6,) and a copy of the estimate (20,) of vehicle
    ``n``.
    """
    lanes = motion.state.shape[2]
    b, lane = n // lanes, n % lanes
    estimate = motion.state[b, :, lane].copy()
    return (
        motion.position[b, :, lane],
        motion.velocity[b, :, lane],
        motion.wrench[b, :, lane],
        estimate,
    )


@compiled
def note(
    value: Record,
    episodes: Episodes,
    n: int | np.integer[Any],
    wrench: Array,
    square: float,
    change: float,
) -> None:
    """Write the common values of episode ``n``: time, true wrench (6,), and rewards.

    Args:
        value: row of the task's table.
        episodes: all episodes.
        n: an episode.
        wrench: N and Nm, world.
        square: of the error over the task's tracking width.
        change: reward for the change of the command.
    """
    value.time = episodes.ticks[n] * TICK
    for i in range(3):
        value.force[i], value.torque[i] = wrench[i], wrench[3 + i]
    value.reward_tracking = 1.0 / (1.0 + square)
    value.reward_change = change


def true_motion(
    vehicle: Vehicle, pose: Array, velocity: Array, speeds: Array, integral: Array
) -> dict[str, Any]:
    """Return a vehicle's motion as an oracle knows it.

    Args:
        vehicle: as it is declared.
        pose: (7,) position m and quaternion.
        velocity: (6,) m/s, world, and rad/s, body.
        speeds: (4,) rad/s, of the rotors.
        integral: (3,) of the flight loop.
    """
    R = np.empty((3, 3))
    quaternion_to_matrix(pose[3:7], R)
    thrust, *torques = (vehicle.mixing @ speeds**2).tolist()
    return {
        "velocity": velocity[:3].copy(),
        "rate": R @ velocity[3:6],
        "angular_acceleration": R @ np.linalg.solve(vehicle.inertia, torques),
        "up": R[:, 2].copy(),
        "lift": thrust * R[2, 2] / vehicle.mass - vehicle.gravity,
        "integral": integral.copy(),
    }


class Task(gym.Env[Frame, Frame], ABC):
    """A quadrotor in closed loop, whose agent commands the flight loop.

    Args:
        scenario: a name, a YAML path, or a scenario of the task's kind.
        render_mode: ``"human"`` (needs a display), ``"rgb_array"`` or None.
        vehicle: as filter and flight loop know it: preset, YAML path or ``Vehicle``.
        effects: undeclared ones of the true vehicle.
        truth: the true vehicle, before ``effects``; default: as declared.
        settings: motor lag, unmodelled disturbance, delays and losses of the plant.
        estimator: ``"ukf"``, or ``"constant-gain"``: the filter's converged gain, which is faster.
        normalize: whether observations, and actions in m/s2, are divided by fixed scales; the id
            ``-v1`` says True where nothing is said.
        width: pixels of a picture.
        height: likewise.
        stages: a user's own ``windwrench.envs.Stage``, in the pipeline of a tick.

    Raises:
        InputError: an argument names nothing known.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 13}  # noqa: RUF012
    name: ClassVar[str]
    scenarios: ClassVar[dict[str, Any]]
    decision_ticks: ClassVar[int]
    action_size: ClassVar[int]
    largest_action: ClassVar[float] = 1.0
    action_unit: ClassVar[str] = "m/s"
    label: ClassVar[str] = "fan_motion"  # entry of ``info`` with the name of the episode's draw
    accelerates: ClassVar[bool] = False  # whether a command is an acceleration, not a velocity
    draws: ClassVar[int] = 1  # at most, until an episode begins with the vehicle not lost
    # writes frames (n, size) and a table (n,) of ``values`` of the chosen episodes
    look: ClassVar[Callable[..., None]]
    fan: Fan
    values: ClassVar[np.dtype]  # entries of ``info`` beside ``label``
    limits: ClassVar[Sequence[float]]  # largest sizes of the frame's numbers
    scales: ClassVar[Sequence[float]]  # divisors of ``normalize``

    def __init__(
        self,
        scenario: Any = "base",
        render_mode: str | None = None,
        vehicle: str | Vehicle = "ardrone2",
        effects: Sequence[EffectSetting] = (),
        truth: str | Vehicle | None = None,
        settings: PlantSettings | None = None,
        estimator: str = "ukf",
        normalize: bool = False,
        width: int = 640,
        height: int = 480,
        stages: Sequence[Stage] = (),
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"{self.name}: render_mode must be human, rgb_array or None, got {render_mode!r}"
            )
        if render_mode == "human":
            need_display()
        if not isinstance(normalize, bool | np.bool_):
            raise InputError(f"{self.name}: normalize must be True or False, got {normalize!r}")
        if estimator not in ESTIMATORS:
            raise unknown_name("estimator", estimator, ESTIMATORS)
        if isinstance(scenario, str):
            scenario = find_scenario(scenario, self.scenarios)
        self.scenario = scenario
        self.vehicle = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
        # an amended vehicle must not bring its effects into the world a second time
        true = self.vehicle if truth is None else truth
        self.truth = true if isinstance(true, Vehicle) else load_vehicle(true)
        self.effects = tuple(check_setting(e, f"{self.name}: effects") for e in effects)
        self.settings, self.estimator, self.normalize = settings, estimator, bool(normalize)
        self.stages = tuple(stages)
        self.render_mode, self.width, self.height = render_mode, width, height
        self.metadata = {**self.metadata, "render_modes": modes_shown(self.metadata)}
        largest = 1.0 if normalize else self.largest_action
        self.action_scale = self.largest_action / largest
        self.action_space = gym.spaces.Box(-largest, largest, (self.action_size,), np.float32)
        self.viewer: Any = None
        self._loop: ClosedLoop | None = None
        self.drawn: dict[str, float] = {}  # factors of an episode, where the scenario varies
        self._in_flight = False
        self.command: Array = np.zeros(self.action_size)  # the last one, in SI units
        self.foresight = 0  # decisions ahead in ``info``, for the oracle
        self._see_by(View("wrench", self.normalize, self.limits, self.scales))
        # the fan's path (m, 2) m, its distance in m, and the episode's name
        self.path, self.distance = np.zeros((1, 2)), 0.0
        self.drawn_label = ""
        self._frames = np.zeros((1, len(self.limits)), dtype=np.float32)
        self._table = np.zeros(1, dtype=self.values)
        self._lay_episode()
        self._compile()

    @classmethod
    def decisions(cls) -> int:
        """Return the number of decisions of an episode."""
        return round(EPISODE_SECONDS / (TICK * cls.decision_ticks))

    def __getstate__(self) -> dict[str, Any]:
        """Return all but the window and compiled code, for a copy in the middle of an episode."""
        return self.__dict__ | {"viewer": None, "_look": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._compile()

    def _compile(self) -> None:
        seen = self._episodes, Motion.zeros(1), self._frames, self._table
        self._look = specialised(type(self).look, _ONE, *seen)

    def _see_by(self, view: View) -> None:
        """Take a view for the agent's observation."""
        self.view, bound = view, view.bound()
        self.observation_space = gym.spaces.Box(-bound, bound, bound.shape, np.float32)

    def _lay_episode(self) -> None:
        """Look at the episode just drawn."""
        self._episodes = Episodes.alike(
            1, self.action_size, self.path, self.reference, self.distance
        )

    def _look_around(self) -> None:
        """Write the present frame and values."""
        loop, episodes = self.loop, self._episodes
        episodes.ticks[0], episodes.broken[0] = loop.ticks, loop.was_reset
        self._look(_ONE, episodes, loop.shown, self._frames, self._table)

    @property
    def loop(self) -> ClosedLoop:
        """The vehicle in flight.

        Raises:
            InputError: there has been no reset.
        """
        if self._loop is None:
            raise InputError(f"{self.name}: call reset before step")
        return self._loop

    @property
    def reference(self) -> Array:
        """Reference (n, REFERENCE_SIZE) of the flight loop, a row a tick; n = 0: a set point."""
        return _NO_REFERENCE if self._loop is None else self._loop.reference

    @property
    def declared(self) -> Vehicle:
        """The declared vehicle, with the scenario's measurement of the pose."""
        scenario = self.scenario
        mocap = Mocap(1.0 / TICK, scenario.sigma_position, scenario.sigma_attitude)
        return replace(self.vehicle, mocap=mocap)

    @property
    def tuning(self) -> UKFTuning:
        """The filter's tuning."""
        return UKFTuning.for_vehicle(self.declared, TICK, self.scenario.rise_time)

    def briefing(self) -> Briefing:
        """Return a designed controller's knowledge before its flight: no draws of an episode, no
        undeclared effects.
        """
        return Briefing(self.vehicle)

    def make_loop(self, vehicle: Vehicle, fan: Fan, **given: Any) -> ClosedLoop:
        """Return the closed loop of a true vehicle and the undeclared effects; the filter knows the
        declared vehicle.
        """
        declared = self.declared
        drawn: dict[str, Any] = {
            n: v for n, v in self.drawn.items() if n in Drawn.__dataclass_fields__
        }
        return ClosedLoop(
            declared,
            replace(vehicle, mocap=declared.mocap, effects=(*vehicle.effects, *self.effects)),
            self.tuning,
            fan,
            replace(self.settings or PlantSettings.for_vehicle(self.truth), **drawn),
            drawn=self.render_mode is not None,
            estimator=self.estimator,
            stages=self.stages,
            **given,
        )

    def draw_loop(self) -> None:
        """Make the closed loop of an episode, drawn where the scenario varies."""
        if not self.scenario.varied:
            self.drawn = {}
            self._loop = self._loop or self.make_loop(self.truth, self.fan)
            return
        fan, truth, drawn = self.fan, self.truth, self.scenario.variation.draw(self.np_random)
        self.drawn = drawn
        fan = replace(
            fan,
            speed=fan.speed * drawn.get("fan_speed", 1.0),
            rotor_drag=fan.rotor_drag * drawn["rotor_drag"],
            hull_area=fan.hull_area * drawn["hull_area"],
        )
        mass, inertia = truth.mass * drawn["mass"], truth.inertia * drawn["inertia"]
        self._loop = self.make_loop(replace(truth, mass=mass, inertia=inertia), fan)

    def take_loop(self, loop: ClosedLoop, drawn: dict[str, float]) -> None:
        """Go on with an episode's closed loop and its draws."""
        self._loop, self.drawn = loop, drawn

    def _begin(self) -> None:
        """Draw an episode, hover at its start, and let the filter settle. Draw anew where the winds
        carry the vehicle off before the agent's first decision.
        """
        self.draw_loop()
        for _ in range(self.draws):
            self.hover()
            self.loop.settle(self.np_random, SETTLE_TICKS, self.path[:1])
            self._lay_episode()
            self._look_around()
            if not self._table["lost"][0]:
                return
        self.refuse_draws()

    def refuse_draws(self) -> None:
        """Refuse winds in which the vehicle was lost at the start of each of ``draws`` episodes."""
        if self.draws > 1:
            raise InputError(
                f"{self.name}: the vehicle is lost before the episode begins in {self.draws} draws "
                f"of these winds; expected winds that its flight loop can hold for 1.5 s"
            )

    @abstractmethod
    def hover(self) -> None:
        """Draw an episode, and place the vehicle in hover at its start."""

    def _get_obs(self) -> Frame:
        """Return the agent's observation."""
        seen: Frame = self.view.of(_ALL, self._frames, self.loop.shown.state[..., 0])[0]
        return seen

    def _get_info(self) -> dict[str, Any]:
        """Return the terms of the reward, the truth behind the observation, and whether the vehicle
        is lost.
        """
        values = ((name, self._table[name][0]) for name in self.values.names or ())
        info = {name: value.copy() if value.ndim else value.item() for name, value in values}
        info["observation"] = self._frames[0].copy()
        info["command"] = self._episodes.commands[0].copy()
        return info | {self.label: self.drawn_label}

    def _truth(self) -> dict[str, Any]:
        """Return the oracle's knowledge beyond ``info``: the true motion and the integral of the
        flight loop, world axes, SI units. A task adds wind or fan to come.
        """
        record, world = self.loop.record[0], self.loop.world
        speeds, integral = record["plant"]["speeds"], record["flight"]["sum"]
        return true_motion(self.vehicle, world.qpos, world.qvel, speeds, integral)

    def _told(self) -> dict[str, Any]:
        """Return ``info``, with the truth for a controller with foresight."""
        info = self._get_info()
        return info | self._truth() if self.foresight else info

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Frame, dict[str, Any]]:
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
        self._in_flight = False
        self._begin()
        self._in_flight = True
        self.command = np.zeros(self.action_size)
        self.view.restart(_ALL, self.loop.shown.state[..., 0])
        if self.render_mode == "human":
            self.render()
        # steps alone decide rewards and losses
        first = {"reward_tracking": 0.0, "reward_change": 0.0, "lost": False}
        return self._get_obs(), self._told() | first

    def step(self, action: Frame) -> tuple[Frame, float, bool, bool, dict[str, Any]]:
        """Fly a decision with an action of ``action_space``, clipped to its range.

        Raises:
            InputError: the action has another shape or is not finite, or there was no reset.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != (self.action_size,) or not np.isfinite(given).all():
            raise InputError(
                f"{self.name}: action must be {_NUMBERS[self.action_size]} in "
                f"{self.unit_of_actions}, shape ({self.action_size},), got {action!r}"
            )
        if not self._in_flight:
            raise InputError(f"{self.name}: call reset before step")
        last, largest = self.command, self.largest_action
        self.command = np.clip(self.action_scale * given, -largest, largest)
        self._episodes.commands[0], self._episodes.changes[0] = self.command, self.command - last
        self.fly()
        self._look_around()
        if self.render_mode == "human":
            self.render()
        info = self._told()
        reward = info["reward_tracking"] + info["reward_change"]
        return self._get_obs(), reward, info["lost"], False, info

    @property
    def unit_of_actions(self) -> str:
        """Unit of an action of ``action_space``."""
        return "units of the largest" if self.action_scale != 1.0 else self.action_unit

    def fly(self) -> None:
        """Fly a decision at ``command``, with the normals of ``np_random.standard_normal``."""
        loop = self.loop
        normals = self.np_random.standard_normal((self.decision_ticks, loop.noise_size))
        if self.accelerates:
            loop.action[:] = self.command
        else:
            loop.setpoint[4 : 4 + self.action_size] = self.command
        loop.run(normals, self.path[min(loop.ticks, len(self.path) - 1) :])

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (height, width, 3) of vehicle, wind and wrench, or show it in a window.

        Raises:
            InputError: not reset yet, or this machine cannot draw.
        """
        if self.render_mode is None or not self._in_flight:
            raise InputError(
                f"{self.name}: render needs a render_mode ('human' or 'rgb_array') and a reset "
                f"before it"
            )
        if self.viewer is None:
            from .drawing import Viewer

            self.viewer = Viewer(self.render_mode, self.width, self.height)
        picture: NDArray[np.uint8] | None = self.viewer.draw(self.loop)
        return picture

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.viewer is not None:
            self.viewer.close()
            self.viewer = None
