"""Drawing the world in a window or as a picture: drops adrift in the air, fans, the reference, the
wrench as arrows, and the path flown.
"""

import math
import time
from typing import Any

import mujoco
import numpy as np

from .. import _core
from ..runtime.arrays import Array, Picture
from ..runtime.errors import InputError
from .closed_loop import ClosedLoop
from .display import need_display
from .scene_shapes import add_path, add_shadow, add_shape, add_wrench
from .wind import FanWall

# degrees of a picture of 4:3 from top to bottom; a wider one shows less there
_FIELD = 48.0
SCALES = (1.6, 25.0)  # m per N, m per Nm
_WIND_SCALES = (0.5, 8.0)  # likewise, of the tasks in the wind
_TRAIL = 120  # pictures of path behind the vehicle
_DROPS = 300
# m: corners of the box of drops, from the fan; and of the tasks in the wind, in the world
_BOX = np.array([[0.1, -0.6, -0.6], [3.6, 0.6, 0.6]])
_WIND_BOX = np.array([[0.2, -1.6, 0.2], [4.4, 1.6, 2.8]])
_STILL = 0.4  # m/s, below which drops are not shown
_AWAY = (0.0, 0.0, -50.0)  # m, place of a fan out of sight
_SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE


class Viewer:
    """Draws a closed loop, in the wind or in the jet of a fan.

    Args:
        mode: ``"rgb_array"`` for pictures, ``"human"`` for a window.
        width: pixels.
        height: likewise.

    Raises:
        InputError: a window without a display; when drawing, a machine without a way to draw.
    """

    def __init__(self, mode: str, width: int = 640, height: int = 480) -> None:
        if mode == "human":
            need_display()
        self.mode, self.width, self.height = mode, width, height
        self._renderer: Any = None
        self._window: Any = None
        self._model: Any = None
        self.scales = SCALES  # the last arrows'
        self._path: list[Array] = []
        self._last = math.inf  # s, of the loop's clock
        self._begun = 0.0  # s, of the wall's clock, at its start
        # drops only decorate, so their generator is their own
        self._rng = np.random.default_rng(0)
        self._drops = np.full((_DROPS, 3), np.nan)  # m; drawn anew outside the box

    def _open(self, model: Any, data: Any, near: bool) -> None:
        """Make ready to draw a new model; ``near``: a wide picture shows as much from side to side
        as one of 4:3.
        """
        if self._model is model:
            return
        self.close()
        self._model = model
        try:
            if self.mode == "human":
                from mujoco import viewer

                self._window = viewer.launch_passive(
                    model, data, show_left_ui=False, show_right_ui=False
                )
                camera = self._window.cam
                camera.lookat[:], camera.distance = (1.3, 0.0, 1.1), 4.5
                camera.azimuth, camera.elevation = 140, -22
            else:
                if near:
                    up = math.tan(math.radians(_FIELD) / 2)
                    across = up * 4 / 3 * self.height / self.width
                    model.cam_fovy[:] = math.degrees(2 * math.atan(min(up, across)))
                self._renderer = mujoco.Renderer(model, self.height, self.width)
        # the errors of a missing OpenGL differ from one backend to the next
        except Exception as error:
            raise InputError(
                f"render: this machine cannot draw ({error}). Without a screen, set MUJOCO_GL=egl "
                f"or MUJOCO_GL=osmesa and "
                "install Debian's libegl1 or libosmesa6"
            ) from error

    def draw(self, loop: ClosedLoop, goal: Array | None = None) -> Picture | None:
        """Draw the loop as it is now, in the wind with its ``goal`` (3,) m; return the picture
        (height, width, 3), or None from a window.
        """
        in_wind = goal is not None
        self.scales = _WIND_SCALES if in_wind else SCALES
        self._open(loop.model, loop.data, not in_wind)
        step = min(loop.time - self._last, 0.08)
        if step < 0.0:  # another episode
            self._path.clear()
            self._begun, step = time.perf_counter() - loop.time, 0.0
        self._last = loop.time
        if self.mode == "human":  # not faster than life
            time.sleep(max(self._begun + loop.time - time.perf_counter(), 0.0))
        self._path.append(loop.position.copy())
        air = self._drift(loop, step, in_wind)
        mujoco.mj_kinematics(loop.model, loop.data)
        if self._window is not None:
            with self._window.lock():
                self._window.user_scn.ngeom = 0
                self._mark(self._window.user_scn, loop, air, goal)
            self._window.sync()
            return None
        self._renderer.update_scene(loop.data, camera="chase")
        self._mark(self._renderer.scene, loop, air, goal)
        picture: Picture = self._renderer.render()
        return picture

    def _mark(self, scene: Any, loop: ClosedLoop, air: Array, goal: Array | None) -> None:
        """Add drops, fans, the goal, the path and the wrench to a scene."""
        for drop, speed in zip(self._drops, np.linalg.norm(air, axis=1), strict=True):
            colour = np.array([0.25, 0.55, 0.95, 0.08 + 0.1 * min(speed, 6.0)])
            if speed > _STILL:
                add_shape(scene, _SPHERE, np.full(3, 0.013), drop, colour)
        for wind in loop.winds.winds:
            if isinstance(wind, FanWall):
                _add_wall(scene, wind, loop.time)
        if goal is not None:
            yellow = np.array([0.95, 0.75, 0.10, 0.6])
            add_shape(scene, _SPHERE, np.full(3, 0.035), goal, yellow)
        at, true, seen = loop.position, loop.external, loop.state
        add_shadow(scene, at)
        add_path(scene, self._path[-_TRAIL:])
        add_wrench(scene, at, true[:3], true[5], self.scales, True)
        add_wrench(scene, at, seen[16:19], seen[15], self.scales, False)

    def _drift(self, loop: ClosedLoop, step: float, in_wind: bool) -> Array:
        """Place the fan, and carry the drops with the air for ``step`` s; return the air (n, 3)
        m/s.
        """
        fan, drops = loop.record["fan"].copy(), self._drops
        place = np.array([0.0, fan["y"][0], fan["height"][0]])
        loop.data.mocap_pos[0] = _AWAY if in_wind else place
        low, high = _WIND_BOX if in_wind else place + _BOX
        gone = ~np.all((drops >= low) & (drops <= high), axis=1) | (self._rng.random(_DROPS) < 0.01)
        drops[gone] = self._rng.uniform(low, high, (int(gone.sum()), 3))
        air = loop.winds.velocity(drops, max(loop.time, 0.0))
        jet = np.empty_like(air)
        _core.jet_at(fan.ctypes.data, loop.jet_table, drops, jet)
        air += jet
        drops += step * air + 0.004 * self._rng.standard_normal(drops.shape)
        return air

    def pixels_per_metre(self, at: Array) -> float:
        """Return the pixels of a metre across the last picture at a place (3,) m."""
        view = self._renderer.scene.camera[0]
        depth = float((np.asarray(at) - np.asarray(view.pos)) @ np.asarray(view.forward))
        across = float(view.frustum_top - view.frustum_bottom) / float(view.frustum_near)
        return self.height / max(across * depth, 1e-6)

    def close(self) -> None:
        """Close the window or free the renderer."""
        for thing in (self._window, self._renderer):
            if thing is not None:
                thing.close()
        self._window = self._renderer = self._model = None


def _add_wall(scene: Any, wall: FanWall, time: float) -> None:
    """Append the fans of a wall, the brighter the faster they blow."""
    speeds = wall.speeds[min(int(time / 0.02), len(wall.speeds) - 1)]
    frame = np.column_stack([wall.axes[1], wall.axes[2], wall.axes[0]])
    size = np.array([wall.radius, 0.03, 0.0])
    for place, speed in zip(wall.places[0], speeds, strict=True):
        share = min(speed / 6.0, 1.0)
        colour = np.array([0.20 + 0.1 * share, 0.30 + 0.4 * share, 0.40 + 0.55 * share, 1.0])
        shape = add_shape(scene, mujoco.mjtGeom.mjGEOM_CYLINDER, size, place, colour)
        if shape is not None:
            shape.mat[:] = frame
