"""Fan tracking in two directions: the fan moves sideways and up and down."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from ..dynamics.effects import check_setting
from ..dynamics.vehicle import EffectSetting, Mocap, Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..estimator.tuning import UKFTuning
from ..runtime.errors import InputError, unknown_name
from .closed_loop import ESTIMATORS
from .display import modes_shown, need_display
from .fan import Fan
from .fan_tracking import DECISION_TICKS, DISTANCE, EPISODE_SECONDS, LOST_OFFSET, SETTLE_TICKS
from .plant import TICK, PlantSettings
from .scenarios import Scenario, draw_fan_path, get_scenario
from .windy_flight import WINDY_NOISE, WindyFlight

Array = NDArray[np.float64]

FAN_HEIGHT = 1.5  # m, of the fan's axis at the start
CAGE = 0.6  # rad, of the cage's stations above and below the rotors' plane
_VERTICAL = 0.5  # of the scenario's speeds and travels that the fan moves up and down with
_LIMITS_2D = (10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, 5.0, 1.0, 1.0)
_BOUND = np.array(_LIMITS_2D)
SCALES_2D = (0.5, 0.5, 0.5, 0.03, 0.03, 0.03, 0.5, 0.5, 1.0, 1.0)
_TRACKING_WIDTH = 0.3  # m
_CHANGE_COST = 0.05  # per (m/s)^2
_AWAY = 1.0  # m, off its distance
_UPRIGHT = 0.34  # cosine of 70 degrees


class FanTracking2DEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A quadrotor in a spherical cage must stay on the axis of a fan that moves in y and z.

    ## Description

    A drum fan blows along +x and moves along y and along z. A quadrotor hovers 2.3 m in front of it
    and faces it. It flies in a cage: the stations on which the wind acts on its hull lie in turn 0.15 m
    above and below the rotors, so that a jet that falls off in height pitches it as one that falls off
    sideways turns it (a flat ring, as in ``FanTracking``, would feel no torque of a vertical offset). An
    unscented Kalman filter turns rotor speeds and motion-capture pose into the external force and torque,
    at 200 Hz. The agent sees the estimate, 12.5 times a second, and commands velocities along y and z.

    ## Action space

    ``Box(-1, 1, (2,), float32)``

    | Num | Action                           | Min | Max | Unit |
    | --- | -------------------------------- | --- | --- | ---- |
    | 0   | commanded velocity along world y | -1  | 1   | m/s  |
    | 1   | commanded velocity along world z | -1  | 1   | m/s  |

    A command out of range is clipped; one that is not finite raises ``InputError``.

    ## Observation space

    ``Box(-limit, limit, (10,), float32)``, in SI units; with ``normalize=True`` divided by the scale

    | Num | Observation                               | Limit | Scale | Unit |
    | --- | ----------------------------------------- | ----- | ----- | ---- |
    | 0-2 | estimated external force x, y, z (world)  | 10    | 0.5   | N    |
    | 3-5 | estimated external torque x, y, z (world) | 1     | 0.03  | Nm   |
    | 6-7 | own estimated velocity along y and z      | 5     | 0.5   | m/s  |
    | 8-9 | last command                              | 1     | 1     | m/s  |

    Where the fan is, is not observed: ``info`` has it. Above the axis the world's ``tau_y`` is negative,
    at positive y its ``tau_z`` is positive.

    ## Rewards

    ``reward = reward_tracking + reward_change``, each of them in ``info``:

    * ``reward_tracking = 1 / (1 + (offset / 0.3)^2)``, where ``offset`` is the true distance from the axis,
      ``sqrt(dy^2 + dz^2)``, in m;
    * ``reward_change = -0.05 |command - last command|^2``.

    ## Starting state

    The vehicle hovers off the axis by what the scenario says, on a side drawn at random, and the filter settles
    for 1.5 s in the standing jet. The fan's axis starts at 1.5 m. Along y it moves as in ``FanTracking``, along
    z as a second path drawn from the same scenario, half as fast and as far. Paths, offset and all noise are
    drawn from the seed.

    ## Episode end

    Terminated when the vehicle is lost: 2.5 m off the axis, 1 m off its distance, on the floor, or tilted by
    more than 70 degrees. Truncated after 20 s (250 decisions).

    ## Arguments

    ```python
    gym.make("windwrench/FanTracking2D-v0", scenario="base", render_mode=None)
    ```

    | Parameter     | Default      | Description                                                       |
    | ------------- | ------------ | ----------------------------------------------------------------- |
    | `scenario`    | `"base"`     | one of `windwrench.envs.SCENARIOS`, or a `Scenario`                |
    | `vehicle`     | `"ardrone2"` | preset, YAML path or `Vehicle`: what filter and flight loop know    |
    | `effects`     | `()`         | effects of the true vehicle that nobody declared                   |
    | `truth`       | `None`       | the true vehicle, before `effects`; default: as declared            |
    | `fan`         | `None`       | a `Fan`, in place of the standard one with a cage                  |
    | `settings`    | `None`       | a `PlantSettings`: motor lag, unmodelled disturbance, dropouts     |
    | `estimator`   | `"ukf"`      | `"ukf"`, or `"constant-gain"`: the filter's converged gain          |
    | `normalize`   | `False`      | whether observations are divided by the scales above               |
    | `render_mode` | `None`       | `"human"` (needs a display) or `"rgb_array"`                       |

    ``reset`` knows no ``options`` and refuses any.

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
        truth: str | Vehicle | None = None,
        fan: Fan | None = None,
        settings: PlantSettings | None = None,
        estimator: str = "ukf",
        normalize: bool = False,
        width: int = 640,
        height: int = 480,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"FanTracking2D: render_mode must be human, rgb_array or None, got {render_mode!r}"
            )
        if render_mode == "human":
            need_display()
        if not isinstance(normalize, bool | np.bool_):
            raise InputError(f"FanTracking2D: normalize must be True or False, got {normalize!r}")
        if estimator not in ESTIMATORS:
            raise unknown_name("estimator", estimator, ESTIMATORS)
        self.scenario = scenario if isinstance(scenario, Scenario) else get_scenario(scenario)
        self.vehicle = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
        self.truth = (
            self.vehicle
            if truth is None
            else truth
            if isinstance(truth, Vehicle)
            else load_vehicle(truth)
        )
        self.effects = tuple(check_setting(e, "FanTracking2D: effects") for e in effects)
        self.fan = replace(
            fan or Fan(height=FAN_HEIGHT, hull_elevation=CAGE),
            turbulence=self.scenario.turbulence,
        )
        self.settings, self.estimator = settings, estimator
        self.render_mode, self.width, self.height = render_mode, width, height
        self.metadata = {**self.metadata, "render_modes": modes_shown(self.metadata)}
        self._scales = np.array(SCALES_2D if normalize else np.ones(10), dtype=np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
        bound = np.array(_LIMITS_2D, dtype=np.float32) / self._scales
        self.observation_space = gym.spaces.Box(-bound, bound, (10,), np.float32)
        self.flight: WindyFlight | None = None
        self.motions = ("", "")
        self._path: Array = np.zeros((1, 2))
        self._command, self._distance = np.zeros(2), DISTANCE
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
                f"FanTracking2D: reset: unknown option(s) {', '.join(map(repr, options))}; "
                f"expected none: scenario and all else are arguments of the environment"
            )
        super().reset(seed=seed)
        rng, scenario = self.np_random, self.scenario
        self._distance = DISTANCE
        if scenario.varied:
            drawn = scenario.variation.draw(rng)
            self._distance = drawn["distance"]
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
            self.flight = self._make_flight(vehicle, fan)
        elif self.flight is None:
            self.flight = self._make_flight(self.truth, self.fan)
        t = TICK * np.arange(round(EPISODE_SECONDS / TICK) + 2, dtype=np.float64)
        sideways, _, y = draw_fan_path(scenario, rng, t)
        upwards, _, z = draw_fan_path(scenario, rng, t)
        self.motions = sideways, upwards
        self._path = np.column_stack([y, self.fan.height + _VERTICAL * z])
        offset, side = float(rng.uniform(*scenario.offset)), float(rng.uniform(-math.pi, math.pi))
        start = self._path[0] + offset * np.array([math.cos(side), 0.5 * math.sin(side)])
        self.flight.reset(
            rng,
            np.array([self._distance, *start]),
            math.pi,
            path=self._path,
            settle=SETTLE_TICKS,
        )
        self._command[:] = 0.0
        info = self._info(np.zeros(2))
        info["reward_tracking"] = info["reward_change"] = 0.0
        if self.render_mode == "human":
            self.render()
        return self._observation(), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Fly 80 ms with commanded velocities (2,) m/s along y and z."""
        given = np.asarray(action, dtype=np.float64)
        if given.shape != (2,) or not math.isfinite(given.sum()):
            raise InputError(
                f"FanTracking2D: action must be two finite numbers in m/s, shape (2,), got "
                f"{action!r}"
            )
        if self.flight is None:
            raise InputError("FanTracking2D: call reset before step")
        command = np.minimum(np.maximum(given, -1.0), 1.0)
        change = command - self._command
        self._command[:] = command
        self.flight.loop.setpoint[4:6] = command
        self.flight.run(self.np_random.standard_normal((DECISION_TICKS, WINDY_NOISE)))
        if self.render_mode == "human":
            self.render()
        info = self._info(change)
        reward = info["reward_tracking"] + info["reward_change"]
        return self._observation(), reward, info["lost"], False, info

    def _observation(self) -> NDArray[np.float32]:
        assert self.flight is not None
        x = self.flight.loop.state
        seen = np.empty(10)
        seen[:3], seen[3:6], seen[6:8], seen[8:] = x[16:19], x[13:16], x[8:10], self._command
        if not math.isfinite(seen.sum()):
            seen = np.nan_to_num(seen, posinf=0.0, neginf=0.0)
        limited: NDArray[np.float32] = np.minimum(np.maximum(seen, -_BOUND), _BOUND).astype(
            np.float32
        )
        return limited / self._scales

    def _info(self, change: Array) -> dict[str, Any]:
        """Return the reward's terms and the truth that the agent does not see."""
        flight = self.flight
        assert flight is not None
        loop, path = flight.loop, self._path
        ticks = flight.ticks
        k = min(ticks, len(path) - 1)
        fan = path[max(k - 1, 0)]
        velocity = (path[k] - fan) / TICK if k > 0 else np.zeros(2)
        at, q = loop.position.tolist(), loop.quaternion.tolist()
        offset = math.hypot(at[1] - fan[0], at[2] - fan[1])
        flying = (
            flight.healthy()
            and 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2) >= _UPRIGHT
            and offset <= LOST_OFFSET
            and abs(at[0] - self._distance) <= _AWAY
            and at[2] > 0.0
        )
        return {
            "reward_tracking": 1.0 / (1.0 + (offset / _TRACKING_WIDTH) ** 2),
            "reward_change": -_CHANGE_COST * float(change @ change),
            "fan": fan.copy(),
            "fan_velocity": velocity,
            "position": np.array(at[1:]),
            "error": offset,
            "force": loop.external[:3].copy(),
            "torque": loop.external[3:].copy(),
            "time": ticks * TICK,
            "lost": not flying,
            "fan_motion": " and ".join(self.motions),
        }

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (height, width, 3) of fan, jet, vehicle and wrench, or show it in a
        window.

        Raises:
            InputError: not reset yet, or this machine cannot draw.
        """
        if self.render_mode is None or self.flight is None:
            raise InputError(
                "FanTracking2D: render needs a render_mode ('human' or 'rgb_array') and a reset "
                "before it"
            )
        if self.viewer is None:
            from .drawing import Viewer

            self.viewer = Viewer(self.render_mode, self.width, self.height)
        k = min(max(self.flight.ticks - 1, 0), len(self._path) - 1)
        picture: NDArray[np.uint8] | None = self.viewer.draw(
            self.flight.loop, float(self._path[k, 0])
        )
        return picture

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.viewer is not None:
            self.viewer.close()
            self.viewer = None
