"""Fan tracking in two directions: the fan moves sideways and up and down."""

import math
from typing import Any

import numpy as np

from ..dynamics.motion import Array
from ..dynamics.vehicle import Vehicle
from .fan import Fan
from .fan_tracking import AWAY, CHANGE_COST, DISTANCE, FAN_TIMES, TRACKING_WIDTH, FanTask
from .plant import TICK
from .scenarios import draw_fan_path
from .task import LOST_OFFSET, SETTLE_TICKS, Frame, keep_within

FAN_HEIGHT = 1.5  # m, of the fan's axis at the start
CAGE = 0.6  # rad, of the cage's stations above and below the rotors' plane
_VERTICAL = 0.5  # of the scenario's speeds and travels that the fan moves up and down with
_LIMITS = np.array([10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, 5.0, 1.0, 1.0])
SCALES_2D = (0.5, 0.5, 0.5, 0.03, 0.03, 0.03, 0.5, 0.5, 1.0, 1.0)


class FanTracking2DEnv(FanTask):
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
    | `fan`         | `None`       | a `Fan`, in place of the standard one with a cage                  |

    All arguments of ``windwrench.envs.task.Task`` come beside these. ``reset`` refuses any ``options``.

    ## Version history

    * v0: initial version.
    """  # noqa: E501

    name = "FanTracking2D"
    action_size = 2

    def __init__(self, *shared: Any, fan: Fan | None = None, **named: Any) -> None:
        fan = fan or Fan(height=FAN_HEIGHT, hull_elevation=CAGE)
        super().__init__(*shared, fan=fan, **named)
        self._observe(_LIMITS, SCALES_2D)

    def make_loop(self, vehicle: Vehicle, fan: Fan, **given: Any) -> Any:
        """Return the closed loop; its accelerometer, which nobody reads, uses three more normals of
        a tick, of which the episodes of this version are made.
        """
        return super().make_loop(vehicle, fan, accelerometer=(0.0, 0.0), **given)

    def _begin(self) -> None:
        rng, scenario = self.np_random, self.scenario
        distance = self._draw_loop(self.fan).get("distance", DISTANCE)
        sideways, _, y = draw_fan_path(scenario, rng, FAN_TIMES)
        upwards, _, z = draw_fan_path(scenario, rng, FAN_TIMES)
        self.fan_motion = f"{sideways} and {upwards}"
        path = np.column_stack([y, self.fan.height + _VERTICAL * z])
        offset, side = float(rng.uniform(*scenario.offset)), float(rng.uniform(-math.pi, math.pi))
        beside = offset * np.array([math.cos(side), 0.5 * math.sin(side)])
        self._start(path, distance, SETTLE_TICKS, beside)

    def _get_obs(self) -> Frame:
        x = self.loop.state
        frame = np.concatenate([x[16:19], x[13:16], x[8:10], self.command]).astype(np.float32)
        keep_within(frame, _LIMITS)
        return frame / self._scales

    def _get_info(self) -> dict[str, Any]:
        loop, path = self.loop, self.path
        k = min(loop.ticks, len(path) - 1)
        fan = path[max(k - 1, 0)]
        x, y, z = loop.position.tolist()
        offset = math.hypot(y - fan[0], z - fan[1])
        flying = (
            self.is_flying()
            and offset <= LOST_OFFSET
            and abs(x - self.distance) <= AWAY
            and z > 0.0
        )
        return {
            "fan": fan.copy(),
            "fan_velocity": (path[k] - fan) / TICK if k > 0 else np.zeros(2),
            "position": np.array([y, z]),
            "error": offset,
            "force": loop.external[:3].copy(),
            "torque": loop.external[3:].copy(),
            "time": loop.time,
            "lost": not flying,
            "fan_motion": self.fan_motion,
        }

    def _get_reward(self, info: dict[str, Any], change: Array) -> dict[str, float]:
        return {
            "reward_tracking": 1.0 / (1.0 + (info["error"] / TRACKING_WIDTH) ** 2),
            "reward_change": -CHANGE_COST * float(change @ change),
        }
