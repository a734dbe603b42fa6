"""Observations of all tasks: pose and twist, the felt wrench, the accelerometer."""

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array, Single
from ..runtime.errors import unknown_name
from .state import State

OBSERVATIONS = ("pose", "wrench", "imu", "all")
FELT = ("imu", "all")  # need an accelerometer
# largest size and scale of three numbers each
_POSE = [(5.0, 0.5), (10.0, 1.0), (2.0, 0.3), (40.0, 2.0)]  # m, m/s, rad, rad/s
_IMU = [(40.0, 10.0)] * 2  # m/s2
_WRENCH = [(2.0, 0.2, 0), (2.0, 0.05, 1)]  # weights, times so many arms


def parts(name: str, s: State) -> list[Array]:
    """Return the arrays (n, .) of an observation; all but the last have three columns.

    * ``"pose"``: position and velocity (m, m/s) of the reference less the estimate's, attitude
      error (rad), angular velocity (rad/s, body), last action;
    * ``"wrench"``: before the last action the external force (N) and torque (Nm);
    * ``"imu"``: there the specific force (m/s2) of the accelerometer, and of the rotors by the
      declared model;
    * ``"all"``: wrench, and then these.
    """
    e, r = s.estimate, s.reference
    seen = [r[:, :3] - e.position, r[:, 3:6] - e.velocity, e.attitude_error, e.angular_velocity]
    if name in ("wrench", "all"):
        seen += [e.force, e.torque]
    if name in FELT:
        seen += [s.specific_force, s.specific_thrust]
    return [*seen, s.action]


def bounds(name: str, vehicle: Vehicle, actions: int) -> tuple[list[float], list[float]]:
    """Return largest sizes and scales of an observation's numbers.

    Raises:
        InputError: an unknown name.
    """
    if name not in OBSERVATIONS:
        raise unknown_name("observation", str(name), OBSERVATIONS, "observation")
    rows = [*_POSE]
    if name in ("wrench", "all"):
        for limit, scale, arm in _WRENCH:
            unit = vehicle.weight * vehicle.arm_l**arm
            rows.append((limit * unit, scale * unit))
    if name in FELT:
        rows += _IMU
    limits, scales = np.repeat(rows, 3, axis=0).T.tolist()
    return limits + [1.0] * actions, scales + [1.0] * actions


def as_numbers(values: ArrayLike) -> Single:
    """Return numbers in single precision."""
    return np.array(values, dtype=np.float32)
