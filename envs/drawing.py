"""Drawing the world: the jet as drifting tracers, the wrench as arrows, the path flown, in a window
or as a picture.
"""

import math
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..runtime.errors import InputError
from .closed_loop import ClosedLoop
from .display import need_display
from .fan import jet_at
from .scene_shapes import add_path, add_shadow, add_shape, add_wrench

_TRACERS = 220
_FIELD = (
    48.0  # degrees that a picture of 4:3 shows from top to bottom; a wider one shows less there
)
SCALES = (1.6, 25.0)  # m per N, m per Nm


class Viewer:
    """Draws a closed loop.

    Args:
        mode: ``"rgb_array"`` for pictures, ``"human"`` for a window.
        width: of the picture, in pixels.
        height: likewise.

    Raises:
        InputError: a window where there is no display; when it is to draw, also that this machine
            has no way to do it.
    """

    _close = True  # a wide picture shows as much from side to side as one of 4:3
    _scales = SCALES
    _trail = 0  # pictures back that the path is shown for; 0: all

    def __init__(self, mode: str, width: int = 640, height: int = 480) -> None:
        if mode == "human":
            need_display()
        self.mode, self.width, self.height = mode, width, height
        self._renderer: Any = None
        self._window: Any = None
        self._model: Any = None
        self._path: list[NDArray[np.float64]] = []
        self._last = math.inf  # s, of the loop's clock
        self._begun = 0.0  # s, of the wall's clock, at its start
        # tracers drift with the jet; they only decorate, so their generator is their own
        self._rng = np.random.default_rng(0)
        self._tracers = self._new_tracers(_TRACERS)
        self._tracers[:, 0] = self._rng.uniform(0.2, 3.6, _TRACERS)

    def _new_tracers(self, count: int) -> NDArray[np.float64]:
        radius, angle = (
            0.45 * np.sqrt(self._rng.random(count)),
            self._rng.uniform(0, 2 * math.pi, count),
        )
        return np.stack(
            [np.full(count, 0.2), radius * np.cos(angle), radius * np.sin(angle)], axis=1
        )

    def open_world(self, model: Any, data: Any) -> None:
        """Make ready to draw a model, unless it is the one that was drawn last.

        Raises:
            InputError: this machine has no way to draw.
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
                self._window.cam.lookat[:] = (1.3, 0.0, 1.1)
                self._window.cam.distance, self._window.cam.azimuth, self._window.cam.elevation = (
                    4.5,
                    140,
                    -22,
                )
            else:
                if self._close:
                    up = math.tan(math.radians(_FIELD) / 2)
                    across = up * 4 / 3 * self.height / self.width
                    model.cam_fovy[:] = math.degrees(2 * math.atan(min(up, across)))
                self._renderer = mujoco.Renderer(model, self.height, self.width)
        except (
            Exception
        ) as error:  # what a missing OpenGL raises differs from one backend to the next
            raise InputError(
                f"render: this machine cannot draw ({error}). Without a screen, set MUJOCO_GL=egl "
                f"or MUJOCO_GL=osmesa and "
                "install Debian's libegl1 or libosmesa6"
            ) from error

    def draw(self, loop: ClosedLoop, scenery: Any) -> NDArray[np.uint8] | None:
        """Draw the loop as it is now, in a ``scenery``: where the fan is along y, m; return the
        picture (height, width, 3) unless it went to a window.
        """
        self.open_world(loop.model, loop.data)
        self.begin_frame(loop)
        self._drift(loop, scenery)
        mujoco.mj_kinematics(loop.model, loop.data)

        def mark(scene: Any) -> None:
            self._mark(scene, loop, scenery)
            at = loop.position
            add_shadow(scene, at, 0.22)
            add_path(scene, self._path[-self._trail :])
            true, seen = loop.external, loop.state
            add_wrench(scene, at, true[:3], true[5], self._scales, 0.22, true=True)
            add_wrench(scene, at, seen[16:19], seen[15], self._scales, 0.22)

        return self.show(loop.data, mark, "chase")

    def begin_frame(self, loop: ClosedLoop) -> None:
        """Wait for the loop's time where a window shows it, and remember where the vehicle is."""
        if loop.time < self._last:  # another episode
            self._path.clear()
            self._begun = time.perf_counter() - loop.time
        self._last = loop.time
        if self.mode == "human":  # not faster than life
            time.sleep(max(self._begun + loop.time - time.perf_counter(), 0.0))
        self._path.append(loop.position.copy())

    def show(self, data: Any, mark: Callable[[Any], None], camera: Any) -> NDArray[np.uint8] | None:
        """Draw a world with the marks that ``mark`` adds; return the picture unless it went to a
        window.

        Args:
            data: MuJoCo's, of the world of ``open_world``.
            mark: adds shapes to a scene.
            camera: name of a camera of the model, or a free one.
        """
        if self._window is not None:
            with self._window.lock():
                self._window.user_scn.ngeom = 0
                mark(self._window.user_scn)
            self._window.sync()
            return None
        self._renderer.update_scene(data, camera=camera)
        mark(self._renderer.scene)
        picture: NDArray[np.uint8] = self._renderer.render()
        return picture

    def pixels_per_metre(self, at: NDArray[np.float64]) -> float:
        """Return how many pixels of the last picture a metre across it takes at a place (3,) m."""
        view = self._renderer.scene.camera[0]
        ahead = np.asarray(at) - np.asarray(view.pos)
        depth = float(ahead @ np.asarray(view.forward))
        across = float(view.frustum_top - view.frustum_bottom) / float(view.frustum_near)
        return self.height / max(across * depth, 1e-6)

    @property
    def is_open(self) -> bool:
        """Whether there is a window that nobody has closed, or a renderer."""
        return (
            bool(self._window.is_running())
            if self._window is not None
            else self._renderer is not None
        )

    def _drift(self, loop: ClosedLoop, scenery: Any) -> None:
        """Place the fan, and carry the tracers with the mean wind for one frame."""
        loop.data.mocap_pos[0] = (0.0, scenery, float(loop.record[0]["fan"]["height"]) or 1.2)
        axial, radial = loop.jet_table
        fan = loop.record["fan"][0:1].copy()
        fan["y"] = 0.0
        height, wind = float(fan["height"][0]), np.empty(3)
        for tracer in self._tracers:
            jet_at(fan[0], axial, radial, tracer[0], tracer[1], tracer[2] + height, wind)
            tracer += 0.08 * wind + 0.012 * self._rng.standard_normal(3) * (wind[0] > 0)
            tracer[0] += 0.003
        gone = self._tracers[:, 0] > 3.6
        self._tracers[gone] = self._new_tracers(int(gone.sum()))

    def _mark(self, scene: Any, loop: ClosedLoop, scenery: Any) -> None:
        """Add the tracers to a scene."""
        height = float(loop.record[0]["fan"]["height"])
        for tracer in self._tracers if float(loop.record[0]["fan"]["speed"]) > 0 else ():
            colour = np.array([0.25, 0.55, 0.95, 0.55 * (1.0 - tracer[0] / 3.8)])
            at = tracer + np.array([0.0, scenery, height])
            add_shape(scene, mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, 0.014), at, colour)

    def close(self) -> None:
        """Close the window or free the renderer."""
        for thing in (self._window, self._renderer):
            if thing is not None:
                thing.close()
        self._window = self._renderer = self._model = None
