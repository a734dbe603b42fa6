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

from ...runtime.compiled import compiled
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


@compiled
def _cross_matrix(x: Array) -> Array:
    out = np.zeros((3, 3))
    out[0, 1], out[0, 2], out[1, 2] = -x[2], x[1], -x[0]
    out[1, 0], out[2, 0], out[2, 1] = x[2], -x[1], x[0]
    return out


@compiled
def _exp(x: float, y: float, z: float) -> Array:
    """Return the rotation matrix of a rotation vector (rad)."""
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-6:
        a, b = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    across = _cross_matrix(np.array([x, y, z]))
    return np.eye(3) + a * across + b * (across @ across)


@compiled
def _log(R: Array) -> Array:
    """Return the rotation vector (3,) of a rotation matrix, of less than half a turn."""
    out = np.empty(3)
    out[0], out[1], out[2] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    sine = 0.5 * math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    angle = math.atan2(sine, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0))
    out *= 0.5 if sine < 1e-9 else 0.5 * angle / sine
    return out


@compiled
def _integrate(
    gyro: Array, force: Array, dt: float, stride: int, turns: Array, ways: Array, moves: Array
) -> None:
    """Write the IMU's motion in each interval between knots: turn (m, 3, 3), and the change of
    velocity and position (m, 3) by the specific force, in the axes of its start.
    """
    for k in range(len(turns)):
        turn, speed, way = np.eye(3), np.zeros(3), np.zeros(3)
        for j in range(k * stride, (k + 1) * stride):
            w = 0.5 * (gyro[j] + gyro[j + 1]) * dt
            half = turn @ _exp(0.5 * w[0], 0.5 * w[1], 0.5 * w[2])
            a = half @ (0.5 * (force[j] + force[j + 1]))
            way += speed * dt + 0.5 * dt * dt * a
            speed += a * dt
            turn = turn @ _exp(w[0], w[1], w[2])
        turns[k], ways[k], moves[k] = turn, speed, way


@compiled
def _levelled(gyro: Array, force: Array, dt: float, time: float, R: Array, out: Array) -> None:
    """Write the attitude (n, 3, 3) integrated from the gyro and slowly levelled by the specific
    force (R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE Transactions on Automatic Control 53 (2008)).
    """
    for k in range(len(gyro)):
        out[k] = R
        size = math.sqrt(np.sum(force[k] ** 2)) + 1e-9
        up, seen = R[2], force[k] / size
        w = gyro[k].copy()
        w[0] += (seen[1] * up[2] - seen[2] * up[1]) / time
        w[1] += (seen[2] * up[0] - seen[0] * up[2]) / time
        w[2] += (seen[0] * up[1] - seen[1] * up[0]) / time
        R = np.ascontiguousarray(R @ _exp(w[0] * dt, w[1] * dt, w[2] * dt))


@compiled
def _predict(k: int, nominal: Nominal, F: Array, defect: Array) -> None:
    """Write the step from knot ``k`` to the next about the nominal motion: its matrix, and the next
    knot's defect by the IMU.
    """
    T, gravity, rotation, linear, turns, ways, moves = nominal
    R, b, a = rotation[k], linear[k, 6:9], linear[k, 9:12]
    turn = turns[k] @ _exp(-b[0] * T, -b[1] * T, -b[2] * T)
    way, move = ways[k] - a * T, moves[k] - 0.5 * T * T * a
    F[:] = 0.0
    for i in range(3):
        F[3 + i, 3 + i] = F[6 + i, 6 + i] = F[9 + i, 9 + i] = F[12 + i, 12 + i] = 1.0
        F[i, 9 + i], F[6 + i, 3 + i] = -T, T
    F[0:3, 0:3] = turn.T
    F[3:6, 0:3] = -R @ _cross_matrix(way)
    F[6:9, 0:3] = -R @ _cross_matrix(move)
    F[3:6, 12:15], F[6:9, 12:15] = -T * R, -0.5 * T * T * R
    defect[0:3] = _log(rotation[k + 1].T @ (R @ turn))
    defect[3:6] = linear[k, 0:3] + R @ way - linear[k + 1, 0:3]
    defect[6:9] = linear[k, 3:6] + T * linear[k, 0:3] + R @ move - linear[k + 1, 3:6]
    defect[5] -= gravity * T
    defect[8] -= 0.5 * gravity * T * T
    defect[9:15] = linear[k, 6:12] - linear[k + 1, 6:12]


@compiled
def _update(x: Array, P: Array, first: int, late: float, z: Array, variance: float) -> None:
    """Take in a measurement (3,) of three of the states from ``first`` on; positions are ``late`` s
    behind the knot.
    """
    for i in range(3):
        h = np.zeros(N)
        h[first + i] = 1.0
        if first == POSITION:
            h[3 + i] = late
        c = P @ h
        gain = c / (h @ c + variance)
        x += gain * (z[i] - h @ x)
        P -= np.outer(gain, c)


@compiled
def _smooth(
    nominal: Nominal,
    noise: Array,
    prior: Array,
    prior_std: Array,
    measured: Measurements,
    change: Array,
    std: Array,
) -> None:
    """Write the smoothed error state (m, 15) about a nominal motion and its standard deviations."""
    knots, firsts, late, off, variances = measured
    m = len(nominal[2])
    means, covariances = np.empty((m, N)), np.empty((m, N, N))
    before, spreads = np.empty((m, N)), np.empty((m, N, N))
    F, defect = np.zeros((N, N)), np.zeros(N)
    x, P = prior.copy(), np.diag(prior_std**2)
    at = 0
    for k in range(m):
        if k > 0:
            _predict(k - 1, nominal, F, defect)
            x = F @ x + defect
            P = F @ P @ F.T
            for i in range(N):
                P[i, i] += noise[i]
        before[k], spreads[k] = x, P
        P = P.copy()
        while at < len(knots) and knots[at] == k:
            _update(x, P, firsts[at], late[at], off[at], variances[at])
            at += 1
        P = 0.5 * (P + P.T)
        means[k], covariances[k] = x, P
    change[m - 1] = x
    std[m - 1] = np.sqrt(np.maximum(np.diag(P), 0.0))
    for k in range(m - 2, -1, -1):
        _predict(k, nominal, F, defect)
        gain = np.linalg.solve(spreads[k + 1], F @ covariances[k]).T.copy()
        x = means[k] + gain @ (x - before[k + 1])
        P = covariances[k] + gain @ (P - spreads[k + 1]) @ gain.T
        P = 0.5 * (P + P.T)
        change[k] = x
        std[k] = np.sqrt(np.maximum(np.diag(P), 0.0))


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
    turns, ways, moves = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 3))
    _integrate(gyro, force, dt, stride, turns, ways, moves)
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
        prior = np.concatenate([_log(rotation[0].T @ started), begun - linear[0]])
        measured = _measured(times, rates, rotation, linear, readings)
        _smooth(nominal, spread, prior, prior_std, measured, change, std)
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
    out = np.empty((len(times), 3, 3))
    # roll and pitch return to their start: their mean rate is the bias
    rates = gyro - np.append(gyro.mean(axis=0)[:2], 0.0)
    first = force[: max(1, round(LEVELLING / dt))].mean(axis=0)
    up = first / np.linalg.norm(first)
    forward = np.array([1.0, 0.0, 0.0]) - up[0] * up
    forward /= max(float(np.linalg.norm(forward)), 1e-9)
    level = np.stack([forward, np.cross(up, forward), up])
    _levelled(rates, force, dt, LEVELLING, np.ascontiguousarray(level), out)
    if attitudes is not None and len(attitudes.t):
        nearest_knot = np.abs(np.subtract.outer(attitudes.t[:1], times)).argmin(axis=1)[0]
        heading = _turned_heading(out[nearest_knot], attitudes.values[0])
    elif positions is not None and len(positions.t) > 20:
        heading = _heading(times, out, force, gravity, noise, gyro, positions)
    else:
        return out, 0.0
    return np.ascontiguousarray(_exp(0.0, 0.0, heading) @ out), HEADING_STD


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
