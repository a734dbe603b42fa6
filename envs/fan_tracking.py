"""The fan-tracking environment."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ..controllers.briefing import Air, Briefing, FilterNoise, Jet, Motions
from ..dynamics.motion import Array
from ..runtime.compiled import compiled_without_gil
from ..runtime.errors import InputError
from .fan import Fan
from .observing import LIMITS, SCALES, Episodes, Motion, View
from .plant import TICK, PlantSettings
from .scenarios import SCENARIOS, draw_fan_path
from .task import (
    COMMON_VALUES,
    EPISODE_SECONDS,
    LOST_OFFSET,
    Frame,
    Task,
    is_flying,
    keep_within,
    note,
    vehicle_of,
)

DECISION_TICKS = 16  # 12.5 Hz
DISTANCE = 2.3  # m, from the fan
TRACKING_WIDTH = 0.3  # m, offset at which the tracking reward is a half
CHANGE_COST = 0.05  # per (m/s)^2 of change of the command
_LIMITS = np.array(LIMITS)
AWAY = 1.0  # m, off its height or its distance, at which a vehicle is lost
FAN_TIMES = TICK * np.arange(round(EPISODE_SECONDS / TICK) + 2, dtype=np.float64)


class FanTask(Task):
    """Base of the tasks in front of a fan: the fan moves along a path of y and height (n, 2) m, a
    row a tick, and the agent commands velocities across its jet.
    """

    scenarios = SCENARIOS
    decision_ticks = DECISION_TICKS

    def __init__(self, *shared: Any, fan: Fan, **named: Any) -> None:
        super().__init__(*shared, **named)
        self.fan = replace(fan, turbulence=self.scenario.turbulence)

    def briefing(self) -> Briefing:
        """Return beside the declared vehicle the standard fan, the tuning of the filter, the
        scenario's motions and its air.
        """
        fan, scenario = self.fan, self.scenario
        plant = self.settings or PlantSettings.for_vehicle(self.vehicle)
        air = Air(
            plant.disturbance_force,
            plant.disturbance_torque,
            plant.disturbance_time,
            fan.turbulence,
            fan.gust_length,
            fan.gust_time,
        )
        jet = Jet(fan.speed, fan.rotor_drag, fan.hull_area, DISTANCE)
        motions = Motions(scenario.motions, scenario.speed, offset=scenario.offset)
        return Briefing(self.vehicle, FilterNoise.of(self.tuning, TICK), air, jet, motions)

    def _start(self, path: Array, offset: Array) -> None:
        """Hover ``offset`` (2,) m beside the fan's axis."""
        self.path, self.distance = path, self.drawn.get("distance", DISTANCE)
        start = np.array([self.distance, *(path[0] + offset)])
        self.loop.reset(self.np_random, start, math.pi)

    def _truth(self) -> dict[str, Any]:
        """Return ``Task._truth``, the places (3,) m of vehicle and set point, and the fan's axis
        now and after each decision to come, (foresight + 1, 2) m.
        """
        loop, path = self.loop, self.path
        rows = loop.ticks - 1 + self.decision_ticks * np.arange(self.foresight + 1)
        return super()._truth() | {
            "place": loop.position.copy(),
            "setpoint": loop.setpoint[:3].copy(),
            "fan_ahead": path[np.clip(rows, 0, len(path) - 1)],
        }


@compiled_without_gil
def look_along_y(
    which: np.ndarray, episodes: Episodes, motion: Motion, frames: Frame, values: np.ndarray
) -> None:
    """Write frames and values of ``FanTrackingEnv`` for the episodes ``which``."""
    for n in np.flatnonzero(which):
        p, v, wrench, state = vehicle_of(motion, n)
        path, value, frame = episodes.paths[n], values[n], frames[n]
        for i in range(3):
            frame[i], frame[3 + i] = state[16 + i], state[13 + i]  # force, torque
        frame[6], frame[7] = state[8], episodes.commands[n, 0]
        keep_within(frame, _LIMITS)
        k = min(episodes.ticks[n], len(path) - 1)
        value.fan_y = path[max(k - 1, 0), 0]
        value.fan_velocity = (path[k, 0] - value.fan_y) / TICK
        value.y, value.offset = p[1], p[1] - value.fan_y
        ratio, change = value.offset / TRACKING_WIDTH, episodes.changes[n, 0]
        note(value, episodes, n, wrench, ratio * ratio, -CHANGE_COST * change * change)
        # in this form a number that is not finite counts as lost
        value.lost = episodes.broken[n] or not (
            is_flying(state, p, v)
            and abs(value.offset) <= LOST_OFFSET
            and abs(p[0] - episodes.distance[n]) <= AWAY
            and abs(p[2] - path[0, 1]) <= AWAY
        )


class FanTrackingEnv(FanTask):
    """A quadrotor in the jet of a moving fan must stay on the fan's axis by feeling the wind alone.

    ## Description

    A drum fan stands at the origin, blows along +x and moves along y. A quadrotor hovers 2.3 m in front of the fan, at
    the height of its axis, and faces the fan. An unscented Kalman filter turns rotor speeds and motion-capture pose into the
    external force and torque, at 200 Hz. On the axis the jet pushes the vehicle back. Off the axis the
    drag falls off across the vehicle's span and turns the vehicle, too. The agent sees the estimate, 12.5 times a second, and commands
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

    The fan's place is not observed: ``info`` has it.

    ``observe`` takes another view of the same flight, for ablations:

    | `observe`             | Size | What is seen                                                       |
    | --------------------- | ---- | ------------------------------------------------------------------ |
    | `"wrench"`            | 8    | the table above                                                    |
    | `"wrench-without-fx"` | 7    | the table above without the force x                                |
    | `"pose"`              | 8    | no wrench: the pose, as the filter estimates it                    |
    | `"history"`           | 200  | the table above at the last 25 decisions (2 s), oldest first       |

    The pose is the position since the start x, y, z (m), the velocity along y (m/s), and the x and y of the body's z
    axis (its tilt). Then come yaw less 180 degrees (rad) and the last command. Before the start the history is as at the
    start.

    With ``normalize=True`` each number is divided by a fixed scale, and is about 1 in flight:
    force 0.5 N, torque 0.03 Nm, velocity 0.5 m/s, command 1 m/s, position 1 m, tilt 0.1, yaw 0.2 rad.
    The action needs no scale: the limits are -1 and 1 as they are.

    ## Rewards

    ``reward = reward_tracking + reward_change``, each of them in ``info``:

    * ``reward_tracking = 1 / (1 + (offset / 0.3)^2)``, where ``offset`` is the true distance from the axis along
      y, in m;
    * ``reward_change = -0.05 (command - last command)^2``.

    ## Starting state

    The vehicle hovers where the scenario says and the filter settles for 1.5 s in the standing jet. Fan path, offset
    and all noise are drawn from the seed.

    ## Episode end

    Terminated when the vehicle is lost: 2.5 m off the axis, 1 m off its height or distance, or tilted by more than 70
    degrees. Truncated after 20 s (250 decisions).

    ## Arguments

    ```python
    gym.make("windwrench/FanTracking-v1", scenario="base", normalize=True, render_mode=None)
    ```

    | Parameter     | Default      | Description                                                               |
    | ------------- | ------------ | ------------------------------------------------------------------------- |
    | `scenario`    | `"base"`     | one of `windwrench.envs.SCENARIOS`, or a `Scenario`                        |
    | `fan`         | `None`       | a `Fan`, in place of the standard one                                      |
    | `fan_path`    | `None`       | function from times (n,) s to the fan's y (n,) m, in place of the scenario's |
    | `observe`     | `"wrench"`   | what is seen: `"wrench"`, `"wrench-without-fx"`, `"pose"` or `"history"`    |

    All arguments of ``windwrench.envs.task.Task`` come beside these.
    ``metadata["render_modes"]`` of an environment names what this machine can show: without a display, no
    `"human"`. ``reset`` refuses any ``options``.

    ## Version history

    * v1: ``normalize``, True by default; ``info`` has ``observation`` and ``command`` in SI units.
    * v0: v1 with ``normalize=False``, as an alias until 3.0.
    """  # noqa: E501

    name = "FanTracking"
    action_size = 1

    look = look_along_y
    values = np.dtype(
        [*COMMON_VALUES, *[(name, "f8") for name in ("fan_y", "fan_velocity", "y", "offset")]],
        align=True,
    )
    limits, scales = LIMITS, SCALES

    def __init__(
        self,
        *shared: Any,
        fan: Fan | None = None,
        fan_path: Callable[[Array], Array] | None = None,
        observe: str = "wrench",
        **named: Any,
    ) -> None:
        super().__init__(*shared, fan=fan or Fan(), **named)
        self._see_by(View(observe, self.normalize))
        self.fan_path = fan_path

    def hover(self) -> None:
        """Draw a path of the fan, and place the vehicle in hover beside its start."""
        rng, scenario = self.np_random, self.scenario
        self.drawn_label, fan_y = draw_fan_path(scenario, rng, FAN_TIMES)
        if self.fan_path is not None:
            self.drawn_label = "given"
            fan_y = np.asarray(self.fan_path(FAN_TIMES), dtype=np.float64)
            if fan_y.shape != FAN_TIMES.shape or not np.all(np.isfinite(fan_y)):
                n = FAN_TIMES.size
                raise InputError(
                    f"FanTracking: fan_path must return {n} finite numbers for {n} times"
                )
        offset = float(rng.uniform(*scenario.offset) * rng.choice([-1.0, 1.0]))
        path = np.column_stack([fan_y, np.full(len(fan_y), self.fan.height)])
        self._start(path, np.array([offset, 0.0]))


__all__ = ["DECISION_TICKS", "EPISODE_SECONDS", "LOST_OFFSET", "FanTrackingEnv"]
