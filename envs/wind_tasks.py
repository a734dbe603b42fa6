"""The tasks in the wind: holding a point, and flying a trajectory."""

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ..controllers.flight import FlightGains
from ..controllers.wind_observation import (
    MAX_ACCELERATION,
    OBSERVATION_LIMITS,
    OBSERVATION_SCALES,
    WIND_OBSERVATION_SIZE,
    WIND_PERIOD,
)
from ..dynamics.motion import Array
from ..dynamics.rotation import quaternion_to_matrix
from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import compiled, specialised
from ..runtime.errors import InputError
from .closed_loop import ClosedLoop
from .fan import Fan, jet_wrench
from .plant import TICK
from .task import EPISODE_SECONDS, LOST_OFFSET, SETTLE_TICKS, Frame, Task, keep_within
from .wind import Sum, Wind
from .wind_scenarios import HEIGHT, START, WIND_SCENARIOS, draw_reference, draw_winds

WIND_DECISION_TICKS = 8  # 25 Hz
WIND_DECISIONS = round(EPISODE_SECONDS / TICK / WIND_DECISION_TICKS)
TRACKING_WIDTH = 0.1  # m, error at which the tracking reward is a half
CHANGE_COST = 0.002  # per (m/s2)^2 of change of the action
_DRAWS = 20  # of an episode's winds, until the vehicle is not lost in them at once
# m/s2, standard deviation of the accelerometer's noise a tick, and of its bias
ACCELEROMETER = (0.15, 0.05)
_LIMITS = np.array(OBSERVATION_LIMITS)


def _square(vector: Array) -> float:
    """Return the squared length of a vector (3,)."""
    x, y, z = vector.tolist()
    return float(x * x + y * y + z * z)


@compiled
def see(
    x: Array, reference: Array, specific: Array, thrust: Array, action: Array, frame: Frame
) -> None:
    """Write the frame (27,) of an estimated state (20,) and the reference (10,), within limits."""
    for i in range(3):
        frame[i], frame[3 + i] = reference[i] - x[i], x[7 + i]  # position error, velocity
        frame[6 + i], frame[9 + i] = reference[3 + i], reference[6 + i]
        frame[12 + i], frame[15 + i] = x[16 + i], x[13 + i]  # force, torque
        frame[18 + i], frame[21 + i], frame[24 + i] = specific[i], thrust[i], action[i]
    keep_within(frame, _LIMITS)


class WindHoverEnv(Task):
    """A quadrotor must hold a point in turbulence and in front of a wall of fans that switch.

    ## Description

    A quadrotor hovers 2.3 m in front of a wall of 3 x 3 fans that switch by themselves, in a
    sheared mean wind with turbulence, in gusts, or below another vehicle: what blows is its scenario's. It
    must stay where it is. An unscented Kalman filter turns rotor speeds and motion-capture pose into the
    external force and torque, at 200 Hz, and a flight loop (position, velocity, a weak integral,
    attitude) flies to the reference by the estimated state. The agent commands an acceleration
    beside the flight loop's own, 25 times a second: it must cancel what the wind does before the
    flight loop's error grows. The wind acts at 12 stations of the vehicle, each in its own air.

    ## Action space

    ``Box(-4, 4, (3,), float32)``; with ``normalize=True`` ``Box(-1, 1, (3,), float32)``, in units of
    4 m/s2

    | Num | Action                                           | Min | Max | Unit |
    | --- | ------------------------------------------------ | --- | --- | ---- |
    | 0-2 | acceleration x, y, z (world) beside the flight loop's | -4  | 4   | m/s2 |

    An action out of range is clipped; one that is not finite raises ``InputError``. The flight loop
    limits its tilt to 0.5 rad.

    ## Observation space

    ``Box(-limit, limit, (27,), float32)``, in SI units, world axes; with ``normalize=True`` divided by
    the scale

    | Num   | Observation                                             | Limit | Scale | Unit |
    | ----- | ------------------------------------------------------- | ----- | ----- | ---- |
    | 0-2   | reference less estimated position                        | 5     | 0.2   | m    |
    | 3-5   | estimated velocity                                       | 10    | 1     | m/s  |
    | 6-8   | velocity of the reference                                | 10    | 1     | m/s  |
    | 9-11  | acceleration of the reference                            | 20    | 2     | m/s2 |
    | 12-14 | estimated external force                                 | 10    | 1     | N    |
    | 15-17 | estimated external torque                                | 1     | 0.03  | Nm   |
    | 18-20 | specific force of an accelerometer, mean over the 40 ms  | 40    | 10    | m/s2 |
    | 21-23 | specific force of the rotors by the declared model, likewise | 40 | 10    | m/s2 |
    | 24-26 | last action                                              | 4     | 4     | m/s2 |

    The accelerometer sits in the centre of mass and has a noise of 0.15 m/s2 a tick (5 ms) and a bias of
    0.05 m/s2, drawn each episode; it is turned into the world by the estimated attitude. The filter does
    not use it. Wind and true force are not observed: ``info`` has them.

    ## Rewards

    ``reward = reward_tracking + reward_change``, each of them in ``info``:

    * ``reward_tracking = 1 / (1 + (error / 0.1)^2)``, where ``error`` is the true distance from the
      reference, in m;
    * ``reward_change = -0.002 |action - last action|^2``, with actions in m/s2.

    ## Starting state

    The vehicle hovers at the start of the reference, 2.3 m in front of the wall and 1.5 m high, facing
    it, for 1.5 s in the wind of time 0, in which the filter settles. Winds, reference and all noise are
    drawn from the seed; winds in which the vehicle is lost before the episode begins are drawn anew.

    ## Episode end

    Terminated when the vehicle is lost: 2.5 m from the reference, on the floor, or tilted by more than
    70 degrees. Truncated after 20 s (500 decisions).

    ## Arguments

    ```python
    gym.make("windwrench/WindHover-v0", scenario="base", render_mode=None)
    ```

    | Parameter     | Default      | Description                                                          |
    | ------------- | ------------ | -------------------------------------------------------------------- |
    | `scenario`    | `"base"`     | one of `windwrench.envs.wind_scenarios.WIND_SCENARIOS`, or a `WindScenario` |
    | `winds`       | `None`       | winds in place of the scenario's: any object with ``velocity(points, time)`` |
    | `model_in_loop` | `True`     | whether the flight loop counters the effects that `vehicle` declares    |
    | `gains`       | `None`       | a `FlightGains`: of the flight loop                                    |

    All arguments of ``windwrench.envs.task.Task`` come beside these. ``reset`` refuses any ``options``.

    ## Version history

    * v0: initial version.
    """  # noqa: E501

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 25}  # noqa: RUF012
    name = "WindHover"
    moving: ClassVar[bool] = False  # whether the reference moves
    scenarios = WIND_SCENARIOS
    decision_ticks = WIND_DECISION_TICKS
    action_size = 3
    largest_action = MAX_ACCELERATION
    action_unit = "m/s2"

    def __init__(
        self,
        *shared: Any,
        winds: Sequence[Wind] | None = None,
        model_in_loop: bool = True,
        gains: FlightGains | None = None,
        **named: Any,
    ) -> None:
        super().__init__(*shared, **named)
        self.winds = None if winds is None else Sum(*winds, where=f"{self.name}: winds").winds
        self.model_in_loop, self.gains = bool(model_in_loop), gains
        self._observe(_LIMITS, OBSERVATION_SCALES)
        self.reference_name = ""
        self.blowing: Sequence[Wind] = []
        self._compile()

    def _compile(self) -> None:
        frame, three = np.empty(WIND_OBSERVATION_SIZE, dtype=np.float32), np.empty(3)
        self._see = specialised(see, np.empty(20), np.empty(10), three, three, three, frame)

    def make_loop(self, vehicle: Vehicle, fan: Fan, **given: Any) -> ClosedLoop:
        """Return the closed loop of a true vehicle, with an accelerometer."""
        return super().make_loop(
            vehicle,
            fan,
            gains=self.gains,
            accelerometer=ACCELEROMETER,
            model_in_loop=self.model_in_loop,
            **given,
        )

    def _begin(self) -> None:
        """Draw winds and reference, anew where the winds carry the vehicle off before the episode
        is the agent's.
        """
        self._draw_loop(Fan(speed=0.0, height=HEIGHT))
        rng = self.np_random
        for _ in range(_DRAWS):
            drawn = draw_winds(self.scenario, rng, EPISODE_SECONDS)
            self.blowing = drawn if self.winds is None else self.winds
            self.reference_name, self._reference = draw_reference(
                rng, math.pi, EPISODE_SECONDS, self.moving
            )
            self.loop.reset(rng, START, math.pi, self.blowing, self._reference, settle=SETTLE_TICKS)
            if not self._get_info()["lost"]:
                return
        raise InputError(
            f"{self.name}: the vehicle is lost before the episode begins in {_DRAWS} draws of "
            f"these winds; expected winds that its flight loop can hold for 1.5 s"
        )

    def _fly(self, noise: Array) -> None:
        self.loop.action[:] = self.command
        self.loop.run(noise)

    def _row(self) -> Array:
        """Return the reference (10,) now."""
        row: Array = self._reference[min(max(self.loop.ticks, 0), len(self._reference) - 1)]
        return row

    def _get_obs(self) -> Frame:
        loop, frame = self.loop, np.empty(WIND_OBSERVATION_SIZE, dtype=np.float32)
        self._see(loop.state, self._row(), loop.specific, loop.thrust, loop.action, frame)
        return frame / self._scales if self.normalize else frame

    def _get_info(self) -> dict[str, Any]:
        loop, reference, position = self.loop, self._row()[:3], self.loop.position.copy()
        error = math.sqrt(_square(position - reference))
        flying = self.is_flying() and position.item(2) > 0.0 and error <= LOST_OFFSET
        return {
            "error": error,
            "position": position,
            "reference": reference.copy(),
            "force": loop.external[:3].copy(),
            "torque": loop.external[3:].copy(),
            "wind": loop.wind,
            "time": loop.time,
            "lost": not flying,
            "trajectory": self.reference_name,
        }

    def _get_reward(self, info: dict[str, Any], change: Array) -> dict[str, float]:
        square = _square(info["position"] - info["reference"])
        return {
            "reward_tracking": 1.0 / (1.0 + square / (TRACKING_WIDTH * TRACKING_WIDTH)),
            "reward_change": -CHANGE_COST * _square(change),
        }

    def _truth(self) -> dict[str, Any]:
        """Return beside ``Task._truth`` the actuators' disturbance (6,) N and Nm, world, and the
        wrench (foresight, 6) of the winds over each decision to come, where the vehicle is now.
        """
        loop, R, wind = self.loop, np.empty((3, 3)), np.empty(3)
        fan = loop.record["fan"].copy()[0]
        quaternion_to_matrix(loop.quaternion, R)
        moving = loop.velocity, loop.motion[1][3:6], loop.record[0]["plant"]["body"]["com"]
        ahead, (axial, radial) = np.empty((self.foresight, 6)), loop.jet_table
        at, blowing = loop.time + 0.5 * WIND_PERIOD, Sum(*self.blowing)
        for k in range(self.foresight):
            fan["air"] = blowing.velocity(loop.points.T, at + k * WIND_PERIOD)
            jet_wrench(fan, axial, radial, loop.position, R, *moving, wind, ahead[k])
        return super()._truth() | {
            "disturbance": loop.disturbance.copy(),
            "wrench_ahead": ahead,
        }

    def _make_viewer(self) -> Any:
        from .wind_drawing import WindViewer

        return WindViewer(self.render_mode or "", self.width, self.height)

    def _scenery(self) -> Any:
        return self.blowing, self._row()[:3], self.loop.time


class WindTrajectoryEnv(WindHoverEnv):
    """A quadrotor must fly figures of eight and random splines through turbulence and jets.

    Action, observation, reward, episode end and arguments are those of ``WindHoverEnv``; the
    scenarios are those of ``WindHover``, too. What differs is the reference.

    ## Reference

    A lying figure of eight (1.0-1.4 m along, 0.4-0.6 m across, in 6-9 s, turned by any angle), or a
    spline through random points of a box of 2.4 x 2.4 x 0.8 m, one every 1.5-2.2 s. The reference
    gets up to speed in 1.5 s. The flight loop is given its position, velocity and acceleration, and
    the agent sees its velocity and acceleration.

    ```python
    gym.make("windwrench/WindTrajectory-v0", scenario="base", render_mode=None)
    ```

    ## Version history

    * v0: initial version.
    """

    name = "WindTrajectory"
    moving = True


__all__ = ["WIND_DECISIONS", "WIND_DECISION_TICKS", "WindHoverEnv", "WindTrajectoryEnv"]
