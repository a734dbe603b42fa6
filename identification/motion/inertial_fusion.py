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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ... import _core
from ..logs.table import Array
from .smoothing import resampled, second_difference

Index = NDArray[np.int64]
# knot, first of three states, s behind the knot, distance (3,) from the nominal motion and variance
# of each, sorted by knot
Measurements = tuple[Index, Index, Array, Array, Array]
# s between knots, m/s2 of gravity; at each knot rotation (3, 3) and the twelve numbers behind the
# attitude's; from each to the next the IMU's turn, velocity and way
Nominal = tuple[float, float, Array, Array, Array, Array, Array]


KNOT = 0.02  # s from state to state; between them the IMU is integrated
# m/s, standard deviation of an unmeasured velocity, and s between two independent ones. A steady
# velocity besides does not change an IMU's readings
VELOCITY_STD = 2.0
VELOCITY_EVERY = 3.0
STEADY_VELOCITY_STD = 5.0  # m/s, of the steady one, which stays unknown
POSITION_STD = 10.0  # m, at the start, if not measured
TILT_STD = 0.3  # rad, at the start, from the mean specific force
HEADING_STD = 0.3  # rad, if shown by positions; exact without any reference
# of MEMS sensors, from one switching-on to the next: rad/s and m/s2, and their walk in a second
GYRO_BIAS_STD = 0.03
ACCELEROMETER_BIAS_STD = 0.2
GYRO_BIAS_WALK = 3e-4
ACCELEROMETER_BIAS_WALK = 3e-3
# least credible noise of one sample: rad/s and m/s2
LEAST_GYRO_NOISE = 0.001
LEAST_ACCELEROMETER_NOISE = 0.01
LEVELLING = 5.0  # s, time constant of the first guess, which takes gravity for up
ITERATIONS = 6
SETTLED = 1e-4  # rad, largest change of attitude in the last iteration
# attitude (body), velocity, position (world), gyro bias, accelerometer bias: three each
N = 15
ATTITUDE, VELOCITY, POSITION = 0, 3, 6  # the first of their three


@dataclass(frozen=True, eq=False)
class Readings:
    """Positions or attitudes measured beside an IMU: m of them, at times (m,) s."""

    t: Array  # (m,) s
    values: Array  # (m, 3) m, world; or (m, 3, 3) body to world
    std: float  # m, or rad, of one axis


@dataclass(frozen=True, eq=False)
class FusedMotion:
    """Motion at m knots, and its standard deviations."""

    t: Array  # (m,) s
    rotation: Array  # (m, 3, 3) body to world
    velocity: Array  # (m, 3) m/s, world
    position: Array  # (m, 3) m, world
    gyro_bias: Array  # (m, 3) rad/s, body
    accelerometer_bias: Array  # (m, 3) m/s2, body
    std: Array  # (m, 15) of attitude (rad, body), velocity, position and the two biases


def _cross_matrix(x: Array) -> Array:
    """Return the matrices (m, 3, 3) of the cross product with vectors (m, 3)."""
    out = np.zeros((len(x), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[:, j, i], out[:, i, j] = x[:, k], -x[:, k]
    return out


def _exp(x: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of rotation vectors (..., 3) rad."""
    matrices = Rotation.from_rotvec(x.reshape(-1, 3)).as_matrix()
    return np.asarray(matrices).reshape(*x.shape, 3)


def _log(R: Array) -> Array:
    """Return the rotation vectors (m, 3) of rotation matrices (m, 3, 3)."""
    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def _times(A: Array, x: Array) -> Array:
    """Return matrices (m, 3, 3) times vectors (m, 3)."""
    return np.asarray((A @ x[:, :, None])[:, :, 0])


def _integrate(gyro: Array, force: Array, dt: float, stride: int) -> tuple[Array, Array, Array]:
    """Return the IMU's motion in each of m intervals between knots: turn (m, 3, 3), and the change
    of velocity and position (m, 3) by the specific force, in the axes of its start.
    """
    w, f = (0.5 * (x[:-1] + x[1:]).reshape(-1, stride, 3) for x in (gyro, force))
    halves, wholes = _exp(0.5 * dt * w), _exp(dt * w)
    turn, speed, way = np.eye(3), np.zeros((len(w), 3)), np.zeros((len(w), 3))
    for j in range(stride):
        a = _times(turn @ halves[:, j], f[:, j])
        way += speed * dt + 0.5 * dt * dt * a
        speed += a * dt
        turn = turn @ wholes[:, j]
    return turn, speed, way


def _steps(nominal: Nominal) -> tuple[Array, Array]:
    """Return the steps from each of m knots to the next about the nominal motion: their matrices
    (m, 15, 15), and the next knots' defects (m, 15) by the IMU.
    """
    T, gravity, rotation, linear, turns, ways, moves = nominal
    R, (velocity, position, b, a) = rotation[:-1], np.split(linear[:-1], 4, axis=1)
    turn = turns @ _exp(-T * b)
    way, move = ways - a * T, moves - 0.5 * T * T * a
    F, one = np.tile(np.eye(N), (len(R), 1, 1)), np.eye(3)
    F[:, 0:3, 0:3] = turn.swapaxes(1, 2)
    F[:, 0:3, 9:12], F[:, 6:9, 3:6] = -T * one, T * one
    F[:, 3:6, 0:3] = -R @ _cross_matrix(way)
    F[:, 6:9, 0:3] = -R @ _cross_matrix(move)
    F[:, 3:6, 12:15], F[:, 6:9, 12:15] = -T * R, -0.5 * T * T * R
    fall = np.array([0.0, 0.0, gravity])
    after = [velocity + _times(R, way) - T * fall]
    after += [position + T * velocity + _times(R, move) - 0.5 * T * T * fall, b, a]
    tilt = _log(rotation[1:].swapaxes(1, 2) @ (R @ turn))
    return F, np.concatenate([tilt, np.concatenate(after, axis=1) - linear[1:]], axis=1)


def fuse(
    t: Array,
    gyro: Array,
    force: Array,
    gravity: float,
    noise: tuple[float, float],
    positions: Readings | None = None,
    attitudes: Readings | None = None,
) -> FusedMotion:
    """Return the motion of an unbroken, evenly sampled piece of IMU readings.

    Args:
        t: (n,) s, evenly spaced.
        gyro: (n, 3) rad/s, body.
        force: (n, 3) specific force, m/s2, body: +g along z in a hover.
        gravity: m/s2.
        noise: standard deviation of one sample of gyro (rad/s) and accelerometer (m/s2).
        positions: measured beside them, world.
        attitudes: likewise. Without positions and attitudes the heading is zero at the start.
    """
    dt = float((t[-1] - t[0]) / (len(t) - 1))
    stride = max(1, round(KNOT / dt))
    count = (len(t) - 1) // stride
    T = stride * dt
    gyro, force = (np.ascontiguousarray(x[: count * stride + 1]) for x in (gyro, force))
    turns, ways, moves = _integrate(gyro, force, dt, stride)
    times = t[0] + T * np.arange(count + 1)
    rates, forces = (np.ascontiguousarray(x[::stride]) for x in (gyro, force))
    rotation, heading_std = _first_guess(times, rates, forces, gravity, noise, positions, attitudes)
    linear = np.zeros((count + 1, 12))
    if positions is not None:
        linear[:, 3:6] = resampled(times, positions.t, positions.values)
    bound = np.arange(times[0], times[-1], VELOCITY_EVERY)
    still = Readings(bound, np.zeros((len(bound), 3)), VELOCITY_STD)
    readings = {VELOCITY: still} if positions is None else {POSITION: positions}
    readings |= {} if attitudes is None else {ATTITUDE: attitudes}
    sizes = np.maximum(noise, [LEAST_GYRO_NOISE, LEAST_ACCELEROMETER_NOISE])
    walks = np.array([GYRO_BIAS_WALK, ACCELEROMETER_BIAS_WALK])
    gyro_noise, force_noise = sizes**2 * dt * T
    spread = np.repeat([gyro_noise, force_noise, force_noise * T**2 / 3.0, *(walks**2 * T)], 3)
    started = rotation[0].copy()
    up = np.abs(started[2])  # a heading is a turn about the world's vertical, in body axes
    angles = np.sqrt((TILT_STD * (1.0 - up)) ** 2 + (heading_std * up) ** 2)
    priors = [STEADY_VELOCITY_STD, POSITION_STD, GYRO_BIAS_STD]
    prior_std = np.concatenate([angles + 1e-4, np.repeat([*priors, ACCELEROMETER_BIAS_STD], 3)])
    begun = linear[0].copy()
    begun[6:] = 0.0
    nominal = (T, gravity, rotation, linear, turns, ways, moves)
    change, std = np.zeros((2, count + 1, N))
    for _ in range(ITERATIONS):
        change[0, :3] = _log(rotation[:1].swapaxes(1, 2) @ started)
        change[0, 3:], std[0] = begun - linear[0], prior_std
        measured = _measured(times, rates, rotation, linear, readings)
        F, defect = _steps(nominal)
        if not _core.smooth_inertial_motion(F, defect, spread, *measured, change, std):
            raise np.linalg.LinAlgError("the covariance of an inertial motion is singular")
        turn = Rotation.from_rotvec(change[:, :3])
        rotation[:] = (Rotation.from_matrix(rotation) * turn).as_matrix()
        linear += change[:, 3:]
        if turn.magnitude().max() < SETTLED:
            break
    if positions is None:
        std[:, 3:6] = np.hypot(std[:, 3:6], STEADY_VELOCITY_STD)
    return FusedMotion(
        times, rotation, linear[:, :3], linear[:, 3:6], linear[:, 6:9], linear[:, 9:], std
    )


def _first_guess(
    times: Array,
    gyro: Array,
    force: Array,
    gravity: float,
    noise: tuple[float, float],
    positions: Readings | None,
    attitudes: Readings | None,
) -> tuple[Array, float]:
    """Return an attitude (m, 3, 3) to linearise about, and the standard deviation (rad) of its
    heading at the start.
    """
    dt = float(times[1] - times[0])
    quaternions = np.empty((len(times), 4))
    # roll and pitch return to their start: their mean rate is the bias
    rates = gyro - np.append(gyro.mean(axis=0)[:2], 0.0)
    first = force[: max(1, round(LEVELLING / dt))].mean(axis=0)
    size = float(np.linalg.norm(first))
    up = first / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    ahead = np.eye(3)[0 if abs(up[0]) < 1.0 - 1e-9 else 1]
    forward = ahead - (up @ ahead) * up
    forward /= np.linalg.norm(forward)
    level = np.stack([forward, np.cross(up, forward), up])
    start = Rotation.from_matrix(level).as_quat(scalar_first=True)
    _core.level_attitude(rates, force, dt, LEVELLING, start, quaternions)
    out = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    if attitudes is not None and len(attitudes.t):
        nearest_knot = np.abs(np.subtract.outer(attitudes.t[:1], times)).argmin(axis=1)[0]
        heading = _turned_heading(out[nearest_knot], attitudes.values[0])
    elif positions is not None and len(positions.t) > 20:
        heading = _heading(times, out, force, gravity, noise, gyro, positions)
    else:
        return out, 0.0
    return _exp(np.array([0.0, 0.0, heading])) @ out, HEADING_STD


def _heading(
    times: Array,
    rotation: Array,
    force: Array,
    gravity: float,
    noise: tuple[float, float],
    gyro: Array,
    positions: Readings,
) -> float:
    """Return the heading (rad) that turns a levelled IMU's horizontal motion into the positions':
    the mean turn between their changes of velocity over some seconds.
    """
    alone = fuse(times, gyro, force, gravity, noise)
    step = 2.0  # s: an IMU alone keeps a velocity's change over it, and a position shows it
    at = np.arange(times[0] + step, times[-1] - step, 0.5 * step)
    plane = np.array([1.0, 1.0j, 0.0])
    felt = second_difference(at, step, alone.t, alone.position) @ plane
    seen = second_difference(at, step, positions.t, positions.values) @ plane
    zero = _turned_heading(rotation[0], alone.rotation[0])
    return float(np.angle(np.sum(np.conj(felt) * seen))) + zero


def _turned_heading(before: Array, after: Array) -> float:
    """Return the heading (rad) by which one attitude (3, 3) is turned from another."""
    turn = after @ before.T
    return math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])


def _measured(
    times: Array,
    rates: Array,
    rotation: Array,
    linear: Array,
    readings: Mapping[int, Readings],
) -> Measurements:
    """Return the distances of all readings, by the first of their states, from a nominal motion at
    the nearest knot.
    """
    parts = []
    for first, r in readings.items():
        knots = np.rint((r.t - times[0]) / (times[1] - times[0])).astype(np.int64)
        knots = np.clip(knots, 0, len(times) - 1)
        late = r.t - times[knots]
        if first == ATTITUDE:
            turn = Rotation.from_rotvec(rates[knots] * late[:, None])
            seen = (Rotation.from_matrix(rotation[knots]) * turn).inv()
            off = (seen * Rotation.from_matrix(r.values)).as_rotvec()
        elif first == VELOCITY:
            off = r.values - linear[knots, 0:3]
        else:
            off = r.values - linear[knots, 3:6] - late[:, None] * linear[knots, 0:3]
        parts.append((knots, np.full_like(knots, first), late, off, np.full(len(knots), r.std**2)))
    knots, firsts, late, off, variances = (
        np.concatenate(part) for part in zip(*parts, strict=True)
    )
    order = np.argsort(knots, kind="stable")
    return knots[order], firsts[order], late[order], off[order], variances[order]
