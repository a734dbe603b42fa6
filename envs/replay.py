"""A flight that is over, drawn again: the vehicle along its path, with the wrench that was
estimated on it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..dynamics.vehicle import Vehicle
from .drawing import Viewer
from .plant import load_world
from .scene_shapes import add_path, add_shadow, add_wrench

Array = NDArray[np.float64]

_DRAWN_ARM = 0.1262  # m, arm_l of the vehicle that the model shows
# m, at the 99th percentile of the flight's force or torque, for a vehicle of that size
_LONGEST_ARROW = 0.6
_FARTHEST = 4.0  # m, from where a vehicle of that size is still seen well
_TRAIL = 2.0  # s of path behind the vehicle that are drawn closely
_PATH_POINTS = 300
_AWAY = (0.0, 0.0, -50.0)  # where the fan stands that a log knows nothing of


@dataclass(frozen=True, eq=False)
class Flight:
    """What was measured and estimated on a flight."""

    t: Array  # (n,) s
    position: Array  # (n, 3) m, world
    quaternion: Array  # (n, 4) body to world, scalar first
    force: Array  # (n, 3) N, world, estimated
    torque: Array  # (n, 3) Nm, world, estimated
    true_force: Array | None = None  # (n, 3) N
    true_torque: Array | None = None  # (n, 3) Nm
    fan_y: Array | None = None  # (n,) m

    @property
    def wrenches(self) -> list[tuple[bool, Array, Array]]:
        """Whether it is the truth, force and torque of what is known, the truth first."""
        known = [(False, self.force, self.torque)]
        if self.true_force is not None and self.true_torque is not None:
            known.insert(0, (True, self.true_force, self.true_torque))
        return known

    def part(self, rows: NDArray[np.integer[Any]]) -> "Flight":
        """Return some rows of it."""
        every = {f.name: getattr(self, f.name) for f in fields(self)}
        columns: dict[str, Any] = {
            name: None if column is None else column[rows] for name, column in every.items()
        }
        return Flight(**columns)


def arrow_scales(flight: Flight, arm: float) -> tuple[float, float]:
    """Return how long 1 N and 1 Nm are drawn, in m, for a vehicle of arm length ``arm`` m."""
    longest = _LONGEST_ARROW * arm / _DRAWN_ARM
    force, torque = (
        float(np.quantile(np.linalg.norm(x, axis=1), 0.99))
        for x in (flight.force, flight.torque[:, 2:])
    )
    return longest / max(force, 1e-9), longest / max(torque, 1e-12)


def _distance(flight: Flight, size: float) -> float:
    """Return how far the camera is away, m, that sees the whole flight of a vehicle ``size`` times
    that of the model.
    """
    extent = flight.position.max(axis=0) - flight.position.min(axis=0)
    return 1.1 * float(np.linalg.norm(extent)) + 1.3 * size


def drawn_arm(flight: Flight, vehicle: Vehicle) -> float:
    """Return the arm length, m, that a vehicle is drawn with: its own, or more where it would be
    lost in the picture of its flight.
    """
    size = vehicle.arm_l / _DRAWN_ARM
    return _DRAWN_ARM * max(size, _distance(flight, size) / _FARTHEST)


def pictures(
    flight: Flight, vehicle: Vehicle, viewer: Viewer, fps: float
) -> Iterator[tuple[int, NDArray[np.uint8] | None]]:
    """Yield a sample's row and its picture for each 1 / ``fps`` s of a flight, or show it in the
    viewer's window until that is closed.

    Raises:
        InputError: this machine cannot draw.
    """
    model, data = load_world(vehicle)
    arm = drawn_arm(flight, vehicle)
    size = arm / _DRAWN_ARM
    shown = model.geom_bodyid == model.body("vehicle").id
    model.geom_size[shown] *= size
    model.geom_pos[shown] *= size
    viewer.open_world(model, data)
    data.mocap_pos[0] = _AWAY
    mujoco.mj_forward(model, data)  # places the lights too
    low, high = flight.position.min(axis=0), flight.position.max(axis=0)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = 0.5 * (low + high)
    camera.distance = _distance(flight, size)
    camera.azimuth, camera.elevation = 130.0, -22.0
    scales = arrow_scales(flight, arm)
    frames = np.arange(flight.t[0], flight.t[-1], 1.0 / fps)
    rows = np.searchsorted(flight.t, frames)
    thin = max(1, len(rows) // _PATH_POINTS)

    for count, k in enumerate(rows):
        if not viewer.is_open:
            return
        at = flight.position[k]
        data.qpos[:3], data.qpos[3:7] = at, flight.quaternion[k]
        mujoco.mj_kinematics(model, data)
        old = rows[: max(0, count - round(_TRAIL * fps)) : thin]
        recent = rows[max(0, count - round(_TRAIL * fps)) : count + 1]

        trail = [flight.position[i] for i in (*old, *recent)]

        def mark(scene: object, k: int = k, at: Array = at, trail: list[Array] = trail) -> None:
            add_shadow(scene, at, 0.22 * size)
            add_path(scene, trail, size)
            for true, force, torque in flight.wrenches:
                reach = 0.22 * size
                add_wrench(scene, at, force[k], torque[k, 2], scales, reach, true, size)

        yield int(k), viewer.show(data, mark, camera)
