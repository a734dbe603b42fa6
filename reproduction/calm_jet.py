"""The wrench of the fan's mean jet on a level vehicle at rest: what maps and bounds are held
against.
"""

import math

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..dynamics.mean_jet import jet_table
from ..dynamics.rotation import matrix_of, quaternion_of_yaw
from ..dynamics.vehicle import Vehicle
from ..envs.fan import Fan, fan_record
from ..envs.plant import TICK

Array = NDArray[np.float64]


def calm_jet(fan: Fan, vehicle: Vehicle, x: Array, y: Array) -> Array:
    """Return force (N) and torque (Nm), shape (n, 6), world frame, of the jet without its gusts.

    Args:
        fan: at the origin of x and y.
        vehicle: level, at rest, at the height of the fan's axis and facing the fan (yaw of half a
            turn).
        x: distances (n,) m along the jet.
        y: offsets (n,) m from its axis.
    """
    record = fan_record(fan, vehicle.positions, TICK)  # its gusts are zero until aged
    jet = np.stack(jet_table(fan.radius, fan.hub_radius))
    rotation, rest = matrix_of(quaternion_of_yaw(math.pi)), np.zeros(6)
    wrench = np.empty((len(x), 6))
    for i in range(len(x)):
        at = np.array([x[i], y[i], fan.height])
        _core.jet_wrench(record.ctypes.data, jet, at, rotation, rest, vehicle.com, wrench[i])
    return wrench


def strongest_torque(fan: Fan, vehicle: Vehicle, distance: float) -> tuple[float, float]:
    """Return the largest yaw torque (Nm) of the mean jet at a distance (m), and the offset (m)
    where it acts.
    """
    y = np.linspace(0.0, 1.5, 301)
    torque = calm_jet(fan, vehicle, np.full_like(y, distance), y)[:, 5]
    best = int(np.argmax(torque))
    return float(torque[best]), float(y[best])
