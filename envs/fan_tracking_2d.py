"""Fan tracking in two directions: the fan moves sideways and up and down."""

import math
from typing import Any

import numpy as np

from ..runtime.arrays import Array, Mask
from .definition import LOST_OFFSET
from .fan import Fan
from .fan_task import AWAY, LIMITS, SCALES, FanTask
from .scenarios import draw_fan_path
from .state import State

FAN_HEIGHT = 1.5  # m, of the fan's axis at the start
CAGE = 0.6  # rad, of the cage's stations above and below the rotors' plane
_VERTICAL = 0.5  # share of the scenario's speeds and travels, up and down
SCALES_2D = (*SCALES[:7], *SCALES[6:], SCALES[7])


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

    * v2: normalised, ``observation="wrench"``; truncates its episodes itself.
    * v1: ``normalize``, True by default; ``info`` has ``observation`` and ``command`` in SI units.
    * v0: v1 with ``normalize=False``, as an alias until 3.0.
    """  # noqa: E501

    name = "FanTracking2D"
    axes = (1, 2)
    limits, scales = (*LIMITS[:7], *LIMITS[6:], LIMITS[7]), SCALES_2D
    standard = Fan(height=FAN_HEIGHT, hull_elevation=CAGE)
    # not read; the episodes of this version rest on the three normals a tick behind it
    accelerometer = (0.0, 0.0)

    def draw_path(self, rng: np.random.Generator) -> tuple[str, Array, Array]:
        """Return the motions' names, the fan's path, and the vehicle's start beside its axis."""
        sideways, y = draw_fan_path(self.scenario, rng, self.times)
        upwards, z = draw_fan_path(self.scenario, rng, self.times)
        path = np.column_stack([y, self.fan.height + _VERTICAL * z])
        offset = rng.uniform(*self.scenario.offset)
        side = rng.uniform(-math.pi, math.pi)
        beside = offset * np.array([math.cos(side), 0.5 * math.sin(side)])
        return f"{sideways} and {upwards}", path, beside

    def off_axis(self, s: State) -> Array:
        """Return the vehicles' offsets (n, 2) m."""
        return s.position[:, 1:] - s.fan

    def is_lost(self, s: State) -> Mask:
        """Return whether each vehicle is lost (n,)."""
        near = np.abs(s.position[:, 0] - s.reference[:, 0]) <= AWAY
        error = np.hypot(*self.off_axis(s).T)
        lost: Mask = ~(s.flying & near & (s.position[:, 2] > 0.0) & (error <= LOST_OFFSET))
        return lost

    def info(self, s: State) -> dict[str, Any]:
        """Return the fan's motion and the true place, force and torque."""
        entries = {"fan": s.fan, "fan_velocity": s.fan_velocity, "position": s.position[:, 1:]}
        error = np.hypot(*self.off_axis(s).T)
        return {"time": s.time, "force": s.force, "torque": s.torque, "error": error, **entries}


fan_tracking_2d_vector = FanTracking2DEnv.vector
