"""An oracle's knowledge of a vehicle."""

from typing import Any

import numpy as np

from ..dynamics.rotation import matrix_of
from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array


def true_motion(
    vehicle: Vehicle, pose: Array, velocity: Array, speeds: Array, integral: Array
) -> dict[str, Any]:
    """Return a vehicle's motion as an oracle knows it.

    Args:
        vehicle: as it is declared.
        pose: (7,) position m and quaternion.
        velocity: (6,) m/s, world, and rad/s, body.
        speeds: (4,) rad/s, of the rotors.
        integral: (3,) of the flight loop.
    """
    R = matrix_of(pose[3:7])
    thrust, *torques = (vehicle.mixing @ speeds**2).tolist()
    return {
        "velocity": velocity[:3].copy(),
        "rate": R @ velocity[3:6],
        "angular_acceleration": R @ np.linalg.solve(vehicle.inertia, torques),
        "up": R[:, 2].copy(),
        "lift": thrust * R[2, 2] / vehicle.mass - vehicle.gravity,
        "integral": integral.copy(),
    }
