"""The causal filter of a flight: the state at each sample from past poses, and the derivative of
its innovations by a coefficient.

The state is position, velocity, attitude, angular velocity and the disturbance's force and torque
as accelerations: 18 numbers. Rolls and pitches are about the world's x and y, turned with the
heading. There each axis has a steady gain, whatever the yaw. So the filter is an observer of fixed
gains, and linear recursions give the derivatives of its innovations, exactly but for second order.
Rotor speeds move linearly between samples.
"""

from dataclasses import dataclass

import numpy as np

from ... import _core
from ...dynamics.effects.own import raise_errors
from ...dynamics.vehicle import Vehicle
from ..logs.table import Array
from ..motion.residual import loaded_model
from .raw_poses import Poses
from .steady_filter import SteadyFilter


@dataclass(frozen=True, eq=False)
class Track:
    """Pieces of flights as the filter saw them, half a step on from sample k.

    Row k describes the step from sample k to k + 1; its predictions are of sample k. The
    acceleration includes the disturbance.
    """

    t: Array  # (n,) s
    position: Array  # (n, 3) m, world
    rotation: Array  # (n, 3, 3) body to world
    velocity: Array  # (n, 3) m/s, world
    angular_velocity: Array  # (n, 3) rad/s, body
    acceleration: Array  # (n, 6) m/s2, world; rad/s2, body
    rotors: Array  # (n, 4) accelerations by the rotors' thrust and torques: m/s2, rad/s2, body
    model: Array  # (n, 6) acceleration of the model alone
    predicted: Array  # (n, 7) position and quaternion at sample k, from the samples before
    heading: Array  # (n, 2) cosine and sine, at sample k
    innovations: Array  # (n, 6) m, world; rad, as ``level`` returns them
    disturbance: Array  # (n, 6) m/s2, world; rad/s2

    @classmethod
    def of(cls, poses: Poses, vehicle: Vehicle, steady: SteadyFilter, known: Array) -> "Track":
        """Return the pieces as the filter with a vehicle's model sees them.

        Args:
            poses: the pieces.
            vehicle: the model.
            steady: the filter's gains.
            known: (n, 6, 3) corrections of pose, rate and disturbance of each axis before the pose
                of sample k is read, in the directions of ``innovations``.
        """
        shapes = ((3,), (3, 3), (3,), (3,), (6,), (4,), (6,), (7,), (2,), (6,), (6,))
        written = [np.empty((len(poses.t), *shape)) for shape in shapes]
        for at, start in zip(poses.pieces, poses.start, strict=True):
            models = loaded_model(vehicle)[0].copy()
            _core.run_causal_filter(
                models.ctypes.data,
                poses.period,
                poses.rotor_speeds[at],
                poses.voltage[at],
                poses.position[at],
                poses.quaternion[at],
                start,
                steady.gain,
                steady.keep,
                known[at],
                *(x[at] for x in written),
            )
            raise_errors()
        out = cls(poses.t, *written)
        out.rotors[:] /= [vehicle.mass, *np.diagonal(vehicle.inertia)]
        return out


def level(heading: Array, x: Array) -> Array:
    """Return vectors (n, 3) in body axes about three others: the world's x and y, turned with the
    heading (n, 2), and body z.
    """
    c, s = heading.T
    ahead, left, up = x.T
    return np.column_stack([c * ahead - s * left, s * ahead + c * left, up])
