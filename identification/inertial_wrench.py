"""The external wrench from an IMU: of logs without a pose, and the smoothed one of logs with both.

The specific force is the balance of forces itself: what it needs beyond the rotors and the declared
effects is the external force, sample by sample, and the gyro's rate shows the torque likewise. Both
go through a fixed-interval smoother of the wrench filter's own model: a wrench that walks, rotors
that miss some thrust and torque anew in each step. Attitude and biases come from
``inertial_fusion`` (with the poses, where there are some); what they leave uncertain is in the
standard deviations.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation

from ..dynamics.vehicle import Vehicle
from ..estimator import UKFTuning, WrenchEstimate
from ..estimator.estimate import (
    COASTING,
    FORCE,
    NIS,
    POSITION,
    QUATERNION,
    RATE,
    STATE_SIZE,
    STATUS,
    TORQUE,
    TRACKING,
    VELOCITY,
    WITHOUT_COVARIANCE,
)
from .logs.flight_log import FlightLog
from .motion.inertial_signals import (
    InertialSignals,
    imu_noise,
    inertial_signals,
    pose_rate,
)
from .motion.residual import acting_wrench, needed_wrench
from .motion.smoothing import continuous, resampled

Array = NDArray[np.float64]


def inertial_wrench(
    log: FlightLog, vehicle: Vehicle, tuning: UKFTuning
) -> tuple[WrenchEstimate, tuple[str, ...]]:
    """Return the smoothed estimate at every row (N,) of a log by its gyro and accelerometer, and
    notes.

    The status is "tracking" within an unbroken piece of IMU readings, else "coasting". Position and
    velocity are NaN where nothing measured them; there is no NIS.

    Args:
        log: with gyro, accelerometer and rotor speeds; poses in it are used.
        vehicle: as declared.
        tuning: of the wrench filter.

    Raises:
        InputError: no unbroken piece of IMU readings is longer than 3 s.
    """
    noise, count = imu_noise(log), len(log.t)
    numbers, std = np.zeros((count, WITHOUT_COVARIANCE)), np.full((count, 18), np.nan)
    numbers[:, STATUS] = COASTING
    before = 0
    pieces = inertial_signals(log, vehicle.gravity)
    for number, s in enumerate(pieces):
        state, spread = _piece(s, vehicle, tuning, log.period, noise)
        # rows between two pieces hold the values of the nearer end of the one before
        end = count if number + 1 == len(pieces) else int(np.searchsorted(log.t, s.t[-1]) + 1)
        t = log.t[before:end]
        numbers[before:end, :STATE_SIZE] = resampled(t, s.t, state)
        std[before:end, 12:] = resampled(t, s.t, spread)
        inside = (t >= s.t[0]) & (t <= s.t[-1] + log.period)
        numbers[before:end, STATUS] = np.where(inside, TRACKING, COASTING)
        before = end
    numbers[:, NIS] = np.nan
    if pose_rate(log) == 0.0:  # gyro and accelerometer alone drift away from them
        numbers[:, POSITION], numbers[:, VELOCITY] = np.nan, np.nan
    quaternion = numbers[:, QUATERNION]
    quaternion /= np.maximum(np.linalg.norm(quaternion, axis=1), 1e-9)[:, None]
    return WrenchEstimate(numbers, std), _notes(log, pieces, vehicle)


def _piece(
    s: InertialSignals,
    vehicle: Vehicle,
    tuning: UKFTuning,
    period: float,
    noise: tuple[float, float],
) -> tuple[Array, Array]:
    """Return the state (n, STATE_SIZE) of a piece, laid out as an estimate's, and the standard
    deviations of torque and force (n, 6).
    """
    acting, body = acting_wrench(s, vehicle)
    needed = needed_wrench(s, body)
    steps = s.period / period  # a walk of one step of the log, in one of the signals
    walk_force, walk_torque, miss_force, miss_torque = (
        np.broadcast_to(np.asarray(x, dtype=np.float64), 3)
        for x in (
            *(tuning.force_walk, tuning.torque_walk),
            *(tuning.thrust_noise, tuning.motor_torque_noise),
        )
    )
    residual = needed[:, :3] - acting[:, :3]
    inverse = np.linalg.inv(body.inertia)
    driven = acting[:, 3:] @ inverse.T
    force, torque = np.empty_like(residual), np.empty_like(residual)
    spread = np.empty(6)
    for i in range(3):
        variance = (body.mass * noise[1]) ** 2 + miss_force[i] ** 2 / steps
        walk = walk_force[i] ** 2 * steps
        # a walk that white noise of this variance hides
        y = residual[:, i, None]
        walked, std = _two_sided(y, np.zeros_like(y), np.eye(1), np.diag([walk]), variance)
        force[:, i], spread[i] = walked[:, 0], std[0]
        own = inverse[i, i]
        torque[:, i], spread[3 + i] = _smoothed_turning(
            s.angular_velocity[:, i],
            driven[:, i],
            s.period,
            (own * walk_torque[i]) ** 2 * steps,
            (own * miss_torque[i] * s.period) ** 2 / steps,
            max(noise[0], 1e-6) ** 2,
        )
        spread[3 + i] /= own
    off = body.mass * s.bias_std
    std_force = np.sqrt(spread[:3] ** 2 + np.einsum("nij,j->ni", np.square(s.rotation), off**2))
    std_torque = np.sqrt(np.einsum("nij,j->ni", np.square(s.rotation), spread[3:] ** 2))
    state = np.zeros((len(s.t), STATE_SIZE))
    state[:, POSITION], state[:, VELOCITY] = s.position, s.velocity
    state[:, RATE] = s.angular_velocity
    state[:, QUATERNION] = continuous(Rotation.from_matrix(s.rotation).as_quat(scalar_first=True))
    state[:, TORQUE] = np.einsum("nij,nj->ni", s.rotation, torque @ body.inertia.T)
    state[:, FORCE] = force
    return state, np.column_stack([std_torque, std_force])


def _smoothed_turning(
    rate: Array, driven: Array, period: float, walk: float, miss: float, variance: float
) -> tuple[Array, float]:
    """Return the angular acceleration (n,) rad/s2 beside the one that drives an angular velocity,
    and its standard deviation.
    """
    model = np.array([[1.0, period], [0.0, 1.0]])
    acting = 0.5 * period * (driven[:-1] + driven[1:])
    drive = np.column_stack([np.append(0.0, acting), np.zeros(len(rate))])
    out, std = _two_sided(rate[:, None], drive, model, np.diag([miss, walk]), variance)
    return out[:, 1], float(std[1])


def _two_sided(
    y: Array, drive: Array, model: Array, noise: Array, variance: float
) -> tuple[Array, Array]:
    """Return the states (n, m) of a steady fixed-interval smoother, of which the first is measured,
    and their standard deviations (m,).
    """
    m = len(model)
    H = np.eye(1, m)
    P = solve_discrete_are(model.T, H.T, noise + 1e-18 * np.eye(m), variance * np.eye(1))
    gain = (P @ H.T / (P[0, 0] + variance))[:, 0]
    after = P - np.outer(gain, P[0])
    back = np.linalg.solve(P, model @ after).T
    smoothed = after.copy()
    for _ in range(10_000):
        then = after + back @ (smoothed - P) @ back.T
        done = np.allclose(then, smoothed, rtol=1e-9, atol=0.0)
        smoothed = then
        if done:
            break
    predicted, filtered = np.empty((len(y), m)), np.empty((len(y), m))
    x = np.zeros(m)
    x[0] = float(np.mean(y[: max(1, len(y) // 200)]))
    for k in range(len(y)):
        if k:
            x = model @ x + drive[k]
        predicted[k] = x
        x = x + gain * (y[k, 0] - x[0])
        filtered[k] = x
    out = filtered.copy()
    for k in range(len(y) - 2, -1, -1):
        out[k] = filtered[k] + back @ (out[k + 1] - predicted[k + 1])
    return out, np.sqrt(np.maximum(np.diagonal(smoothed), 0.0))


def _notes(log: FlightLog, pieces: list[InertialSignals], vehicle: Vehicle) -> tuple[str, ...]:
    if pose_rate(log) > 0.0:
        return (
            "gyro and accelerometer were smoothed together with the "
            + ("poses" if log.valid.any() else "positions"),
        )
    bias = vehicle.mass * float(np.max([s.bias_std for s in pieces]))
    return (
        "the log has no pose: the wrench is read from gyro and accelerometer. Its force is "
        "along level axes, horizontal ones as the vehicle pointed at the start, which drift "
        f"with the gyro; a steady force below {bias:.2g} N may be the accelerometer's bias. "
        "Height, place and velocity are not known, and drag is part of the force",
    )
