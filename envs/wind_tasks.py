"""What the tasks in the wind share: an acceleration beside the flight loop's own, winds drawn from
a scenario, a reference, observation and reward.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from numba import carray
from numpy.typing import NDArray

from ..controllers.flight import FlightGains
from ..controllers.wind_observation import (
    LAST_ACTION,
    MAX_ACCELERATION,
    OBSERVATION_LIMITS,
    OBSERVATION_SCALES,
    WIND_OBSERVATION_SIZE,
)
from ..dynamics.effects import check_setting
from ..dynamics.mean_jet import AIR_DENSITY
from ..dynamics.motion import Array
from ..dynamics.vehicle import EffectSetting, Mocap, Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..estimator.tuning import UKFTuning
from ..runtime.addresses import numbers_at, pointer_to
from ..runtime.compiled import Record, compiled_without_gil, specialised
from ..runtime.errors import InputError, unknown_name
from .closed_loop import ESTIMATORS, FASTEST, LOOP, has_been_reset
from .display import modes_shown, need_display
from .fan import STATIONS, Fan
from .plant import TICK, PlantSettings
from .wind import CompiledWind, FanWall, Sum, winds_of
from .wind.field import check_compiled
from .wind_scenarios import (
    HEIGHT,
    START,
    WindScenario,
    draw_reference,
    draw_winds,
    get_wind_scenario,
)
from .windy_flight import REFERENCE_SIZE, WINDY, WINDY_NOISE, WindyFlight

WIND_EPISODE_SECONDS = 20.0
WIND_DECISION_TICKS = 8  # 25 Hz
WIND_DECISIONS = round(WIND_EPISODE_SECONDS / TICK / WIND_DECISION_TICKS)
WIND_SETTLE_TICKS = 300
WIND_LOST = 2.5  # m, from the reference
TRACKING_WIDTH = 0.1  # m, error at which the tracking reward is a half
CHANGE_COST = 0.002  # per (m/s2)^2 of change of the action
_DRAWS = 20  # of an episode's winds, until the vehicle is not lost in them at once
_UPRIGHT = 0.34  # cosine of 70 degrees
# m/s2, standard deviation of the accelerometer's noise a tick, and of its bias
ACCELEROMETER = (0.15, 0.05)

WIND_OUTCOME = np.dtype(
    [
        ("observation", "f4", (WIND_OBSERVATION_SIZE,)),
        ("reward_tracking", "f8"),
        ("reward_change", "f8"),
        ("error", "f8"),  # m, from the reference
        ("position", "f8", (3,)),
        ("reference", "f8", (3,)),
        ("force", "f8", (3,)),
        ("torque", "f8", (3,)),
        ("wind", "f8", (3,)),  # m/s, mean over the stations
        ("time", "f8"),
        ("lost", "?"),
    ]
)
WIND_INFO = WIND_OUTCOME.names[1:]  # type: ignore[index]
_LIMITS = tuple(OBSERVATION_LIMITS)


@compiled_without_gil
def _look(windy: np.ndarray, outcome: np.ndarray, change: Array) -> None:
    """Write what there is to see now, and the reward for it."""
    w: Record = windy[0]
    out: Record = outcome[0]
    loop = carray(pointer_to(w.loop), 1, LOOP)[0]
    x, external = loop.filter.x, loop.plant.external
    qpos, qvel = numbers_at(loop.qpos, (7,)), numbers_at(loop.qvel, (6,))
    rows = numbers_at(w.reference, (w.reference_count, REFERENCE_SIZE))
    r = rows[min(max(w.ticks, 0), w.reference_count - 1)]
    square = 0.0
    for i in range(3):
        out.observation[i] = r[i] - x[i]
        out.observation[3 + i] = x[7 + i]
        out.observation[6 + i] = r[3 + i]
        out.observation[9 + i] = r[6 + i]
        out.observation[12 + i] = x[16 + i]
        out.observation[15 + i] = x[13 + i]
        out.observation[18 + i] = w.specific[i]
        out.observation[21 + i] = w.thrust[i]
        out.observation[LAST_ACTION + i] = w.action[i]
        out.position[i], out.reference[i] = qpos[i], r[i]
        out.force[i], out.torque[i] = external[i], external[3 + i]
        square += (qpos[i] - r[i]) ** 2
        out.wind[i] = 0.0
        for j in range(STATIONS):
            out.wind[i] += w.air[i, j] / STATIONS
    for i in range(WIND_OBSERVATION_SIZE):
        value = out.observation[i]
        out.observation[i] = (
            min(max(value, -_LIMITS[i]), _LIMITS[i]) if math.isfinite(value) else 0.0
        )
    out.error = math.sqrt(square)
    out.time = w.ticks * TICK
    flying = (
        math.isfinite(x[:19].sum())
        and 1.0 - 2.0 * (qpos[4] * qpos[4] + qpos[5] * qpos[5]) >= _UPRIGHT
        and qpos[2] > 0.0
    )
    for i in range(6):
        flying = flying and abs(qvel[i]) < FASTEST
    # such that a number that is none counts as lost
    out.lost = has_been_reset(loop) or not (flying and out.error <= WIND_LOST)
    out.reward_tracking = 1.0 / (1.0 + square / (TRACKING_WIDTH * TRACKING_WIDTH))
    out.reward_change = -CHANGE_COST * (change[0] ** 2 + change[1] ** 2 + change[2] ** 2)


class WindEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """What the tasks in the wind share; see ``WindHoverEnv`` and ``WindTrajectoryEnv``."""

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 25}  # noqa: RUF012
    name = ""
    moving = False

    def __init__(
        self,
        scenario: str | WindScenario = "base",
        render_mode: str | None = None,
        vehicle: str | Vehicle = "ardrone2",
        effects: Sequence[EffectSetting] = (),
        truth: str | Vehicle | None = None,
        winds: Sequence[CompiledWind] | None = None,
        settings: PlantSettings | None = None,
        estimator: str = "ukf",
        normalize: bool = False,
        model_in_loop: bool = True,
        gains: FlightGains | None = None,
        width: int = 640,
        height: int = 480,
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
        self.scenario = (
            scenario if isinstance(scenario, WindScenario) else get_wind_scenario(scenario)
        )
        self.vehicle = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
        self.truth = (
            self.vehicle
            if truth is None
            else truth
            if isinstance(truth, Vehicle)
            else load_vehicle(truth)
        )
        self.effects = tuple(check_setting(e, f"{self.name}: effects") for e in effects)
        self.winds = None if winds is None else list(winds)
        for wind in self.winds or ():
            check_compiled(wind, f"{self.name}: winds")
        self.settings, self.estimator = settings, estimator
        self.model_in_loop, self.gains = bool(model_in_loop), gains
        self.render_mode, self.width, self.height = render_mode, width, height
        self.metadata = {**self.metadata, "render_modes": modes_shown(self.metadata)}
        self._scales = np.array(OBSERVATION_SCALES, dtype=np.float32)
        self._unit = MAX_ACCELERATION if normalize else 1.0
        self.normalize = bool(normalize)
        largest = 1.0 if normalize else MAX_ACCELERATION
        self.action_space = gym.spaces.Box(-largest, largest, (3,), np.float32)
        bound = np.array(OBSERVATION_LIMITS, dtype=np.float32)
        bound = bound / self._scales if normalize else bound
        self.observation_space = gym.spaces.Box(-bound, bound, bound.shape, np.float32)
        self.flight: WindyFlight | None = None
        self.outcome = np.zeros(1, dtype=WIND_OUTCOME)
        self.reference_name = ""
        self.blowing: list[CompiledWind] = []
        self._change = np.zeros(3)
        self._looks = specialised(_look, np.zeros(1, dtype=WINDY), self.outcome, self._change)
        self._begun = False
        self.preview = 0.0  # s; above 0, ``info["force_ahead"]`` is the true force to come
        self.viewer: Any = None

    def _make_flight(self, vehicle: Vehicle, fan: Fan) -> WindyFlight:
        scenario = self.scenario
        mocap = Mocap(1.0 / TICK, scenario.sigma_position, scenario.sigma_attitude)
        declared = replace(self.vehicle, mocap=mocap)
        return WindyFlight(
            declared,
            replace(vehicle, mocap=mocap, effects=(*vehicle.effects, *self.effects)),
            fan,
            UKFTuning.for_vehicle(declared, TICK, scenario.rise_time),
            self.settings or PlantSettings.for_vehicle(self.truth),
            self.gains,
            drawn=self.render_mode is not None,
            estimator=self.estimator,
            accelerometer=ACCELEROMETER,
            model_in_loop=self.model_in_loop,
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; the same seed gives the same episode, bit for bit.

        Raises:
            InputError: ``options`` that are not empty: there are none.
        """
        if options:
            raise InputError(
                f"{self.name}: reset: unknown option(s) {', '.join(map(repr, options))}; expected "
                f"none: scenario and all else are arguments of the environment"
            )
        super().reset(seed=seed)
        rng, fan = self.np_random, Fan(speed=0.0, height=HEIGHT)
        if self.scenario.varied:
            drawn = self.scenario.variation.draw(rng)
            fan = replace(
                fan,
                rotor_drag=fan.rotor_drag * drawn["rotor_drag"],
                hull_area=fan.hull_area * drawn["hull_area"],
            )
            vehicle = replace(
                self.truth,
                mass=self.truth.mass * drawn["mass"],
                inertia=self.truth.inertia * drawn["inertia"],
            )
            self.flight = self._make_flight(vehicle, fan)
        elif self.flight is None:
            self.flight = self._make_flight(self.truth, fan)
        # winds that carry the vehicle off before it is the agent's are drawn anew
        for _ in range(_DRAWS):
            self._draw(self.flight)
            if not self.outcome["lost"][0]:
                break
        else:
            raise InputError(
                f"{self.name}: the vehicle is lost before the episode begins in {_DRAWS} draws of "
                f"these winds; expected winds that its flight loop can hold for 1.5 s"
            )
        self.outcome["reward_tracking"] = self.outcome["reward_change"] = 0.0
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info()

    def _draw(self, flight: WindyFlight) -> None:
        """Draw winds and reference, settle in them, and look at the start."""
        rng = self.np_random
        given = draw_winds(self.scenario, rng, WIND_EPISODE_SECONDS)
        self.blowing = [
            part
            for wind in (given if self.winds is None else self.winds)
            for part in winds_of(wind)
        ]
        self.reference_name, reference = draw_reference(
            rng, math.pi, WIND_EPISODE_SECONDS, self.moving
        )
        flight.reset(rng, START, math.pi, self.blowing, reference, settle=WIND_SETTLE_TICKS)
        self._begun = True
        self._change[:] = 0.0
        self._look()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Fly 40 ms with an acceleration (3,) beside the flight loop's own."""
        given = np.asarray(action, dtype=np.float64)
        if given.shape != (3,) or not math.isfinite(given.sum()):
            raise InputError(
                f"{self.name}: action must be three finite numbers in "
                f"{'units of the largest' if self.normalize else 'm/s2'}, shape (3,), got "
                f"{action!r}"
            )
        if self.flight is None or not self._begun:
            raise InputError(f"{self.name}: call reset before step")
        wanted = np.minimum(np.maximum(self._unit * given, -MAX_ACCELERATION), MAX_ACCELERATION)
        self._change[:] = wanted - self.flight.action
        self.flight.action[:] = wanted
        self.flight.run(self.np_random.standard_normal((WIND_DECISION_TICKS, WINDY_NOISE)))
        self._look()
        if self.render_mode == "human":
            self.render()
        info = self._info()
        reward = info["reward_tracking"] + info["reward_change"]
        return self._observation(), reward, info["lost"], False, info

    def _look(self) -> None:
        assert self.flight is not None
        self._looks(self.flight.record, self.outcome, self._change)

    def _observation(self) -> NDArray[np.float32]:
        seen: NDArray[np.float32] = self.outcome["observation"][0].copy()
        return seen / self._scales if self.normalize else seen

    def _info(self) -> dict[str, Any]:
        """Return the reward's terms and the truth that the agent does not see."""
        info = dict(zip(WIND_INFO, self.outcome[0].item()[1:], strict=True))
        for name in ("position", "reference", "force", "torque", "wind"):
            info[name] = info[name].copy()
        info["trajectory"] = self.reference_name
        if self.preview > 0.0:
            info["force_ahead"] = self._force_ahead(info)
        return info

    def _force_ahead(self, info: dict[str, Any]) -> Array:
        """Return the true force (3,) N, with the wind's part of it as it will blow ``preview`` s
        from now where the vehicle is; for the oracle.
        """
        assert self.flight is not None
        w, loop = self.flight.record[0], self.flight.loop
        if not self.blowing:
            return np.asarray(info["force"])
        fan = loop.record[0]["fan"]
        up, still = w["rotation"][:, 2], loop.velocity
        then = Sum(*self.blowing).velocity(w["points"].T, info["time"] + self.preview)

        def drag(air: Array) -> Array:
            past = air - still
            rotors = past[:4] - (past[:4] @ up)[:, None] * up
            hull = 0.5 * AIR_DENSITY * float(fan["hull_area"]) / (STATIONS - 4)
            speeds = np.sqrt(np.sum(past[4:] ** 2, axis=1))[:, None]
            made: Array = float(fan["rotor_drag"]) * rotors.sum(axis=0) + hull * np.sum(
                speeds * past[4:], axis=0
            )
            return made

        return np.asarray(info["force"] + drag(then) - drag(w["air"].T))

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (height, width, 3) of vehicle, reference, wind and wrench, or show it in
        a window.

        Raises:
            InputError: not reset yet, or this machine cannot draw.
        """
        if self.render_mode is None or self.flight is None:
            raise InputError(
                f"{self.name}: render needs a render_mode ('human' or 'rgb_array') and a reset "
                f"before it"
            )
        if self.viewer is None:
            from .wind_drawing import WindViewer

            self.viewer = WindViewer(self.render_mode, self.width, self.height)
        walls = [wind for wind in self.blowing if isinstance(wind, FanWall)]
        out = self.outcome[0]
        picture: NDArray[np.uint8] | None = self.viewer.draw_winds(
            self.flight, self.blowing, walls, out["reference"], float(out["time"])
        )
        return picture

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.viewer is not None:
            self.viewer.close()
            self.viewer = None


__all__ = ["WIND_DECISIONS", "WIND_DECISION_TICKS", "WIND_EPISODE_SECONDS", "WIND_LOST", "WindEnv"]
