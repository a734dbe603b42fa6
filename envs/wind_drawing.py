"""Drawing a flight in the wind: drops that drift with the air, a wall of fans, the reference."""

from typing import Any

import mujoco
import numpy as np

from ..dynamics.motion import Array
from .closed_loop import ClosedLoop
from .drawing import Viewer
from .scene_shapes import add_shape
from .wind import FanWall, Sum

_DROPS = 300
_LOW, _HIGH = np.array([0.2, -1.6, 0.2]), np.array([4.4, 1.6, 2.8])  # m, where drops are
WIND_SCALES = (0.5, 8.0)  # m per N, m per Nm
_FRAME = 0.04  # s
_AWAY = (0.0, 0.0, -50.0)  # m, where a fan is that is not there


class WindViewer(Viewer):
    """Draws a flight in winds; its scenery: the winds, the reference (3,) m, the time in s."""

    _close = False  # a trajectory goes from side to side
    _scales = WIND_SCALES
    _trail = 120

    def __init__(self, mode: str, width: int = 640, height: int = 480) -> None:
        super().__init__(mode, width, height)
        self._drops = self._new_drops(_DROPS)

    def _new_drops(self, count: int) -> Array:
        return self._rng.uniform(_LOW, _HIGH, (count, 3))

    def _drift(self, loop: ClosedLoop, scenery: Any) -> None:
        """Take the fan away, and carry the drops with the air for one frame."""
        winds, _, time = scenery
        loop.data.mocap_pos[0] = _AWAY
        self._air = Sum(*winds).velocity(self._drops, time)
        self._drops += _FRAME * self._air + 0.004 * self._rng.standard_normal(self._drops.shape)
        gone = np.any((self._drops < _LOW) | (self._drops > _HIGH), axis=1)
        gone |= self._rng.random(len(gone)) < 0.01
        self._drops[gone] = self._new_drops(int(gone.sum()))

    def _mark(self, scene: Any, loop: ClosedLoop, scenery: Any) -> None:
        """Add drops, walls of fans and the reference to a scene."""
        winds, reference, time = scenery
        sphere = mujoco.mjtGeom.mjGEOM_SPHERE
        for drop, speed in zip(self._drops, np.linalg.norm(self._air, axis=1), strict=True):
            colour = np.array([0.25, 0.55, 0.95, 0.08 + 0.1 * min(speed, 6.0)])
            add_shape(scene, sphere, np.full(3, 0.013), drop, colour)
        for wind in winds:
            if isinstance(wind, FanWall):
                _add_wall(scene, wind, time)
        add_shape(scene, sphere, np.full(3, 0.035), reference, np.array([0.95, 0.75, 0.10, 0.6]))


def _add_wall(scene: Any, wall: FanWall, time: float) -> None:
    """Append the fans of a wall, the brighter the faster they blow."""
    speeds = wall.speeds[min(int(time / 0.02), len(wall.speeds) - 1)]
    frame = np.column_stack([wall.axes[1], wall.axes[2], wall.axes[0]])
    for place, speed in zip(wall.places[0], speeds, strict=True):
        share = min(speed / 6.0, 1.0)
        colour = np.array([0.20 + 0.1 * share, 0.30 + 0.4 * share, 0.40 + 0.55 * share, 1.0])
        shape = add_shape(
            scene,
            mujoco.mjtGeom.mjGEOM_CYLINDER,
            np.array([wall.radius, 0.03, 0.0]),
            place,
            colour,
        )
        if shape is not None:
            shape.mat[:] = frame
