"""Shapes of a picture beside bodies: the wrench as arrows, the path flown, a shadow."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from ..runtime.arrays import Array

# true: wide and light; estimated: narrow and dark
ESTIMATED, TRUE = np.array([0.80, 0.08, 0.06, 1.0]), np.array([0.25, 0.72, 0.35, 1.0])
TURNING, TURNING_TRUE = np.array([0.38, 0.08, 0.62, 1.0]), np.array([0.20, 0.60, 0.90, 1.0])
_WIDTH, _WIDTH_TRUE = 0.012, 0.022  # m, of an arrow
_ABOVE = 0.22  # m, of the torque's arrow over the vehicle
_APART = 0.1  # m, of the estimate above the truth: neither hides the other
_PATH = np.array([0.95, 0.45, 0.10, 1.0])
MARKS = (ESTIMATED, TRUE, TURNING, TURNING_TRUE, _PATH)
_SHADOW = np.array([0.0, 0.0, 0.0, 0.25])
_GEOM = mujoco.mjtGeom


def add_shape(scene: Any, kind: Any, size: Array, position: Array, colour: Array) -> Any:
    """Append a shape to a scene with room; return the shape, or None."""
    if scene.ngeom >= scene.maxgeom:
        return None
    shape = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(shape, kind, size, position, np.eye(3).ravel(), colour.astype(np.float32))
    scene.ngeom += 1
    return shape


def add_path(scene: Any, path: Sequence[Array]) -> None:
    """Append the path (n, 3) m flown so far, fading towards its beginning."""
    for i, (start, end) in enumerate(pairwise(path)):
        colour = _PATH.copy()
        colour[3] = 0.15 + 0.6 * (i + 1) / len(path)
        _add_between(scene, _GEOM.mjGEOM_CAPSULE, start, end, 0.008, colour)


def add_shadow(scene: Any, position: Array) -> None:
    """Append a disc on the floor below a vehicle."""
    place, size = np.array([*position[:2], 0.002]), np.array([0.22, 0.001, 0.0])
    add_shape(scene, _GEOM.mjGEOM_CYLINDER, size, place, _SHADOW)


def add_wrench(
    scene: Any,
    position: Array,
    force: Array,
    torque_z: float,
    scales: tuple[float, float],
    true: bool,
) -> None:
    """Append a force (3,) N and a yaw torque in Nm at a vehicle, ``scales`` in m per N and Nm.

    The torque stands over the vehicle as an arrow along y, towards the jet's axis.
    """
    width, pushing, turning = (
        (_WIDTH_TRUE, TRUE, TURNING_TRUE) if true else (_WIDTH, ESTIMATED, TURNING)
    )
    up = np.array([0.0, 0.0, 1.0])
    # from where no hull hides the arrow
    at = position + (0.2 * _ABOVE + (0.0 if true else _APART)) * up
    top = at + 1.1 * _ABOVE * up
    for start, arrow, colour in (
        (at, scales[0] * force, pushing),
        (top, np.array([0.0, -scales[1] * torque_z, 0.0]), turning),
    ):
        if float(np.linalg.norm(arrow)) >= 0.01:  # m
            _add_between(scene, _GEOM.mjGEOM_ARROW, start, start + arrow, width, colour)


def _add_between(
    scene: Any, kind: Any, start: Array, end: Array, width: float, colour: Array
) -> None:
    shape = add_shape(scene, kind, np.ones(3), start, colour)
    if shape is not None:
        mujoco.mjv_connector(shape, kind, width, start, end)
