"""The fan-tracking environment."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from ..controllers.observation import MAX_COMMAND
from ..dynamics.effects import check_setting
from ..dynamics.vehicle import EffectSetting, Mocap, Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..estimator.tuning import UKFTuning
from ..runtime.compiled import specialised
from ..runtime.errors import InputError, unknown_name
from .closed_loop import ESTIMATORS, ClosedLoop, run_address
from .decision import DECISION_TICKS, EPISODE, INFO, LOST_OFFSET, decide
from .display import modes_shown, need_display
from .fan import Fan
from .observing import View
from .plain_steps import normals_of
from .plant import NOISE, TICK, PlantSettings
from .scenarios import Scenario, draw_fan_path, get_scenario

EPISODE_SECONDS = 20.0
SETTLE_TICKS = 300  # the filter settles in the jet before an episode starts
DISTANCE = 2.3  # m, from the fan
_FLYING = np.zeros(1, dtype=np.bool_)


class FanTrackingEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A quadrotor in the jet of a moving fan must stay on the fan's axis by feeling the wind alone.

    ## Description

    A drum fan stands at the origin, blows along +x and moves along y. A quadrotor hovers 2.3 m in front of it, at the
    height of its axis, and faces it. An unscented Kalman filter turns rotor speeds and motion-capture pose into the
    external force and torque, at 200 Hz. On the axis the jet pushes the vehicle back; off the axis it also turns it,
    because its drag falls off across the vehicle's span. The agent sees the estimate, 12.5 times a second, and commands
    a velocity along y; an inner flight loop does the rest. The task follows McKinnon and Schoellig, IROS 2016, V-C.

    ## Action space

    ``Box(-1, 1, (1,), float32)``

    | Num | Action                          | Min | Max | Unit |
    | --- | ------------------------------- | --- | --- | ---- |
    | 0   | commanded velocity along world y | -1  | 1   | m/s  |

    A command out of range is clipped; one that is not finite raises ``InputError``.

    ## Observation space

    ``Box(-limit, limit, (8,), float32)``, in SI units, one frame

    | Num | Observation                              | Limit | Unit |
    | --- | ---------------------------------------- | ----- | ---- |
    | 0-2 | estimated external force x, y, z (world)  | 10    | N    |
    | 3-5 | estimated external torque x, y, z (world) | 1     | Nm   |
    | 6   | own estimated velocity along y            | 5     | m/s  |
    | 7   | last command                              | 1     | m/s  |

    Where the fan is, is not observed: ``info`` has it.

    ``observe`` takes another view of the same flight, for ablations:

    | `observe`             | Size | What is seen                                                       |
    | --------------------- | ---- | ------------------------------------------------------------------ |
    | `"wrench"`            | 8    | the table above                                                    |
    | `"wrench-without-fx"` | 7    | the table above without the force x                                |
    | `"pose"`              | 8    | no wrench: position since the start x, y, z (m), velocity along y (m/s), the x and y of the body's z axis (its tilt), yaw less 180 degrees (rad), last command; all as the filter estimates them |
    | `"history"`           | 200  | the table above at the last 25 decisions (2 s), oldest first; before the start: as at the start |

    With ``normalize=True`` each number is divided by a fixed scale, so that it is about 1 in flight:
    force 0.5 N, torque 0.03 Nm, velocity 0.5 m/s, command 1 m/s, position 1 m, tilt 0.1, yaw 0.2 rad.
    The action needs no scale: it lies between -1 and 1 as it is.

    ## Rewards

    ``reward = reward_tracking + reward_change``, each of them in ``info``:

    * ``reward_tracking = 1 / (1 + (offset / 0.3)^2)``, where ``offset`` is the true distance from the axis along y, in m;
    * ``reward_change = -0.05 (command - last command)^2``.

    ## Starting state

    The vehicle hovers where the scenario says and the filter settles for 1.5 s in the standing jet. Fan path, offset and
    all noise are drawn from the seed.

    ## Episode end

    Terminated when the vehicle is lost: 2.5 m off the axis, 1 m off its height or distance, or tilted by more than 70
    degrees. Truncated after 20 s (250 decisions).

    ## Arguments

    ```python
    gym.make("windwrench/FanTracking-v0", scenario="base", render_mode=None)
    ```

    | Parameter     | Default      | Description                                                               |
    | ------------- | ------------ | ------------------------------------------------------------------------- |
    | `scenario`    | `"base"`     | one of `windwrench.envs.SCENARIOS`, or a `Scenario`                        |
    | `vehicle`     | `"ardrone2"` | preset, YAML path or `Vehicle`: what filter and flight loop know            |
    | `effects`     | `()`         | effects of the true vehicle that nobody declared                           |
    | `truth`       | `None`       | the true vehicle, before `effects`; default: as declared                    |
    | `fan`         | `None`       | a `Fan`, in place of the standard one                                      |
    | `settings`    | `None`       | a `PlantSettings`: motor lag, unmodelled disturbance, dropouts             |
    | `fan_path`    | `None`       | function from times (n,) s to the fan's y (n,) m, in place of the scenario's |
    | `estimator`   | `"ukf"`      | `"ukf"`, or `"constant-gain"`: the filter's converged gain, for faster training |
    | `observe`     | `"wrench"`   | what is seen: `"wrench"`, `"wrench-without-fx"`, `"pose"` or `"history"`    |
    | `normalize`   | `False`      | whether observations are divided by fixed scales (see above)              |
    | `render_mode` | `None`       | `"human"` (needs a display) or `"rgb_array"`                               |

    ``metadata["render_modes"]`` of an environment names what this machine can show: without a display, no
    `"human"`. ``reset`` knows no ``options`` and refuses any.

    ## Version history

    * v0: initial version.
    """  # noqa: E501

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 13}  # noqa: RUF012

    def __init__(
        self,
        scenario: str | Scenario = "base",
        render_mode: str | None = None,
        vehicle: str | Vehicle = "ardrone2",
        effects: Sequence[EffectSetting] = (),
        fan: Fan | None = None,
        settings: PlantSettings | None = None,
        fan_path: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
        width: int = 640,
        height: int = 480,
        truth: str | Vehicle | None = None,
        estimator: str = "ukf",
        observe: str = "wrench",
        normalize: bool = False,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"FanTracking: render_mode must be human, rgb_array or None, got {render_mode!r}"
            )
        if render_mode == "human":
            need_display()
        self.scenario = scenario if isinstance(scenario, Scenario) else get_scenario(scenario)
        self.vehicle = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
        # a declared vehicle whose model was amended must not bring its effects into the world a
        # second time
        self.truth = (
            self.vehicle
            if truth is None
            else truth
            if isinstance(truth, Vehicle)
            else load_vehicle(truth)
        )
        self.effects = tuple(check_setting(e, "FanTracking: effects") for e in effects)
        self.fan = replace(fan or Fan(), turbulence=self.scenario.turbulence)
        self.settings = settings
        if estimator not in ESTIMATORS:
            raise unknown_name("estimator", estimator, ESTIMATORS)
        self.estimator = estimator
        self.fan_path = fan_path
        self.render_mode, self.width, self.height = render_mode, width, height
        self.metadata = {**self.metadata, "render_modes": modes_shown(self.metadata)}
        self.action_space = gym.spaces.Box(-MAX_COMMAND, MAX_COMMAND, (1,), np.float32)
        self.view = View(observe, normalize)
        bound = self.view.bound()
        self.observation_space = gym.spaces.Box(-bound, bound, bound.shape, np.float32)
        self.viewer: Any = None
        self.loop: ClosedLoop | None = None
        self.fan_motion = ""
        self.episode = np.zeros(1, dtype=EPISODE)
        self._command = np.zeros(1)
        self._addressed: tuple[
            object, ...
        ] = ()  # what the episode has the addresses of, beside its generator
        self._tasks = np.zeros(3, dtype=np.int64)
        self._call: Callable[..., None] | None = None

    def _make_loop(self, vehicle: Vehicle, fan: Fan) -> ClosedLoop:
        """Return the closed loop for a true vehicle (before the undeclared effects); the filter
        knows the declared one.
        """
        scenario = self.scenario
        mocap = Mocap(1.0 / TICK, scenario.sigma_position, scenario.sigma_attitude)
        declared = replace(self.vehicle, mocap=mocap)
        true = replace(vehicle, mocap=mocap, effects=(*vehicle.effects, *self.effects))
        tuning = UKFTuning.for_vehicle(declared, TICK, scenario.rise_time)
        return ClosedLoop(
            declared,
            true,
            tuning,
            fan,
            self.settings or PlantSettings.for_vehicle(self.truth),
            drawn=self.render_mode is not None,
            estimator=self.estimator,
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
                f"FanTracking: reset: unknown option(s) {', '.join(map(repr, options))}; expected "
                f"none: scenario and all else are arguments of the environment"
            )
        super().reset(seed=seed)
        rng = self.np_random
        distance, loop, _ = self.hover(rng)
        loop.run(rng.standard_normal((SETTLE_TICKS, NOISE)), self._fan_y[:1])
        self._begin(distance)
        if self.render_mode == "human":
            self.render()
        return self.observation(), self._info()

    def flight(self) -> ClosedLoop:
        """Return a closed loop as an episode has one, of the true vehicle and the fan as stated."""
        return self._make_loop(self.truth, self.fan)

    def hover(self, rng: np.random.Generator) -> tuple[float, ClosedLoop, NDArray[np.float64]]:
        """Draw an episode and let the vehicle hover at its start, before the filter settles.

        Returns its distance from the fan, m, the closed loop, and the fan's path (n,), m.
        """
        scenario, distance = self.scenario, DISTANCE
        if scenario.varied:
            drawn = scenario.variation.draw(rng)
            distance = drawn["distance"]
            fan = replace(
                self.fan,
                speed=self.fan.speed * drawn["fan_speed"],
                rotor_drag=self.fan.rotor_drag * drawn["rotor_drag"],
                hull_area=self.fan.hull_area * drawn["hull_area"],
            )
            vehicle = replace(
                self.truth,
                mass=self.truth.mass * drawn["mass"],
                inertia=self.truth.inertia * drawn["inertia"],
            )
            self.loop = self._make_loop(vehicle, fan)
        elif self.loop is None:
            self.loop = self.flight()
        loop = self.loop
        ticks = round(EPISODE_SECONDS / TICK)
        t = TICK * np.arange(ticks + 2, dtype=np.float64)
        self.fan_motion, self._fan_speed, self._fan_y = draw_fan_path(scenario, rng, t)
        if self.fan_path is not None:
            self.fan_motion, self._fan_y = (
                "given",
                np.ascontiguousarray(self.fan_path(t), dtype=np.float64),
            )
            if self._fan_y.shape != t.shape or not np.all(np.isfinite(self._fan_y)):
                raise InputError(
                    f"FanTracking: fan_path must return {t.size} finite numbers for {t.size} times"
                )
        offset = float(rng.uniform(*scenario.offset) * rng.choice([-1.0, 1.0]))
        loop.reset(rng, np.array([distance, self._fan_y[0] + offset, self.fan.height]), math.pi)
        return distance, loop, self._fan_y

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Fly 80 ms with a commanded velocity (1,) m/s along y."""
        command = np.asarray(action, dtype=np.float64)
        if command.shape != (1,) or not math.isfinite(command[0]):
            raise InputError(
                f"FanTracking: action must be one finite number in m/s, shape (1,), got {action!r}"
            )
        self.fly(command.item())
        if self.render_mode == "human":
            self.render()
        info = self._info()
        return (
            self.observation(),
            info["reward_tracking"] + info["reward_change"],
            info["lost"],
            False,
            info,
        )

    def fly(self, command: float) -> None:
        """Do what ``step`` does at a finite ``command``, and leave what came of it
        in ``episode``.
        """
        if not self._addressed:
            raise InputError("FanTracking: call reset before step")
        self._command[0] = command
        self._decide(DECISION_TICKS)

    def _begin(self, distance: float) -> None:
        """Tell the compiled decision where everything of this episode lies, and
        look at its start.
        """
        loop = self.loop
        assert loop is not None
        e = self.episode[0]
        e["loop"], e["run"], e["path"], e["path_count"] = (
            loop.address,
            run_address(),
            self._fan_y.ctypes.data,
            len(self._fan_y),
        )
        self._addressed = loop, self._fan_y
        self._draw_from(self.np_random)
        e["ticks"], e["distance"], e["height"], e["command"] = 0, distance, self.fan.height, 0.0
        e["power"] = 2.0
        self.view.restart(loop.state)
        self._command[0] = 0.0
        self._decide(0)
        out = e["outcome"]
        out["reward_tracking"] = out["reward_change"] = 0.0
        out["lost"] = False

    def _draw_from(self, generator: np.random.Generator) -> None:
        e = self.episode[0]
        self._normals = normals_of(generator, DECISION_TICKS * NOISE)
        e["normals"], e["bits"], e["drawn"] = self._normals[:3]

    @property
    def np_random(self) -> np.random.Generator:
        """What all noise is drawn from."""
        return super().np_random

    @np_random.setter
    def np_random(self, value: np.random.Generator) -> None:
        self._np_random, self._np_random_seed = value, -1
        self._draw_from(value)

    def _decide(self, ticks: int) -> None:
        """Fly some ticks at ``_command`` and write the outcome."""
        tasks = self._tasks
        if self._call is None:
            self._call = specialised(decide, self.episode, self._command, _FLYING, ticks, tasks, 0)
        tasks[0] = 0
        self._call(self.episode, self._command, _FLYING, ticks, tasks, 0)

    def observation(self) -> NDArray[np.float32]:
        """Return what the agent sees now, as ``step`` did."""
        e = self.episode[0]
        if self.view.is_plain:
            observation: NDArray[np.float32] = e["outcome"]["observation"].copy()
            return observation
        assert self.loop is not None
        return self.view.of(e["outcome"]["observation"], self.loop.state, int(e["ticks"]))

    def _info(self) -> dict[str, Any]:
        """Return the reward's terms and the truth that the agent does not see."""
        info = dict(zip(INFO, self.episode["outcome"][0].item()[1:], strict=True))
        info["force"], info["torque"], info["fan_motion"] = (
            info["force"].copy(),
            info["torque"].copy(),
            self.fan_motion,
        )
        return info

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (height, width, 3) of fan, jet, vehicle and wrench, or show it in a
        window.

        Raises:
            InputError: not reset yet, or this machine cannot draw.
        """
        if self.render_mode is None or self.loop is None:
            raise InputError(
                "FanTracking: render needs a render_mode ('human' or 'rgb_array') and a reset "
                "before it"
            )
        if self.viewer is None:
            from .drawing import Viewer

            self.viewer = Viewer(self.render_mode, self.width, self.height)
        picture: NDArray[np.uint8] | None = self.viewer.draw(
            self.loop, float(self.episode["outcome"]["fan_y"][0])
        )
        return picture

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.viewer is not None:
            self.viewer.close()
            self.viewer = None


__all__ = ["DECISION_TICKS", "EPISODE_SECONDS", "LOST_OFFSET", "FanTrackingEnv"]
