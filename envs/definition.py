"""A task's definition: arguments and spaces, and the functions of the state of n worlds."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike

from ..controllers.briefing import Briefing
from ..controllers.flight import FlightGains
from ..dynamics.effects import check_setting
from ..dynamics.vehicle import EffectSetting, Mocap, Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..estimator.tuning import UKFTuning
from ..runtime.arrays import Array, Mask, Single
from ..runtime.errors import InputError, unknown_name
from .actions import UNITS, make_action
from .closed_loop import ESTIMATORS, ClosedLoop, Stage
from .display import modes_shown, need_display
from .fan import Fan
from .observations import FELT, as_numbers, bounds, parts
from .plant import TICK, PlantSettings
from .references import along
from .scenarios import Drawn, draw_vehicle, find_scenario
from .state import REFERENCE_SIZE, Episodes, Start, State
from .wind import Sum, Wind
from .wind_scenarios import HEIGHT, START, WIND_SCENARIOS, draw_winds

EPISODE_SECONDS = 20.0
LOST_OFFSET = 2.5  # m, of the vehicle from where it should be
TRACKING_WIDTH = 0.1  # m, error at which the tracking reward is a half
# m/s2, standard deviation of the accelerometer's noise a tick, and of its bias
ACCELEROMETER = (0.15, 0.05)


class TaskDefinition:
    """Arguments and functions of a task, without its flight: see ``windwrench.envs.Task``."""

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 25}  # noqa: RUF012
    name: ClassVar[str] = "Task"
    scenarios: ClassVar[Mapping[str, Any]] = WIND_SCENARIOS
    vehicle: Any = "ardrone2"  # preset, YAML path or ``Vehicle``
    action: str = "acceleration"
    observation: str = "wrench"
    decision_hz: float = 25.0
    episode_s: float = EPISODE_SECONDS
    normalize: bool = True
    largest_action: Any = None  # m/s or m/s2; None: as of ``make_action``
    axes: ClassVar[tuple[int, ...]] = (0, 1, 2)  # commanded, for velocities and accelerations
    follows: ClassVar[bool] = True  # whether accelerations are beside a flight to the reference
    model_in_loop: bool = True
    randomise: str | None = None  # "vehicle": the true vehicle's numbers are drawn each episode
    accelerometer: ClassVar[tuple[float, float] | None] = ACCELEROMETER
    label: ClassVar[str] = "trajectory"  # entry of ``info`` with the name of the episode's draw
    draws: ClassVar[int] = 20  # at most, until an episode begins with the vehicle not lost
    mixes: bool = False  # whether episodes differ in what lanes share
    _made: ClosedLoop | None = None  # last of all loops, whose MuJoCo model the next one may take
    limits: Any = None  # (k,) largest sizes of the observation's numbers
    scales: Any = None  # (k,) their divisors, with ``normalize``
    fan: Fan
    action_space: gym.Space[Single]
    observation_space: gym.Space[Single]

    def __init__(
        self,
        scenario: Any = "base",
        render_mode: str | None = None,
        vehicle: str | Vehicle | None = None,
        effects: Sequence[EffectSetting] = (),
        truth: str | Vehicle | None = None,
        settings: PlantSettings | None = None,
        estimator: str = "ukf",
        normalize: bool | None = None,
        width: int = 640,
        height: int = 480,
        stages: Sequence[Stage] = (),
        *,
        action: str | None = None,
        observation: str | None = None,
        decision_hz: float | None = None,
        episode_s: float | None = None,
        winds: Sequence[Wind] | None = None,
        model_in_loop: bool | None = None,
        gains: FlightGains | None = None,
        randomise: str | None = None,
    ) -> None:
        name = self.name
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"{name}: render_mode must be human, rgb_array or None, got {render_mode!r}"
            )
        if render_mode == "human":
            need_display()
        if not isinstance(normalize, bool | np.bool_ | None):
            raise InputError(f"{name}: normalize must be True or False, got {normalize!r}")
        if estimator not in ESTIMATORS:
            raise unknown_name("estimator", estimator, ESTIMATORS)
        if isinstance(scenario, str):
            scenario = find_scenario(scenario, self.scenarios)
        self.scenario = scenario
        declared = self.vehicle if vehicle is None else vehicle
        self.vehicle = declared if isinstance(declared, Vehicle) else load_vehicle(declared)
        # an amended vehicle must not bring its effects into the world a second time
        true = self.vehicle if truth is None else truth
        self.truth = true if isinstance(true, Vehicle) else load_vehicle(true)
        self.effects = tuple(check_setting(e, f"{name}: effects") for e in effects)
        self.settings, self.estimator, self.stages = settings, estimator, tuple(stages)
        self.render_mode, self.width, self.height = render_mode, width, height
        fields = {
            "normalize": normalize,
            "action": action,
            "decision_hz": decision_hz,
            "episode_s": episode_s,
            "model_in_loop": model_in_loop,
            "randomise": randomise,
        }
        for field, value in fields.items():
            if value is not None:
                setattr(self, field, value)
        stated = any(vars(self.truth.uncertainty).values())
        if self.randomise and not (stated and self.randomise == "vehicle"):
            raise InputError(
                f"{name}: randomise: expected 'vehicle', and an uncertainty in the vehicle's file "
                f"such as {{thrust: 0.03}}; got {self.randomise!r} and {self.truth.name}"
            )
        sees = self._source("observe")
        if observation is None and type(self).observation != sees.observation:
            observation = type(self).observation
        elif observation is None and sees.observation == "own" and self.action != sees.action:
            observation = "wrench"  # the task's own holds its own action
        self.chosen = None if observation == "own" else observation
        self.observation = self.chosen or type(self).observation
        self.winds = None if winds is None else Sum(*winds, where=f"{name}: winds").winds
        self.gains = gains
        self.fan = Fan(speed=0.0, height=HEIGHT).sized(self.truth)
        self.drawn: dict[str, float] = {}  # factors of an episode, where the scenario varies
        self.decision_ticks = _ticks(name, self.decision_hz)
        self.max_decisions = round(self.episode_s / (TICK * self.decision_ticks))
        fps = int(1.0 / (TICK * self.decision_ticks) + 0.5)
        shown = {"render_modes": modes_shown(self.metadata), "render_fps": fps}
        self.metadata = {**self.metadata, **shown}
        self._make_spaces()

    def _make_spaces(self) -> None:
        """Make the spaces of actions and observations."""
        largest = (
            self.largest_action if self.action == self._source("largest_action").action else None
        )
        self.flown = make_action(
            self.action, self.vehicle, self.axes, self.follows, largest, self.gains
        )
        self.action_size = self.flown.size
        # in SI units where a velocity or an acceleration is not normalised
        in_si = not self.normalize and self.action in UNITS
        self.action_unit = UNITS[self.action] if in_si else "units of the largest"
        self.action_scale = float(self.flown.above[0]) if in_si else 1.0
        most = self.action_scale
        self.action_space = gym.spaces.Box(-most, most, (self.action_size,), np.float32)
        blank = State(Episodes.zeros(1, self.action_size), [np.random.default_rng(0)])
        blank.rows[:, [3, 22]] = 1.0  # quaternions of no turn
        with np.errstate(all="ignore"):
            size = np.shape(self.see(blank))[1]
        limits, scales = self.bounds()
        largest_sizes = as_numbers([np.inf] * size if limits is None else limits)
        divisors = as_numbers([1.0] * size if scales is None or not self.normalize else scales)
        if largest_sizes.shape != (size,) or divisors.shape != (size,):
            raise InputError(
                f"{self.name}: limits and scales must be {size} numbers, as observe returns; got "
                f"{len(largest_sizes)} and {len(divisors)}"
            )
        self.kept, self.divisors, bound = largest_sizes, divisors, largest_sizes / divisors
        self.observation_space = gym.spaces.Box(-bound, bound, (size,), np.float32)

    def bounds(self) -> tuple[Sequence[float] | None, Sequence[float] | None]:
        """Return largest sizes and scales of the observation's numbers; None: any, and 1."""
        if self.chosen is None:
            sees, states = self._source("observe"), self._source("limits")
            if sees is not states and issubclass(sees, states):  # limits of another observation
                return None, None
            if self.limits is not None or sees is not TaskDefinition:
                return self.limits, self.scales
        return bounds(self.observation, self.vehicle, self.action_size)

    def _source(self, name: str) -> Any:
        """Return the class that states an attribute."""
        return next(each for each in type(self).__mro__ if name in vars(each))

    def see(self, s: State) -> ArrayLike:
        """Return the agent's observation (n, k) in SI units: from ``observe``, or as chosen by the
        argument ``observation``.
        """
        if self.chosen is None:
            return self.observe(s)
        return np.concatenate(parts(self.chosen, s), axis=1)

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        if cls.name == "Task":  # a task of one's own is called as its class
            cls.name = cls.__name__

    @classmethod
    def decisions(cls) -> int:
        """Return the number of decisions of an episode with the class's own ``decision_hz``."""
        return round(cls.episode_s * cls.decision_hz)

    # ---- the functions of a task -----------------------------------------------------------

    def start(self, rng: np.random.Generator, n: int) -> Start | tuple[Any, ...]:
        """Return the starts of n episodes, drawn from ``rng``: a ``Start``, or its parts in order.

        Each world has its own generator, so n is 1 in flight, and an episode depends on its seed
        alone. Here: hover at one point in the scenario's winds.
        """
        poses = np.tile([*START, np.pi], (n, 1))
        return Start(poses, winds=[self.draw_winds(rng) for _ in range(n)])

    def observe(self, s: State) -> ArrayLike:
        """Return the observations (n, k) in SI units; here those of the class's ``observation``.

        Numbers are limited to ``limits`` (k,), 0 where they are not finite, and divided by
        ``scales`` (k,) with ``normalize``.
        """
        return np.concatenate(parts(self.observation, s), axis=1)

    def reward_terms(self, s: State) -> dict[str, Any]:
        """Return the terms of the reward, (n,) each, by name.

        The reward is their sum in this order; ``info`` has each as ``reward_NAME``.
        """
        ratio = s.distance / TRACKING_WIDTH
        return {"tracking": 1.0 / (1.0 + ratio * ratio)}

    def is_lost(self, s: State) -> Mask:
        """Return whether each vehicle is lost (n,), which terminates its episode.

        Here: 2.5 m from the reference, on the floor, tilted by 70 degrees, or not finite.
        """
        return ~(s.flying & (s.position[:, 2] > 0.0) & (s.distance <= LOST_OFFSET))

    def info(self, s: State) -> dict[str, Any]:
        """Return entries of ``info``, arrays (n, ...): the truth behind the observation.

        ``info`` also has the terms of the reward, ``lost``, ``observation`` and ``command`` in SI
        units, and the name of the episode's draw.
        """
        return {
            "time": s.time,
            "error": s.distance,
            "position": s.position,
            "reference": s.reference[:, :3],
            "wind": s.wind,
            "force": s.force,
            "torque": s.torque,
        }

    # ---- parts of a task's flight ----------------------------------------------------------

    def draw_winds(self, rng: np.random.Generator) -> list[Any]:
        """Draw the scenario's winds of an episode."""
        return list(draw_winds(self.scenario, rng, self.episode_s))

    @property
    def declared(self) -> Any:
        """The declared vehicle, with the scenario's measurement of the pose."""
        mocap = Mocap(1.0 / TICK, self.scenario.sigma_position, self.scenario.sigma_attitude)
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

    def make_loop(self, vehicle: Vehicle, fan: Fan) -> ClosedLoop:
        """Return the closed loop of a true vehicle and the undeclared effects, with a filter of the
        declared vehicle.
        """
        declared = self.declared
        drawn: dict[str, Any] = {
            n: v for n, v in self.drawn.items() if n in Drawn.__dataclass_fields__
        }
        self._made = ClosedLoop(
            declared,
            replace(vehicle, mocap=declared.mocap, effects=(*vehicle.effects, *self.effects)),
            self.tuning,
            fan,
            replace(self.settings or PlantSettings.for_vehicle(self.truth), **drawn),
            drawn=self.render_mode is not None,
            estimator=self.estimator,
            kind=self.flown.kind,
            stages=self.stages,
            like=self._made,
            rotors=self.truth.positions,  # lanes share one wind's stations
            accelerometer=ACCELEROMETER if self.observation in FELT else self.accelerometer,
            gains=self.gains,
            model_in_loop=bool(self.model_in_loop),
        )
        return self._made

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_made": None}

    def draw_loop(self, rng: np.random.Generator, kept: dict[Any, ClosedLoop]) -> ClosedLoop:
        """Return the closed loop of a world's episode. A scenario with a varied vehicle and
        ``randomise`` draw a new loop; otherwise the world's ``kept`` loop flies again.
        """
        if not (self.scenario.varied or self.randomise):
            self.drawn = {}
            if self.scenario not in kept:
                kept[self.scenario] = self.make_loop(self.truth, self.fan)
            return kept[self.scenario]
        truth = draw_vehicle(self.truth, rng) if self.randomise else self.truth
        self.drawn = self.scenario.variation.draw(rng) if self.scenario.varied else {}
        drawn = defaultdict(lambda: 1.0, self.drawn)
        fan = replace(
            self.fan,
            speed=self.fan.speed * drawn["fan_speed"],
            rotor_drag=self.fan.rotor_drag * drawn["rotor_drag"],
            hull_area=self.fan.hull_area * drawn["hull_area"],
        )
        mass, inertia = truth.mass * drawn["mass"], truth.inertia * drawn["inertia"]
        return self.make_loop(replace(truth, mass=mass, inertia=inertia), fan)

    def draw_start(self, rng: np.random.Generator) -> Start:
        """Return one world's start, of checked shapes.

        Raises:
            InputError: an array has another shape, or is not finite.
        """
        start = Start(*self.start(rng, 1))
        poses = self._checked(start.poses, (1, 3), (1, 4), what="poses")
        pose = np.zeros(4)
        pose[: poses.shape[1]] = poses[0]
        if start.references is None:
            row = np.zeros((1, REFERENCE_SIZE))
            row[0, :3], row[0, 9] = pose[:3], pose[3]
        else:
            references = start.references
            row = self._checked(references, (1, 0, REFERENCE_SIZE), (1, 0, 3), what="references")[0]
            row = along(row, float(pose[3])) if row.shape[1] == 3 else row
        path = np.array([[0.0, self.fan.height]])
        if start.paths is not None:
            path = self._checked(start.paths, (1, 0, 2), what="paths")[0]
        winds = self.winds if self.winds is not None else [*start.winds, ()][0]
        return Start(pose, row, winds, path, [*start.labels, ""][0])

    def _checked(self, numbers: Any, *shapes: tuple[int, ...], what: str) -> Array:
        values = np.asarray(numbers, dtype=np.float64)
        fits = any(
            values.ndim == len(shape)
            and all(size in (0, actual) for size, actual in zip(shape, values.shape, strict=True))
            for shape in shapes
        )
        if not fits or not values.size or not np.all(np.isfinite(values)):
            wanted = " or ".join(str(shape).replace("0", "k") for shape in shapes)
            raise InputError(
                f"{self.name}: start: {what} must be finite numbers, shape {wanted} for n = 1; "
                f"got shape {values.shape}"
            )
        return values


def _ticks(task: str, decision_hz: float) -> int:
    """Return the ticks of a decision."""
    is_rate = isinstance(decision_hz, int | float) and decision_hz > 0
    ticks = 1.0 / (TICK * decision_hz) if is_rate else 0.0
    if round(ticks) < 1 or abs(ticks - round(ticks)) > 1e-6:
        raise InputError(
            f"{task}: decision_hz must be 200 Hz over a whole number (200, 100, 50, 40, 25, 12.5), "
            f"got {decision_hz!r}"
        )
    return round(ticks)
