"""Fan tracking in two directions: the fan moves sideways and up and down."""

import math
from typing import Any

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import compiled_without_gil
from .fan import Fan
from .fan_tracking import AWAY, CHANGE_COST, FAN_TIMES, TRACKING_WIDTH, FanTask
from .observing import Episodes, Motion
from .plant import TICK
from .scenarios import draw_fan_path
from .task import (
    COMMON_VALUES,
    LOST_OFFSET,
    Frame,
    is_flying,
    keep_within,
    note,
    vehicle_of,
)

FAN_HEIGHT = 1.5  # m, of the fan's axis at the start
CAGE = 0.6  # rad, of the cage's stations above and below the rotors' plane
_VERTICAL = 0.5  # share of the scenario's speeds and travels, up and down
_LIMITS = np.array([10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, 5.0, 1.0, 1.0])
SCALES_2D = (0.5, 0.5, 0.5, 0.03, 0.03, 0.03, 0.5, 0.5, 1.0, 1.0)


@compiled_without_gil
def look_across(
    which: np.ndarray, episodes: Episodes, motion: Motion, frames: Frame, values: np.ndarray
) -> None:
    """Write frames and values of ``FanTracking2DEnv`` for the episodes ``which``."""
    for n in np.flatnonzero(which):
        p, v, wrench, x = vehicle_of(motion, n)
        path, value, frame, change = episodes.paths[n], values[n], frames[n], 0.0
        for i in range(3):
            frame[i], frame[3 + i] = x[16 + i], x[13 + i]
        k = min(episodes.ticks[n], len(path) - 1)
        for i in range(2):
            frame[6 + i], frame[8 + i] = x[8 + i], episodes.commands[n, i]
            value.fan[i], value.position[i] = path[max(k - 1, 0), i], p[1 + i]
            value.fan_velocity[i] = (path[k, i] - value.fan[i]) / TICK
            change += episodes.changes[n, i] ** 2
        keep_within(frame, _LIMITS)
        value.error = math.hypot(p[1] - value.fan[0], p[2] - value.fan[1])
        square = (value.error / TRACKING_WIDTH) ** 2
        note(value, episodes, n, wrench, square, -CHANGE_COST * change)
        # in this form a number that is not finite counts as lost
        value.lost = episodes.broken[n] or not (
            is_flying(x, p, v)
            and value.error <= LOST_OFFSET
            and abs(p[0] - episodes.distance[n]) <= AWAY
            and p[2] > 0.0
        )


class FanTracking2DEnv(FanTask):
    """A quadrotor in a spherical cage must stay on the axis of a fan that moves in y and z.

    The filter, the times, the arguments ``scenario`` and ``fan``, and refusals are as in
    ``FanTrackingEnv``.

    ## Description

    A drum fan blows along +x and moves along y and along z. The quadrotor flies in a cage: the wind acts
    on its hull at stations in turn 0.15 m above and below the rotors. Off the axis in height the jet
    pitches the vehicle, and sideways turns it. A flat ring, as in ``FanTracking``, would feel no torque
    of a vertical offset.

    ## Action space

    ``Box(-1, 1, (2,), float32)``: commanded velocity along the world's y and z, m/s.

    ## Observation space

    ``Box(-limit, limit, (10,), float32)``, in SI units; with ``normalize=True`` divided by the scale

    | Num | Observation                               | Limit | Scale | Unit |
    | --- | ----------------------------------------- | ----- | ----- | ---- |
    | 0-2 | estimated external force x, y, z (world)  | 10    | 0.5   | N    |
    | 3-5 | estimated external torque x, y, z (world) | 1     | 0.03  | Nm   |
    | 6-7 | own estimated velocity along y and z      | 5     | 0.5   | m/s  |
    | 8-9 | last command                              | 1     | 1     | m/s  |

    Above the axis the world's ``tau_y`` is negative, at positive y its ``tau_z`` is positive.

    ## Rewards

    Those of ``FanTracking`` of ``offset = sqrt(dy^2 + dz^2)``, the true distance from the axis in m, and
    of ``|command - last command|``.

    ## Starting state

    The vehicle hovers off the axis by what the scenario says, on a side drawn at random. The fan's axis
    starts at 1.5 m. Along y it moves as in ``FanTracking``, along z as a second path drawn from the same
    scenario, half as fast and as far.

    ## Episode end

    As in ``FanTracking``, but for the height: on the floor the vehicle is lost.

    ## Version history

    * v1: ``normalize``, True by default; ``info`` has ``observation`` and ``command`` in SI units.
    * v0: v1 with ``normalize=False``, as an alias until 3.0.
    """  # noqa: E501

    name = "FanTracking2D"
    action_size = 2

    look = look_across
    values = np.dtype(
        [
            *COMMON_VALUES,
            *[(name, "f8", (2,)) for name in ("fan", "fan_velocity", "position")],
            ("error", "f8"),
        ],
        align=True,
    )
    limits, scales = tuple(_LIMITS), SCALES_2D

    def __init__(self, *shared: Any, fan: Fan | None = None, **named: Any) -> None:
        fan = fan or Fan(height=FAN_HEIGHT, hull_elevation=CAGE)
        super().__init__(*shared, fan=fan, **named)

    def make_loop(self, vehicle: Vehicle, fan: Fan, **given: Any) -> Any:
        """Return the closed loop. Its accelerometer is not read; the episodes of this version rest
        on the three normals a tick behind it.
        """
        return super().make_loop(vehicle, fan, accelerometer=(0.0, 0.0), **given)

    def hover(self) -> None:
        """Draw a path of the fan, and place the vehicle in hover beside its start."""
        rng, scenario = self.np_random, self.scenario
        sideways, y = draw_fan_path(scenario, rng, FAN_TIMES)
        upwards, z = draw_fan_path(scenario, rng, FAN_TIMES)
        self.drawn_label = f"{sideways} and {upwards}"
        path = np.column_stack([y, self.fan.height + _VERTICAL * z])
        offset, side = float(rng.uniform(*scenario.offset)), float(rng.uniform(-math.pi, math.pi))
        beside = offset * np.array([math.cos(side), 0.5 * math.sin(side)])
        self._start(path, beside)
