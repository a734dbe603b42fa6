"""Drawing the world: the jet as drifting tracers, the wrench as arrows, in a window or as a picture."""

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..dynamics.errors import InputError
from .closed_loop import ClosedLoop
from .jet import jet_at

_TRACERS = 260
_FORCE_SCALE = 1.6  # m per N
_TORQUE_SCALE = 25.0  # m per Nm
_ESTIMATED, _TRUE = np.array([0.90, 0.15, 0.10, 1.0]), np.array([0.10, 0.55, 0.20, 0.55])
_TURNING, _TURNING_TRUE = np.array([0.45, 0.15, 0.75, 1.0]), np.array([0.10, 0.45, 0.75, 0.55])


class Viewer:
    """Draws a closed loop.

    Args:
        mode: ``"rgb_array"`` for pictures, ``"human"`` for a window.
        width: of the picture, in pixels.
        height: likewise.

    Raises:
        InputError: this machine has no way to draw.
    """

    def __init__(self, mode: str, width: int = 640, height: int = 480) -> None:
        self.mode, self.width, self.height = mode, width, height
        self._renderer: Any = None
        self._window: Any = None
        self._model: Any = None
        # tracers drift with the jet; they only decorate, so their generator is their own
        self._rng = np.random.default_rng(0)
        self._tracers = self._new_tracers(_TRACERS)
        self._tracers[:, 0] = self._rng.uniform(0.2, 3.6, _TRACERS)

    def _new_tracers(self, count: int) -> NDArray[np.float64]:
        radius, angle = 0.45 * np.sqrt(self._rng.random(count)), self._rng.uniform(0, 2 * math.pi, count)
        return np.stack([np.full(count, 0.2), radius * np.cos(angle), radius * np.sin(angle)], axis=1)

    def _open(self, loop: ClosedLoop) -> None:
        if self._model is loop.model:
            return
        self.close()
        self._model = loop.model
        try:
            if self.mode == "human":
                from mujoco import viewer

                self._window = viewer.launch_passive(loop.model, loop.data, show_left_ui=False, show_right_ui=False)
                self._window.cam.lookat[:] = (1.3, 0.0, 1.1)
                self._window.cam.distance, self._window.cam.azimuth, self._window.cam.elevation = 4.5, 140, -22
            else:
                self._renderer = mujoco.Renderer(loop.model, self.height, self.width)
        except Exception as error:  # what a missing OpenGL raises differs from one backend to the next
            raise InputError(
                f"render: this machine cannot draw ({error}). Without a screen, set MUJOCO_GL=egl or MUJOCO_GL=osmesa and "
                "install Debian's libegl1 or libosmesa6"
            ) from error

    def draw(self, loop: ClosedLoop, fan_y: float) -> NDArray[np.uint8] | None:
        """Draw the loop as it is now; return the picture (height, width, 3) unless it went to a window."""
        self._open(loop)
        fan = loop.record[0]["fan"]
        loop.data.mocap_pos[0] = (0.0, fan_y, float(fan["height"]) or 1.2)
        mujoco.mj_kinematics(loop.model, loop.data)
        self._drift(loop, fan_y)
        if self._window is not None:
            with self._window.lock():
                self._window.user_scn.ngeom = 0
                self._mark(self._window.user_scn, loop, fan_y)
            self._window.sync()
            return None
        self._renderer.update_scene(loop.data, camera="chase")
        self._mark(self._renderer.scene, loop, fan_y)
        picture: NDArray[np.uint8] = self._renderer.render()
        return picture

    def _drift(self, loop: ClosedLoop, fan_y: float) -> None:
        """Carry the tracers with the mean wind for one frame."""
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

    def _mark(self, scene: Any, loop: ClosedLoop, fan_y: float) -> None:
        """Add tracers and arrows to a scene."""
        height = float(loop.record[0]["fan"]["height"])
        if float(loop.record[0]["fan"]["speed"]) > 0:
            for tracer in self._tracers:
                fade = 0.55 * (1.0 - tracer[0] / 3.8)
                _add(scene, mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, 0.014), tracer + np.array([0.0, fan_y, height]),
                     np.array([0.25, 0.55, 0.95, fade]))
        force, torque = loop.state[16:19], loop.state[13:16]
        at = loop.position
        _add(scene, mujoco.mjtGeom.mjGEOM_CYLINDER, np.array([0.22, 0.001, 0.0]), np.array([at[0], at[1], 0.002]),
             np.array([0.0, 0.0, 0.0, 0.25]))
        for vector, colour, width in ((loop.external[:3], _TRUE, 0.034), (force, _ESTIMATED, 0.02)):
            _arrow(scene, at, at + _FORCE_SCALE * vector, width, colour)
        # the yaw torque as an arrow along y, the way in which it says that the axis lies
        above = at + np.array([0.0, 0.0, 0.22])
        for value, colour, width in ((loop.external[5], _TURNING_TRUE, 0.034), (torque[2], _TURNING, 0.02)):
            _arrow(scene, above, above - np.array([0.0, _TORQUE_SCALE * value, 0.0]), width, colour)

    def close(self) -> None:
        """Close the window or free the renderer."""
        for thing in (self._window, self._renderer):
            if thing is not None:
                thing.close()
        self._window = self._renderer = self._model = None


def _add(scene: Any, kind: Any, size: NDArray[np.float64], position: NDArray[np.float64],
         colour: NDArray[np.float64]) -> Any:
    """Append a shape to a scene that has room for it; return it, or None."""
    if scene.ngeom >= scene.maxgeom:
        return None
    shape = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(shape, kind, size, position, np.eye(3).ravel(), colour.astype(np.float32))
    scene.ngeom += 1
    return shape


def _arrow(scene: Any, start: NDArray[np.float64], end: NDArray[np.float64], width: float,
           colour: NDArray[np.float64]) -> None:
    if float(np.linalg.norm(end - start)) < 0.01:
        return
    shape = _add(scene, mujoco.mjtGeom.mjGEOM_ARROW, np.ones(3), start, colour)
    if shape is not None:
        mujoco.mjv_connector(shape, mujoco.mjtGeom.mjGEOM_ARROW, width, start, end)
