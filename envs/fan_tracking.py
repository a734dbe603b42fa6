"""The fan-tracking environment."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..controllers.observation import MAX_COMMAND
from ..runtime.arrays import Array, Mask
from ..runtime.errors import InputError, unknown_name
from .definition import LOST_OFFSET
from .fan import Fan
from .fan_task import AWAY, LIMITS, SCALES, FanTask
from .scenarios import draw_fan_path
from .state import State

FRAMES = 25  # decisions of a history, 2 s
# for the pose: position (m), velocity (m/s), tilt, yaw (rad), command (m/s)
_POSE_LIMITS = (5.0, 5.0, 5.0, 5.0, 1.0, 1.0, math.pi, MAX_COMMAND)
_POSE_SCALES = (1.0, 1.0, 1.0, 0.5, 0.1, 0.1, 0.2, 1.0)
# limits and scales of the views
_VIEWS = {
    "wrench": (LIMITS, SCALES),
    "wrench-without-fx": (LIMITS[1:], SCALES[1:]),
    "history": (LIMITS * FRAMES, SCALES * FRAMES),
    "pose": (_POSE_LIMITS, _POSE_SCALES),
}


class FanTrackingEnv(FanTask):
    """A quadrotor in the jet of a moving fan must stay on the fan's axis, by the estimated wrench alone.

    ## Description

    A drum fan stands at the origin, blows along +x and moves along y. A quadrotor hovers 2.3 m in front of the fan, at
    the height of its axis, and faces the fan. An unscented Kalman filter turns rotor speeds and motion-capture pose into the
    external force and torque, at 200 Hz. On the axis the jet pushes the vehicle back. Off the axis the
    drag differs across the vehicle's span, so the jet also turns the vehicle. The agent observes the estimate, 12.5 times a second, and commands
    a velocity along y; a flight loop stabilises the vehicle. The task follows McKinnon and Schoellig, IROS 2016, V-C.

    ## Action space

    ``Box(-1, 1, (1,), float32)``

    | Num | Action                          | Min | Max | Unit |
    | --- | ------------------------------- | --- | --- | ---- |
    | 0   | commanded velocity along world y | -1  | 1   | m/s  |

    A command out of range is clipped; a command that is not finite raises ``InputError``.

    ## Observation space

    ``Box(-limit, limit, (8,), float32)``, in SI units, one frame

    | Num | Observation                              | Limit | Unit |
    | --- | ---------------------------------------- | ----- | ---- |
    | 0-2 | estimated external force x, y, z (world)  | 10    | N    |
    | 3-5 | estimated external torque x, y, z (world) | 1     | Nm   |
    | 6   | estimated velocity along y                | 5     | m/s  |
    | 7   | last command                              | 1     | m/s  |

    The fan's place is in ``info``, not in the observation.

    ``observe`` takes another view of the same flight, for ablations:

    | `observe`             | Size | Observation                                                        |
    | --------------------- | ---- | ------------------------------------------------------------------ |
    | `"wrench"`            | 8    | the table above                                                    |
    | `"wrench-without-fx"` | 7    | the table above without the force x                                |
    | `"pose"`              | 8    | no wrench: the estimated pose                                      |
    | `"history"`           | 200  | the table above at the last 25 decisions (2 s), oldest first       |

    The pose is the position since the start x, y, z (m) and the velocity along y (m/s). Next are the x and y of the
    body's z axis (its tilt), yaw less 180 degrees (rad) and the last command. Before the start the history repeats the first frame.

    With ``normalize=True`` fixed scales divide all numbers, to about 1 in flight:
    force 0.5 N, torque 0.03 Nm, velocity 0.5 m/s, command 1 m/s, position 1 m, tilt 0.1, yaw 0.2 rad.
    The action's limits are -1 and 1 without a scale.

    ## Rewards

    ``reward = reward_tracking + reward_change``, both in ``info``:

    * ``reward_tracking = 1 / (1 + (offset / 0.3)^2)``, where ``offset`` is the true distance from the axis along
      y, in m;
    * ``reward_change = -0.05 (command - last command)^2``.

    ## Starting state

    The vehicle hovers at the scenario's offset, and the filter settles for 1.5 s in the standing jet. The seed gives fan path, offset
    and all noise.

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
    | `observe`     | `"wrench"`   | the view: `"wrench"`, `"wrench-without-fx"`, `"pose"` or `"history"`    |

    The task takes all arguments of ``windwrench.envs.Task``, too.
    ``metadata["render_modes"]`` of an environment lists the modes of this machine: without a display, no
    `"human"`. ``reset`` refuses any ``options``.

    ## Version history

    * v2: normalised, ``observation="wrench"``; truncates its episodes itself.
    * v1: ``normalize``, True by default; ``info`` has ``observation`` and ``command`` in SI units.
    * v0: v1 with ``normalize=False``, as an alias until 3.0.
    """  # noqa: E501

    name = "FanTracking"
    axes = (1,)
    limits: Any = LIMITS
    scales: Any = SCALES
    standard = Fan()

    def __init__(
        self,
        *shared: Any,
        fan_path: Callable[[Array], Array] | None = None,
        observe: str = "wrench",
        **named: Any,
    ) -> None:
        if observe not in _VIEWS:
            raise unknown_name("view", str(observe), _VIEWS, "FanTracking: observe")
        self.fan_path, self.view = fan_path, observe
        self.limits, self.scales = _VIEWS[observe]
        super().__init__(*shared, **named)

    def draw_path(self, rng: np.random.Generator) -> tuple[str, Array, Array]:
        """Return the motion's name, the fan's path, and the vehicle's start beside its axis."""
        label, fan_y = draw_fan_path(self.scenario, rng, self.times)
        if self.fan_path is not None:
            label, n = "given", self.times.size
            fan_y = np.asarray(self.fan_path(self.times), dtype=np.float64)
            if fan_y.shape != (n,) or not np.all(np.isfinite(fan_y)):
                raise InputError(
                    f"FanTracking: fan_path must return {n} finite numbers for {n} times"
                )
        offset = rng.uniform(*self.scenario.offset) * rng.choice([-1.0, 1.0])
        path = np.column_stack([fan_y, np.full(len(fan_y), self.fan.height)])
        return label, path, np.array([offset, 0.0])

    def off_axis(self, s: State) -> Array:
        """Return the vehicles' offsets (n, 1) m."""
        return s.position[:, 1:2] - s.fan[:, :1]

    def observe(self, s: State) -> Array:
        """Return the frame, or the part chosen by ``observe``."""
        frame, n = super().observe(s), len(s.time)
        if self.view == "history":
            past = s.memory.setdefault("past", np.zeros((n, FRAMES, frame.shape[1])))
            past[s.decision == 0] = frame[s.decision == 0, None]
            rows, now = np.arange(n), s.decision % FRAMES
            past[rows, now] = frame
            ordered = (now[:, None] + 1 + np.arange(FRAMES)) % FRAMES
            history: Array = past[rows[:, None], ordered].reshape(n, -1)
            return history
        if self.view == "pose":
            e = s.estimate
            w, i, j, k = e.quaternion.T
            yaw = np.arctan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k)) - math.pi
            tilt = 2.0 * (i * k + w * j), 2.0 * (j * k - w * i)
            turned = np.column_stack([*tilt, np.arctan2(np.sin(yaw), np.cos(yaw))])
            moved = e.position - s.first("place", e.position)
            return np.concatenate([moved, frame[:, 6:7], turned, frame[:, 7:]], axis=1)
        return frame[:, 1:] if self.view == "wrench-without-fx" else frame

    def is_lost(self, s: State) -> Mask:
        """Return whether each vehicle is lost (n,)."""
        away = np.abs(s.position - s.reference[:, :3])
        near = (away[:, 0] <= AWAY) & (away[:, 2] <= AWAY)
        return ~(s.flying & near & (np.abs(self.off_axis(s)[:, 0]) <= LOST_OFFSET))

    def info(self, s: State) -> dict[str, Any]:
        """Return the fan's motion and the true offset, force and torque."""
        y, fan_y = s.position[:, 1], s.fan[:, 0]
        entries = {
            "fan_y": fan_y,
            "fan_velocity": s.fan_velocity[:, 0],
            "y": y,
            "offset": y - fan_y,
        }
        if self.view != "wrench" and self.chosen is None:
            frame = np.clip(super().observe(s), -np.array(LIMITS), LIMITS)
            entries["observation"] = np.nan_to_num(frame).astype(np.float32)
        return {"time": s.time, "force": s.force, "torque": s.torque, **entries}


fan_tracking_vector = FanTrackingEnv.vector
