"""The causal filter of a flight: the state at each sample from past poses, and the derivative of
its innovations by a coefficient.

The state is position, velocity, attitude, angular velocity and the disturbance's force and torque
as accelerations: 18 numbers. Rolls and pitches are about the world's x and y, turned with the
heading. There each axis has a steady gain, whatever the yaw. So the filter is an observer of fixed
gains, and linear recursions give the derivatives of its innovations, exactly but for second order.
Rotor speeds move linearly between samples.
"""

from dataclasses import dataclass, fields

import numpy as np

from ... import _core
from ...dynamics.effects.own import raise_errors
from ...dynamics.vehicle import Vehicle
from ..logs.table import Array
from ..motion.residual import loaded_model
from .steady_filter import SteadyFilter


@dataclass(frozen=True, eq=False)
class Poses:
    """An unbroken piece of a flight as measured, evenly spaced (n samples)."""

    t: Array  # (n,) s
    period: float  # s
    position: Array  # (n, 3) m
    quaternion: Array  # (n, 4), of continuous sign
    rotor_speeds: Array  # (n, 4) rad/s, at the samples
    voltage: Array  # (n,) V; 0 where unknown
    velocity: Array  # (3,) m/s, at the start
    angular_velocity: Array  # (3,) rad/s, body, at the start
    log: int = 0  # index among the flights


@dataclass(frozen=True, eq=False)
class FlightState:
    """A piece of flight (n samples)."""

    t: Array  # (n,) s
    position: Array  # (n, 3) m, world
    rotation: Array  # (n, 3, 3) body to world
    velocity: Array  # (n, 3) m/s, world
    angular_velocity: Array  # (n, 3) rad/s, body
    acceleration: Array  # (n, 3) m/s2, world; of a track (n, 6), and rad/s2, body
    rotors: Array  # (n, 4) accelerations by the rotors' thrust and torques: m/s2, rad/s2, body


@dataclass(frozen=True, eq=False)
class Track(FlightState):
    """A piece of a flight as the filter saw it, half a step on from sample k.

    Row k describes the step from sample k to k + 1; its predictions are of sample k. The
    acceleration includes the disturbance.
    """

    model: Array  # (n, 6) acceleration of the model alone
    predicted: Array  # (n, 7) position and quaternion at sample k, from the samples before
    heading: Array  # (n, 2) cosine and sine, at sample k
    innovations: Array  # (n, 6) m, world; rad, as ``level`` returns them
    disturbance: Array  # (n, 6) m/s2, world; rad/s2


def level(heading: Array, x: Array) -> Array:
    """Return vectors (n, 3) in body axes about three others: the world's x and y, turned with the
    heading (n, 2), and body z.
    """
    c, s = heading.T
    ahead, left, up = x.T
    return np.column_stack([c * ahead - s * left, s * ahead + c * left, up])


def run(poses: Poses, vehicle: Vehicle, steady: SteadyFilter, known: Array) -> Track:
    """Return a piece as the filter with a vehicle's model sees it.

    Args:
        poses: the piece.
        vehicle: the model.
        steady: the filter's gains.
        known: (n, 6, 3) corrections of pose, rate and disturbance of each axis before the pose of
            sample k is read, in the directions of ``Track.innovations``.
    """
    n = len(poses.t)
    shapes = ((3,), (3, 3), (3,), (3,), (6,), (4,), (6,), (7,), (2,), (6,), (6,))
    out = Track(poses.t, *(np.empty((n, *shape)) for shape in shapes))
    models = loaded_model(vehicle)[0].copy()
    _core.run_causal_filter(
        models.ctypes.data,
        poses.period,
        poses.rotor_speeds,
        poses.voltage,
        poses.position,
        poses.quaternion,
        np.append(poses.velocity, poses.angular_velocity),
        steady.gain,
        steady.keep,
        known,
        *(getattr(out, field.name) for field in fields(out)[1:]),
    )
    raise_errors()
    np.divide(out.rotors, [vehicle.mass, *np.diagonal(vehicle.inertia)], out=out.rotors)
    return out
