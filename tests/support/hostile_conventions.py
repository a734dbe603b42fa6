"""Flight logs in other conventions than they declare, and the words by which each is named."""

from dataclasses import replace
from functools import partial
from math import nan, pi

import numpy as np
from scipy.spatial.transform import Rotation

ONE = np.eye(3)
DOWN = np.diag([1.0, -1.0, -1.0])  # forward, left, up to forward, right, down
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up


def framed(log, position=ONE, world=ONE, body=ONE):
    """The log with positions times a matrix, and attitudes seen from another world and body."""
    quaternion = log.quaternion
    if world is not ONE or body is not ONE:
        quaternion = np.full_like(quaternion, nan)
        seen = log.valid & np.isfinite(log.quaternion).all(axis=1)
        R = Rotation.from_quat(log.quaternion[seen], scalar_first=True).as_matrix()
        quaternion[seen] = Rotation.from_matrix(world @ R @ body).as_quat(scalar_first=True)
    return replace(log, position=log.position @ position.T, quaternion=quaternion)


def placed(log, order, signs=(1.0, 1.0, 1.0)):
    """The log with the columns of its position in another order and of other signs."""
    return replace(log, position=log.position[:, order] * signs)


def scaled(log, **factors):
    """The log with channels in other units."""
    return replace(log, **{name: factor * getattr(log, name) for name, factor in factors.items()})


def permuted(log, order):
    return replace(log, rotor_speeds=log.rotor_speeds[:, order])


def shifted(log, seconds):
    rotors = [np.interp(log.t - seconds, log.t, column) for column in log.rotor_speeds.T]
    return replace(log, rotor_speeds=np.column_stack(rotors))


def conjugate(log):
    return replace(log, quaternion=log.quaternion * [1, -1, -1, -1])


def scalar_last(log):
    return replace(log, quaternion=log.quaternion[:, [1, 2, 3, 0]])


def scalar_first_as_last(log):
    """The values w, x, y, z under the headers qx, qy, qz, qw."""
    return replace(log, quaternion=log.quaternion[:, [3, 0, 1, 2]])


def of_log(change, *arguments, then=None):
    """Return a change of a log with its arguments, and another one after it."""
    return lambda log: (then or (lambda same: same))(change(log, *arguments))


NED = (DOWN, DOWN, DOWN)
Y_UP_WORLD = (Y_UP, Y_UP, ONE)
Y_UP_BODY = (Y_UP, Y_UP, Y_UP.T)
AS_LAST = "scalar first under the headers of scalar last.*"
as_last = partial(of_log, then=scalar_first_as_last)

HOSTILE = {
    "scalar last": (
        scalar_last,
        r"quaternion is scalar last; expected .* take \(qz, qw, qx, qy\) as the quaternion",
    ),
    "scalar first as last": (
        scalar_first_as_last,
        rf"quaternion is {AS_LAST}take \(qx, qy, qz, qw\) as the quaternion",
    ),
    "scalar first as last, conjugate": (as_last(conjugate), f"{AS_LAST}world to body"),
    "scalar first as last, NED": (as_last(framed, *NED), f"{AS_LAST}world is z down"),
    "scalar first as last, y up": (as_last(framed, *Y_UP_WORLD), f"{AS_LAST}world is y up"),
    "scalar first as last, y up body": (
        as_last(framed, *Y_UP_BODY),
        f"{AS_LAST}world and the body are y up",
    ),
    "conjugate": (
        conjugate,
        r"quaternion is world to body; expected .* take \(qw, -qx, -qy, -qz\) as the quaternion",
    ),
    "scalar last, conjugate": (
        of_log(conjugate, then=scalar_last),
        "quaternion is scalar last and world to body",
    ),
    "NED": (of_log(framed, *NED), "world is z down .north, east, down. and the body z down"),
    "z down": (of_log(framed, DOWN, DOWN), "world is z down while the body axes"),
    "FRD body": (
        of_log(framed, ONE, ONE, DOWN),
        "body axes are forward, right, down in a world",
    ),
    "NED position": (of_log(framed, DOWN), "position is z down .* but the attitude z up"),
    "NED attitude": (
        of_log(framed, ONE, DOWN, DOWN),
        "attitude is z down .* but the position",
    ),
    "y up": (
        of_log(framed, *Y_UP_WORLD),
        "world is y up, .* with body axes forward, left, up",
    ),
    "y up body": (of_log(framed, *Y_UP_BODY), "world and the body are y up"),
    "y, z swapped": (of_log(placed, [0, 2, 1]), "py and pz are swapped, the attitude"),
    "all y, z swapped": (
        lambda log: replace(placed(log, [0, 2, 1]), quaternion=log.quaternion[:, [0, 1, 3, 2]]),
        "y and z are swapped, in posi",
    ),
    "x, y swapped": (of_log(placed, [1, 0, 2]), "px and py are swapped"),
    "px negated": (
        of_log(placed, [0, 1, 2], (-1.0, 1.0, 1.0)),
        r"px points the other way .* take \(-px, py, pz\) as the position",
    ),
    "py negated": (
        of_log(placed, [0, 1, 2], (1.0, -1.0, 1.0)),
        r"py points the other way .* take \(px, -py, pz\) as the position",
    ),
    "position turned by 180": (
        of_log(placed, [0, 1, 2], (-1.0, -1.0, 1.0)),
        "turned against the attitude's by 180 degrees",
    ),
    "position turned by 90": (
        of_log(placed, [1, 0, 2], (-1.0, 1.0, 1.0)),
        "turned against the attitude's by 90 degrees",
    ),
    "scalar last, NED": (
        of_log(framed, *NED, then=scalar_last),
        "quaternion is scalar last and the world (is )?z down",
    ),
    "millimetres": (partial(scaled, position=1e3), "px, py, pz look like millimetres"),
    "centimetres": (partial(scaled, position=1e2), "px, py, pz look like centimetres"),
    "deg/s": (partial(scaled, rotor_speeds=180 / pi), "look like degrees per second"),
    "rpm": (partial(scaled, rotor_speeds=30 / pi), "look like revolutions per minute"),
    "Hz": (partial(scaled, rotor_speeds=0.5 / pi), "look like revolutions per second"),
    "ms": (partial(scaled, t=1e3), "t looks like milliseconds: .*divide t by 1000"),
    "us": (partial(scaled, t=1e6), "t looks like microseconds"),
    "rotors late": (
        of_log(shifted, 0.3),
        r"rotor speeds come 0\.[23]\d s too late .* put omega1..omega4 .* earlier",
    ),
    "rotors early": (of_log(shifted, -0.5), r"rotor speeds come 0\.[45]\d s too early .* later"),
    "Betaflight": (
        of_log(permuted, [2, 3, 1, 0]),
        "rotors look permuted: omega1..omega4 are rotors 3,4,2,1 of this vehicle .the order "
        "betaflight",
    ),
    "PX4": (of_log(permuted, [3, 1, 0, 2]), "rotors 4,2,1,3 .* px4-x"),
    "Crazyflie": (of_log(permuted, [3, 2, 1, 0]), "rotors 4,3,2,1 .* crazyflie"),
}
