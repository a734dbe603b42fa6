"""Flight logs in other conventions than they declare, and the words by which each is named."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

DOWN = np.diag([1.0, -1.0, -1.0])  # forward, left, up to forward, right, down
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z up to y up


def turned(log, position=None, attitude=None):
    """The log with positions (3, 3) times themselves and a function on rotation matrices."""
    quaternion = log.quaternion
    if attitude is not None:
        quaternion = np.full_like(quaternion, np.nan)
        seen = log.valid & np.isfinite(log.quaternion).all(axis=1)
        R = Rotation.from_quat(log.quaternion[seen], scalar_first=True).as_matrix()
        quaternion[seen] = Rotation.from_matrix(attitude(R)).as_quat(scalar_first=True)
    return replace(
        log,
        position=log.position if position is None else log.position @ position.T,
        quaternion=quaternion,
    )


def shifted(log, seconds):
    rotors = np.column_stack(
        [np.interp(log.t - seconds, log.t, column) for column in log.rotor_speeds.T]
    )
    return replace(log, rotor_speeds=rotors)


def scalar_last(log):
    return replace(log, quaternion=log.quaternion[:, [1, 2, 3, 0]])


def scalar_first_as_last(log):
    """The values w, x, y, z under the headers qx, qy, qz, qw."""
    return replace(log, quaternion=log.quaternion[:, [3, 0, 1, 2]])


def conjugate(log):
    return replace(log, quaternion=log.quaternion * [1, -1, -1, -1])


def ned(log):
    return turned(log, DOWN, lambda R: DOWN @ R @ DOWN)


HOSTILE = {
    "scalar last": (
        scalar_last,
        "quaternion is scalar last; expected scalar first.*reorder the columns",
    ),
    "scalar first as last": (
        scalar_first_as_last,
        "quaternion is scalar first under the headers of scalar last.*rename the columns",
    ),
    "scalar first as last, conjugate": (
        lambda log: scalar_first_as_last(conjugate(log)),
        "scalar first under the headers of scalar last.*world to body",
    ),
    "scalar first as last, NED": (
        lambda log: scalar_first_as_last(ned(log)),
        "scalar first under the headers of scalar last.*world is z down",
    ),
    "scalar first as last, y up": (
        lambda log: scalar_first_as_last(turned(log, Y_UP, lambda R: Y_UP @ R)),
        "scalar first under the headers of scalar last.*world is y up",
    ),
    "scalar first as last, y up body": (
        lambda log: scalar_first_as_last(turned(log, Y_UP, lambda R: Y_UP @ R @ Y_UP.T)),
        "scalar first under the headers of scalar last.*world and the body are y up",
    ),
    "conjugate": (conjugate, "quaternion is world to body; expected body to world"),
    "scalar last, conjugate": (
        lambda log: scalar_last(conjugate(log)),
        "quaternion is scalar last and world to body",
    ),
    "NED": (ned, "world is z down .north, east, down. and the body z down"),
    "z down": (
        lambda log: turned(log, DOWN, lambda R: DOWN @ R),
        "world is z down while the body axes",
    ),
    "FRD body": (
        lambda log: turned(log, None, lambda R: R @ DOWN),
        "body axes are forward, right, down in a world",
    ),
    "NED position": (lambda log: turned(log, DOWN), "position is z down .* but the attitude z up"),
    "NED attitude": (
        lambda log: turned(log, None, lambda R: DOWN @ R @ DOWN),
        "attitude is z down .* but the position",
    ),
    "y up": (
        lambda log: turned(log, Y_UP, lambda R: Y_UP @ R),
        "world is y up, .* with body axes forward, left, up",
    ),
    "y up body": (
        lambda log: turned(log, Y_UP, lambda R: Y_UP @ R @ Y_UP.T),
        "world and the body are y up",
    ),
    "y, z swapped": (
        lambda log: replace(log, position=log.position[:, [0, 2, 1]]),
        "py and pz are swapped, the attitude",
    ),
    "all y, z swapped": (
        lambda log: replace(
            log, position=log.position[:, [0, 2, 1]], quaternion=log.quaternion[:, [0, 1, 3, 2]]
        ),
        "y and z are swapped, in posi",
    ),
    "x, y swapped": (
        lambda log: replace(log, position=log.position[:, [1, 0, 2]]),
        "px and py are swapped",
    ),
    "px negated": (
        lambda log: replace(log, position=log.position * [-1.0, 1.0, 1.0]),
        "px points the other way .* negate px",
    ),
    "py negated": (
        lambda log: replace(log, position=log.position * [1.0, -1.0, 1.0]),
        "py points the other way .* negate py",
    ),
    "position turned by 180": (
        lambda log: replace(log, position=log.position * [-1.0, -1.0, 1.0]),
        "turned against the attitude's by 180 degrees",
    ),
    "position turned by 90": (
        lambda log: replace(log, position=log.position[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]),
        "turned against the attitude's by 90 degrees",
    ),
    "scalar last, NED": (
        lambda log: scalar_last(ned(log)),
        "quaternion is scalar last and the world (is )?z down",
    ),
    "millimetres": (
        lambda log: replace(log, position=1e3 * log.position),
        "px, py, pz look like millimetres",
    ),
    "centimetres": (
        lambda log: replace(log, position=1e2 * log.position),
        "px, py, pz look like centimetres",
    ),
    "deg/s": (
        lambda log: replace(log, rotor_speeds=np.degrees(log.rotor_speeds)),
        "look like degrees per second",
    ),
    "rpm": (
        lambda log: replace(log, rotor_speeds=log.rotor_speeds * 30 / np.pi),
        "look like revolutions per minute",
    ),
    "Hz": (
        lambda log: replace(log, rotor_speeds=log.rotor_speeds / (2 * np.pi)),
        "look like revolutions per second",
    ),
    "ms": (
        lambda log: replace(log, t=1e3 * log.t),
        "t looks like milliseconds: .*divide t by 1000",
    ),
    "us": (lambda log: replace(log, t=1e6 * log.t), "t looks like microseconds"),
    "rotors late": (
        lambda log: shifted(log, 0.3),
        r"rotor speeds come 0\.[23]\d s too late .* put omega1..omega4 .* earlier",
    ),
    "rotors early": (
        lambda log: shifted(log, -0.5),
        r"rotor speeds come 0\.[45]\d s too early .* later",
    ),
    "Betaflight": (
        lambda log: replace(log, rotor_speeds=log.rotor_speeds[:, [2, 3, 1, 0]]),
        "rotors look permuted: omega1..omega4 are rotors 3,4,2,1 of this vehicle .Betaflight's "
        "order",
    ),
    "PX4": (
        lambda log: replace(log, rotor_speeds=log.rotor_speeds[:, [3, 1, 0, 2]]),
        "rotors 4,2,1,3 .* PX4",
    ),
    "Crazyflie": (
        lambda log: replace(log, rotor_speeds=log.rotor_speeds[:, ::-1]),
        "rotors 4,3,2,1 .* Crazyflie's",
    ),
}
