"""What a picture shows besides bodies: the wrench as arrows, the path flown, drops in the jet."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# true: wide and light; estimated: narrow and dark
ESTIMATED, TRUE = np.array([0.80, 0.08, 0.06, 1.0]), np.array([0.25, 0.72, 0.35, 1.0])
TURNING, TURNING_TRUE = np.array([0.38, 0.08, 0.62, 1.0]), np.array([0.20, 0.60, 0.90, 1.0])
_WIDTH, _WIDTH_TRUE = 0.012, 0.022  # m, of an arrow
_APART = 0.1  # m, that the estimate stands above the truth: neither hides the other
_PATH = np.array([0.95, 0.45, 0.10, 1.0])
MARKS = (ESTIMATED, TRUE, TURNING, TURNING_TRUE, _PATH)
_SHADOW = np.array([0.0, 0.0, 0.0, 0.25])


def add_shape(scene: Any, kind: Any, size: Array, position: Array, colour: Array) -> Any:
    """Append a shape to a scene that has room for it; return it, or None."""
    if scene.ngeom >= scene.maxgeom:
        return None
    shape = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(shape, kind, size, position, np.eye(3).ravel(), colour.astype(np.float32))
    scene.ngeom += 1
    return shape


def add_arrow(scene: Any, start: Array, end: Array, width: float, colour: Array) -> None:
    """Append an arrow, unless it is shorter than 1 cm."""
    if float(np.linalg.norm(end - start)) >= 0.01:
        _add_between(scene, mujoco.mjtGeom.mjGEOM_ARROW, start, end, width, colour)


def add_path(scene: Any, path: Sequence[Array], size: float = 1.0) -> None:
    """Append the path (n, 3) m flown so far, ``size`` times as thick; it fades towards its
    beginning.
    """
    for i, (start, end) in enumerate(pairwise(path)):
        colour = _PATH.copy()
        colour[3] = 0.15 + 0.6 * (i + 1) / len(path)
        _add_between(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, start, end, 0.008 * size, colour)


def add_shadow(scene: Any, position: Array, radius: float) -> None:
    """Append a disc on the floor below a vehicle."""
    add_shape(
        scene,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        np.array([radius, 0.001, 0.0]),
        np.array([*position[:2], 0.002]),
        _SHADOW,
    )


def add_wrench(
    scene: Any,
    position: Array,
    force: Array,
    torque_z: float,
    scales: tuple[float, float],
    above: float,
    true: bool = False,
    size: float = 1.0,
) -> None:
    """Append a force (3,) N and a yaw torque in Nm at a vehicle, ``scales`` in m per N and Nm,
    ``size`` times as thick.

    The torque stands ``above`` m over the vehicle as an arrow along y, the way in which it says
    that the jet's axis lies.
    """
    width = (_WIDTH_TRUE if true else _WIDTH) * size
    up = np.array([0.0, 0.0, 1.0])
    # from where no hull hides it
    at = position + (0.2 * above + (0.0 if true else _APART * size)) * up
    add_arrow(scene, at, at + scales[0] * force, width, TRUE if true else ESTIMATED)
    top = at + 1.1 * above * up
    add_arrow(
        scene,
        top,
        top - np.array([0.0, scales[1] * torque_z, 0.0]),
        width,
        TURNING_TRUE if true else TURNING,
    )


def _add_between(
    scene: Any, kind: Any, start: Array, end: Array, width: float, colour: Array
) -> None:
    shape = add_shape(scene, kind, np.ones(3), start, colour)
    if shape is not None:
        mujoco.mjv_connector(shape, kind, width, start, end)
