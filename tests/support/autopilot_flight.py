"""One flight as autopilots log it: it climbs, yaws and tilts, and its rotors speed up."""

import numpy as np
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

FLIP = np.diag([1.0, -1.0, -1.0])  # our world and body seen from PX4's, each half a turn about x
# rad/s of front-left, rear-left, rear-right, front-right
OURS = np.array([301.0, 302.0, 303.0, 304.0])
PX4 = OURS[[3, 1, 0, 2]]  # 1 front-right, 2 rear-left, 3 front-left, 4 rear-right


def motion(t):
    """Positions (N, 3) in m and attitudes in the kit's frames."""
    position = np.column_stack([0.5 * np.cos(t), 0.8 * np.sin(t), 1.0 + 0.1 * t])
    angles = np.column_stack([2.0 + 1.5 * t, 0.2 * np.sin(2 * t), 0.3 * np.cos(t)])
    return position, Rotation.from_euler("ZYX", angles)


def inertial(t):
    """Angular velocity (rad/s) and specific force (m/s2), body axes forward, left, up."""
    turn = motion(t)[1]
    after = motion(t + 1e-5)[1]
    acceleration = np.column_stack([-0.5 * np.cos(t), -0.8 * np.sin(t), np.full(len(t), 9.81)])
    return (turn.inv() * after).as_rotvec() / 1e-5, turn.inv().apply(acceleration)


def ned(t):
    """The same motion with the world and the body's z down."""
    position, turn = motion(t)
    return position @ FLIP, Rotation.from_matrix(FLIP @ turn.as_matrix() @ FLIP)


def growth(t):
    """What the rotors turn at t over that at 0."""
    return 1.0 + 0.1 * t


def assert_motion(log, t, atol=1e-6, turned=None):
    """A log's valid rows are the flight at times t (N,), within ``atol`` m and ``turned`` rad."""
    position, turn = motion(t)
    assert_allclose(log.position[log.valid], position, atol=atol)
    seen = Rotation.from_quat(log.quaternion[log.valid], scalar_first=True)
    assert (turn.inv() * seen).magnitude().max() < (turned or 10 * atol)


def assert_inertial(log, t, atol=1e-3):
    gyro, force = inertial(t)
    assert_allclose(log.gyro, gyro, atol=atol)
    assert_allclose(log.accelerometer, force, atol=atol)
