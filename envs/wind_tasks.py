"""The tasks in the wind: holding a point, and flying a trajectory."""

import math
from typing import Any, ClassVar

import numpy as np

from .. import _core
from ..controllers.wind_observation import (
    MAX_ACCELERATION,
    OBSERVATION_LIMITS,
    OBSERVATION_SCALES,
)
from ..dynamics.rotation import matrix_of
from ..runtime.arrays import Array
from .plant import TICK
from .state import Start, State
from .task import Task
from .wind_scenarios import START, draw_reference

CHANGE_COST = 0.032  # a change of an action from 0 to 1


class WindHoverEnv(Task):
    """A quadrotor must hold a point in turbulence and in front of a wall of switching fans.

    ## Description

    The scenario has the vehicle hover 2.3 m in front of a wall of 3 x 3 switching fans, in a sheared
    mean wind with turbulence, in gusts, or below another vehicle. An unscented Kalman filter
    turns rotor speeds and motion-capture pose into the external force and torque, at 200 Hz. A flight
    loop (position, velocity, a weak integral, attitude) flies to the reference by the estimated state.
    25 times a second the agent commands an acceleration, added to the flight loop's. The command must
    cancel the wind before the flight loop's error grows. The wind acts at 12 stations of the vehicle,
    each with its own airspeed.

    ## Action space

    ``Box(-4, 4, (3,), float32)``; with ``normalize=True`` ``Box(-1, 1, (3,), float32)``, in units of
    4 m/s2

    | Num | Action                                           | Min | Max | Unit |
    | --- | ------------------------------------------------ | --- | --- | ---- |
    | 0-2 | acceleration x, y, z (world), added to the flight loop's | -4  | 4   | m/s2 |

    An action out of range is clipped; an action that is not finite raises ``InputError``. The flight loop
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

    The accelerometer sits in the centre of mass. Its noise is 0.15 m/s2 a tick (5 ms), and its bias
    0.05 m/s2, drawn each episode. The estimated attitude turns the measurement into world axes. The
    filter does not use the accelerometer. Wind and true force are in ``info``, not in the observation.

    ## Rewards

    ``reward = reward_tracking + reward_change``, both in ``info``:

    * ``reward_tracking = 1 / (1 + (error / 0.1)^2)``, where ``error`` is the true distance from the
      reference, in m;
    * ``reward_change = -0.002 |action - last action|^2``, with actions in m/s2.

    ## Starting state

    The vehicle hovers at the start of the reference, 2.3 m in front of the wall and 1.5 m high, facing
    the wall. The filter settles for 1.5 s in the wind of time 0. The seed gives winds, reference and
    all noise. If the vehicle is lost before the episode begins, new winds are drawn.

    ## Episode end

    Terminated when the vehicle is lost: 2.5 m from the reference, on the floor, or tilted by more than
    70 degrees. Truncated after 20 s (500 decisions).

    ## Arguments

    ```python
    gym.make("windwrench/WindHover-v1", scenario="base", normalize=True, render_mode=None)
    ```

    | Parameter     | Default      | Description                                                          |
    | ------------- | ------------ | -------------------------------------------------------------------- |
    | `scenario`    | `"base"`     | one of `windwrench.envs.wind_scenarios.WIND_SCENARIOS`, or a `WindScenario` |
    | `action`      | `"acceleration"` | one of `windwrench.envs.ACTIONS`                                   |
    | `observation` | `"own"`      | one of `windwrench.envs.OBSERVATIONS`, or the table above; `"wrench"` in v2 |

    The task takes all arguments of ``windwrench.envs.Task``, too. ``reset`` refuses any ``options``.

    ## Version history

    * v2: normalised, ``observation="wrench"``; truncates its episodes itself.
    * v1: ``normalize``, True by default; ``info`` has ``observation`` and ``command`` in SI units.
    * v0: v1 with ``normalize=False``, as an alias until 3.0.
    """  # noqa: E501

    name = "WindHover"
    observation, normalize = "own", False
    largest_action = MAX_ACCELERATION
    limits, scales = OBSERVATION_LIMITS, OBSERVATION_SCALES
    moving: ClassVar[bool] = False  # whether the reference moves

    def start(self, rng: np.random.Generator, n: int) -> Start:
        """Draw winds and references; hover at their start."""
        winds = [self.draw_winds(rng) for _ in range(n)]
        drawn = [draw_reference(rng, math.pi, self.episode_s, self.moving) for _ in range(n)]
        labels, references = zip(*drawn, strict=True)
        return Start(np.tile([*START, math.pi], (n, 1)), references, winds, labels=labels)

    def observe(self, s: State) -> Array:
        """Return the task's own observation (n, 27)."""
        e, r = s.estimate, s.reference
        moved = [r[:, :3] - e.position, e.velocity, r[:, 3:9]]
        felt = [e.force, e.torque, s.specific_force, s.specific_thrust]
        return np.concatenate([*moved, *felt, s.command], axis=1)

    def reward_terms(self, s: State) -> dict[str, Any]:
        """Return ``tracking`` and ``change``."""
        return super().reward_terms(s) | {"change": -CHANGE_COST * s.change}

    def _truth(self) -> dict[str, Any]:
        """Return ``Task._truth``, the actuators' disturbance (6,) N and Nm, world, and the winds'
        wrench (foresight, 6) over each decision to come, at the vehicle's present place.
        """
        loop, R = self.loop, matrix_of(self.loop.quaternion)
        fan = loop.record["fan"].copy()
        com, ahead = loop.record[0]["plant"]["body"]["com"], np.empty((self.foresight, 6))
        jet, now = loop.jet_table, (loop.position, R, loop.world.qvel, com)
        period = TICK * self.decision_ticks
        at = loop.time + 0.5 * period
        for k in range(self.foresight):
            fan["air"] = loop.winds.velocity(loop.points.T, at + k * period)
            _core.jet_wrench(fan.ctypes.data, jet, *now, ahead[k])
        return super()._truth() | {
            "disturbance": loop.disturbance.copy(),
            "wrench_ahead": ahead,
        }


class WindTrajectoryEnv(WindHoverEnv):
    """A quadrotor must fly figures of eight and random splines through turbulence and jets.

    Action, observation, reward, episode end, arguments and scenarios equal those of
    ``WindHoverEnv``; the reference differs.

    ## Reference

    A lying figure of eight (1.0-1.4 m along, 0.4-0.6 m across, in 6-9 s, turned by any angle), or a
    spline. The spline has a random point of a box of 2.4 x 2.4 x 0.8 m every 1.5-2.2 s. The
    reference accelerates for 1.5 s. The flight loop gets position, velocity and acceleration of the
    reference, the agent observes velocity and acceleration.

    ```python
    gym.make("windwrench/WindTrajectory-v1", scenario="base", normalize=True, render_mode=None)
    ```

    ## Version history

    * v2: normalised, ``observation="wrench"``; truncates its episodes itself.
    * v1: ``normalize``, True by default; ``info`` has ``observation`` and ``command`` in SI units.
    * v0: v1 with ``normalize=False``, as an alias until 3.0.
    """

    name = "WindTrajectory"
    moving = True


wind_hover_vector = WindHoverEnv.vector
wind_trajectory_vector = WindTrajectoryEnv.vector
