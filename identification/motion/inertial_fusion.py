"""Attitude, velocity, position and sensor biases from an IMU, with any positions and attitudes
measured beside it: none, a few a second, or many.

A fixed-interval smoother of the error state (attitude, velocity, position, gyro bias, accelerometer
bias), linearised about its own result and repeated (Gauss-Newton; H. E. Rauch, F. Tung, C. T.
Striebel, AIAA Journal 3 (1965), 1445-1450; B. M. Bell, SIAM Journal on Optimization 4 (1994),
626-636). One fact is known without any position: a vehicle's velocity is bounded. So over tens of
seconds the specific force in the world is gravity, and the tilt is known to some mrad. Heading,
velocity and position are not: the result states their large standard deviations.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ... import _core
from ...runtime.arrays import Array
from ..logs.table import ArrayPair
from .smoothing import resampled, second_difference

STEADY_VELOCITY_STD = 5.0  # m/s: a steady velocity does not change an IMU's readings
LEVELLING = 5.0  # s, time constant of the first guess, which takes gravity for up
# attitude (body), velocity, position (world), gyro bias, accelerometer bias: three each, 15 in all
ATTITUDE, VELOCITY, POSITION = 0, 3, 6  # the first of their three


class Readings(NamedTuple):
    """Positions or attitudes measured beside an IMU: m of them, at times (m,) s."""

    t: Array  # (m,) s
    values: Array  # (m, 3) m, world; or (m, 3, 3) body to world
    std: float  # m, or rad, of one axis


class ImuPiece(NamedTuple):
    """An unbroken, evenly sampled piece of IMU readings."""

    t: Array  # (n,) s, evenly spaced
    gyro: Array  # (n, 3) rad/s, body
    force: Array  # (n, 3) specific force, m/s2, body: +g along z in a hover
    gravity: float  # m/s2
    noise: Array  # (2,) standard deviation of a sample of gyro (rad/s) and accelerometer (m/s2)


class FusedMotion(NamedTuple):
    """Motion at m knots, and its standard deviations."""

    t: Array  # (m,) s
    rotation: Rotation  # (m) body to world
    # (m, 12) velocity (m/s) and position (m), world; bias of gyro (rad/s) and accelerometer (m/s2)
    linear: Array
    std: Array  # (m, 15) of attitude (rad, body), velocity, position and the two biases


def _integrate(gyro: Array, force: Array, dt: float, stride: int) -> tuple[Rotation, Array, Array]:
    """Return the IMU's motion in each of m intervals between knots: turns (m), and the change of
    velocity and position (m, 3) by the specific force, in the axes of its start.
    """
    w, f = (0.5 * (x[:-1] + x[1:]).reshape(-1, stride, 3) for x in (gyro, force))
    turn, (speed, way) = Rotation.identity(len(w)), np.zeros((2, len(w), 3))
    for j in range(stride):
        a = (turn * Rotation.from_rotvec(0.5 * dt * w[:, j])).apply(f[:, j])
        way += speed * dt + 0.5 * dt * dt * a
        speed += a * dt
        turn = turn * Rotation.from_rotvec(dt * w[:, j])
    return turn, speed, way


def _steps(
    T: float,
    gravity: float,
    rotation: Rotation,
    linear: Array,
    moved: tuple[Rotation, Array, Array],
) -> ArrayPair:
    """Return the steps from each of m knots to the next, ``T`` s later, about the nominal motion:
    their matrices (m, 15, 15), and the next knots' defects (m, 15) by the motion of the IMU.
    """
    before, (velocity, position, b, a) = rotation[:-1], np.split(linear[:-1], 4, axis=1)
    turn = moved[0] * Rotation.from_rotvec(-T * b)
    way, move = moved[1] - a * T, moved[2] - 0.5 * T * T * a
    R, one = before.as_matrix(), np.eye(3)
    F = np.tile(np.eye(15), (len(R), 1, 1))
    F[:, 0:3, 0:3] = turn.inv().as_matrix()
    F[:, 0:3, 9:12], F[:, 6:9, 3:6] = -T * one, T * one
    F[:, 3:6, 0:3], F[:, 6:9, 0:3] = (np.cross(x[:, None], R) for x in (way, move))
    F[:, 3:6, 12:15], F[:, 6:9, 12:15] = -T * R, -0.5 * T * T * R
    fall = np.array([0.0, 0.0, gravity])
    speed = velocity + before.apply(way) - T * fall
    place = position + T * velocity + before.apply(move) - 0.5 * T * T * fall
    tilt = (rotation[1:].inv() * (before * turn)).as_rotvec()
    return F, np.column_stack([tilt, np.column_stack([speed, place, b, a]) - linear[1:]])


def fuse(
    imu: ImuPiece, positions: Readings | None = None, attitudes: Readings | None = None
) -> FusedMotion:
    """Return the motion of a piece of IMU readings.

    Args:
        imu: the piece.
        positions: measured beside it, world.
        attitudes: likewise. Without positions and attitudes the heading is zero at the start.
    """
    dt = np.ptp(imu.t) / (len(imu.t) - 1)
    stride = max(1, round(0.02 / dt))  # 20 ms from state to state, of the integrated IMU
    count = (len(imu.t) - 1) // stride
    T, end = stride * dt, count * stride + 1
    moved = _integrate(imu.gyro[:end], imu.force[:end], dt, stride)
    times = imu.t[0] + T * np.arange(count + 1)
    at_knots = imu._replace(t=times, gyro=imu.gyro[:end:stride], force=imu.force[:end:stride])
    rotation, heading_std = _first_guess(at_knots, positions, attitudes)
    linear = np.zeros((count + 1, 12))
    if positions is None:
        # an unmeasured velocity has 2 m/s, and is another one after 3 s
        bound = np.arange(times[0], times[-1], 3.0)
        readings = {VELOCITY: Readings(bound, np.zeros((len(bound), 3)), 2.0)}
    else:
        linear[:, 3:6] = resampled(times, positions.t, positions.values)
        readings = {POSITION: positions}
    if attitudes is not None:
        readings[ATTITUDE] = attitudes
    # least credible noise of one sample, and the walk of a bias in a second: rad/s and m/s2
    gyro_noise, force_noise = np.maximum(imu.noise, (0.001, 0.01)) ** 2 * dt * T
    walks = np.square((3e-4, 3e-3)) * T
    spread = np.repeat([gyro_noise, force_noise, force_noise * T**2 / 3.0, *walks], 3)
    started = rotation[0]
    # a heading is a turn about the world's vertical, in body axes
    up = np.abs(started.as_matrix()[2])
    angles = np.sqrt((0.3 * (1.0 - up)) ** 2 + (heading_std * up) ** 2)
    # m/s, m, and biases of MEMS sensors from one switching-on to the next: rad/s and m/s2
    priors = np.repeat([STEADY_VELOCITY_STD, 10.0, 0.03, 0.2], 3)
    prior_std = np.append(angles + 1e-4, priors)
    begun = linear[0].copy()
    change, std = np.zeros((2, count + 1, 15))
    for _ in range(6):
        change[0, :3] = (rotation[0].inv() * started).as_rotvec()
        change[0, 3:], std[0] = begun - linear[0], prior_std
        knots, firsts, late, off, variances = _measured(at_knots, rotation, linear, readings)
        F, defect = _steps(T, imu.gravity, rotation, linear, moved)
        if not _core.smooth_inertial_motion(
            F, defect, spread, knots, firsts, late, off, variances, change, std
        ):
            raise np.linalg.LinAlgError("the covariance of an inertial motion is singular")
        turn = Rotation.from_rotvec(change[:, :3])
        rotation = rotation * turn
        linear += change[:, 3:]
        if turn.magnitude().max() < 1e-4:
            break
    if positions is None:
        std[:, 3:6] = np.hypot(std[:, 3:6], STEADY_VELOCITY_STD)
    return FusedMotion(times, rotation, linear, std)


def _first_guess(
    imu: ImuPiece, positions: Readings | None, attitudes: Readings | None
) -> tuple[Rotation, float]:
    """Return an attitude (m) to linearise about, and the standard deviation (rad) of its
    heading at the start.
    """
    dt = imu.t[1] - imu.t[0]
    quaternions = np.empty((len(imu.t), 4))
    # roll and pitch return to their start: their mean rate is the bias
    rates = imu.gyro - np.append(imu.gyro.mean(axis=0)[:2], 0.0)
    first = imu.force[: max(1, round(LEVELLING / dt))].mean(axis=0)
    size = np.linalg.norm(first)
    up = first / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    ahead = np.eye(3)[0 if abs(up[0]) < 1.0 - 1e-9 else 1]
    level, _ = Rotation.align_vectors(np.eye(3)[[2, 0]], [up, ahead], weights=[np.inf, 1.0])
    start = level.as_quat(scalar_first=True)
    _core.level_attitude(rates, imu.force, dt, LEVELLING, start, quaternions)
    out = Rotation.from_quat(quaternions, scalar_first=True)
    if attitudes is not None:
        nearest = np.abs(imu.t - attitudes.t[0]).argmin()
        heading = _turned_heading(out[nearest], Rotation.from_matrix(attitudes.values[0]))
    elif positions is not None and len(positions.t) > 20:
        heading = _heading(imu, out[0], positions)
    else:
        return out, 0.0
    return Rotation.from_euler("z", heading) * out, 0.3


def _heading(imu: ImuPiece, start: Rotation, positions: Readings) -> float:
    """Return the heading (rad) that turns the horizontal motion of a levelled IMU, from ``start``,
    into the positions': the mean turn between their changes of velocity over some seconds.
    """
    alone = fuse(imu)
    step = 2.0  # s: an IMU alone keeps a velocity's change over it, and a position shows it
    at = np.arange(imu.t[0] + step, imu.t[-1] - step, 0.5 * step)
    plane = np.array([1.0, 1.0j, 0.0])
    felt = second_difference(at, step, alone.t, alone.linear[:, 3:6]) @ plane
    seen = second_difference(at, step, positions.t, positions.values) @ plane
    zero = _turned_heading(start, alone.rotation[0])
    return float(np.angle(np.sum(np.conj(felt) * seen))) + zero


def _turned_heading(before: Rotation, after: Rotation) -> float:
    """Return the heading (rad) by which one attitude is turned from another."""
    turn = (after * before.inv()).as_matrix()
    return math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])


def _measured(
    imu: ImuPiece, rotation: Rotation, linear: Array, readings: Mapping[int, Readings]
) -> list[np.ndarray]:
    """Return the readings by the first of their states, sorted by the nearest of an IMU's knots:
    this knot, the first state, s behind the knot, the distance (3,) from a nominal motion, and its
    variance.
    """
    times = imu.t
    parts = []
    for first, r in readings.items():
        knots = np.rint((r.t - times[0]) / (times[1] - times[0])).astype(np.int64)
        knots = np.clip(knots, 0, len(times) - 1)
        late = r.t - times[knots]
        if first == ATTITUDE:
            turn = Rotation.from_rotvec(imu.gyro[knots] * late[:, None])
            off = ((rotation[knots] * turn).inv() * Rotation.from_matrix(r.values)).as_rotvec()
        else:
            off = r.values - linear[knots, first - 3 : first]
            if first == POSITION:
                off -= late[:, None] * linear[knots, 0:3]
        parts.append((knots, np.full_like(knots, first), late, off, np.full(len(knots), r.std**2)))
    columns = [np.concatenate(part) for part in zip(*parts, strict=True)]
    order = np.argsort(columns[0], kind="stable")
    return [column[order] for column in columns]
