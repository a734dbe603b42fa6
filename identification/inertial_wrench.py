"""The external wrench from an IMU: of logs without a pose, and the smoothed one of logs with both.

The specific force is the balance of forces itself. Less the rotors and the declared effects, it is
the external force, sample by sample, and the gyro's rate shows the torque likewise. Both go through
a fixed-interval smoother of the wrench filter's own model: a walking wrench, and rotors with a new
error of thrust and torque in each step. Attitude and biases come from ``inertial_fusion`` (with the
poses, if there are some); their uncertainty is in the standard deviations.
"""

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.spatial.transform import Rotation

from ..dynamics.vehicle import Vehicle
from ..estimator import UKFTuning, WrenchEstimate
from ..estimator.estimate import (
    COASTING,
    MODEL,
    POSITION,
    QUATERNION,
    STATE_SIZE,
    STATUS,
    TRACKING,
    VELOCITY,
    WITHOUT_COVARIANCE,
)
from ..estimator.model_uncertainty import LOAD, factors_of, variances_along
from ..estimator.tuning import decay_of
from .logs.flight_log import FlightLog
from .logs.table import Array, ArrayPair, Names, Pair
from .motion.inertial_signals import InertialSignals, imu_noise, inertial_signals, pose_rate
from .motion.residual import acting_wrench, needed_wrench
from .motion.smoothing import continuous, resampled, running_integral


def inertial_wrench(
    log: FlightLog, vehicle: Vehicle, tuning: UKFTuning
) -> tuple[WrenchEstimate, Array, Names]:
    """Return the smoothed estimate at every row (N,) of a log by its gyro and accelerometer, the
    loads (N, 7, 3) of ``estimator.model_uncertainty``, and notes.

    The status is "tracking" within an unbroken piece of IMU readings, else "coasting". Unmeasured
    position and velocity are NaN; there is no NIS.

    Args:
        log: with gyro, accelerometer and rotor speeds; its poses are used.
        vehicle: as declared.
        tuning: of the wrench filter.

    Raises:
        InputError: no unbroken piece of IMU readings is longer than 3 s.
    """
    noise, count = imu_noise(log), len(log.t)
    numbers, std = np.zeros((count, WITHOUT_COVARIANCE)), np.full((count, 18), np.nan)
    pieces = inertial_signals(log, vehicle.gravity)
    # rows between two pieces hold the values of the nearer end of the one before
    cuts = np.searchsorted(log.t, [s.t[-1] for s in pieces[:-1]]) + 1
    tables = []
    for s, rows in zip(pieces, np.split(np.arange(count), cuts), strict=True):
        t = log.t[rows]
        tables.append(resampled(t, s.t, _piece(s, vehicle, tuning, log.period, noise)))
        inside = (t >= s.t[0]) & (t <= s.t[-1] + log.period)
        numbers[rows, STATUS] = np.where(inside, TRACKING, COASTING)
    numbers[:, :STATE_SIZE], std[:, 12:], loads = np.split(
        np.concatenate(tables), [STATE_SIZE, STATE_SIZE + 6], axis=1
    )
    loads = loads.reshape(-1, *LOAD)
    if pose_rate(log) == 0.0:  # gyro and accelerometer alone drift away from both
        numbers[:, POSITION], numbers[:, VELOCITY] = np.nan, np.nan
    quaternion = numbers[:, QUATERNION]
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    numbers[:, MODEL] = variances_along(factors_of(vehicle), loads)
    return WrenchEstimate(numbers, std), loads, _notes(log, pieces, vehicle)


def _piece(
    s: InertialSignals, vehicle: Vehicle, tuning: UKFTuning, period: float, noise: Pair
) -> Array:
    """Return a piece's state, laid out as an estimate's, the standard deviations of torque and
    force, and the seven loads, smoothed likewise: a row (n, STATE_SIZE + 6 + 21) a sample.
    """
    acting, body = acting_wrench(s, vehicle)
    needed = needed_wrench(s, body)
    steps = s.period / period  # a walk of one step of the log, in one of the signals
    # an Ornstein-Uhlenbeck process, or a walk: the factor of a step, and its squared walks
    keep_force, new_force = decay_of(tuning.force_time, s.period, period)
    keep_torque, new_torque = decay_of(tuning.torque_time, s.period, period)
    # the loads are by the logged speeds: a declared lag or efficiency changes a small part of a
    # deviation
    thrust, x, y, z = body.rotor_wrench(s.rotor_speeds).T[..., None]
    omega, (ahead, left, up) = s.angular_velocity, np.eye(3)
    turned = (x - body.com[1] * thrust) * ahead + (y + body.com[0] * thrust) * left
    turning = needed[:, 3:] + np.cross(omega, omega @ body.inertia.T)
    pushing = thrust * s.rotation[:, :, 2]
    needs = np.stack([needed[:, :3] - acting[:, :3], pushing, needed[:, :3]], axis=2)
    inverse = np.linalg.inv(body.inertia)
    loads = acting[:, 3:], thrust * ahead, thrust * left, turned, z * up, turning
    driven = np.einsum("ij,cnj->nic", inverse, np.stack(loads))
    rates = running_integral(driven, s.t)
    rates[:, :, 0] = omega - rates[:, :, 0]
    force, torque, spread = np.empty_like(needs), np.empty_like(rates), np.empty(6)
    own = np.diagonal(inverse)
    # a force's walk is hidden by white noise. The change of a rate is a walk, the rate beside it is
    # hit by the rotors' errors
    variances = (
        (body.mass * noise[1]) ** 2 + np.square(tuning.thrust_noise) / steps,
        np.square(tuning.force_walk) * new_force,
        np.square(own * s.period) * np.square(tuning.motor_torque_noise) / steps,
        np.square(own) * np.square(tuning.torque_walk) * new_torque,
    )
    axes = np.transpose(np.broadcast_arrays(keep_force, keep_torque, *variances))
    for i, (kept, kept_turn, hiding, walk, hit, turn) in enumerate(axes):
        walked, std = _two_sided(needs[:, i], kept * np.eye(1), np.diag([walk]), hiding)
        force[:, i], spread[i] = walked[:, 0], std[0]
        model, walks = np.array([[1.0, s.period], [0.0, kept_turn]]), np.diag([hit, turn])
        walked, std = _two_sided(rates[:, i], model, walks, max(noise[0], 1e-6) ** 2)
        torque[:, i], spread[3 + i] = walked[:, 1], std[1] / own[i]
    shares = np.square(s.rotation)
    std_force = np.sqrt(spread[:3] ** 2 + shares @ (body.mass * s.bias_std) ** 2)
    std_torque = np.sqrt(shares @ spread[3:] ** 2)
    quaternion = continuous(Rotation.from_matrix(s.rotation).as_quat(scalar_first=True))
    torque = np.einsum("nij,jk,nkc->cni", s.rotation, body.inertia, torque)
    outer, *pushed = np.moveaxis(force, 2, 0)
    state = s.position, quaternion, s.velocity, omega, torque[0], outer
    no_nis = np.full(len(s.t), np.nan)
    smooth = *torque[1:3], *pushed, *torque[3:]
    return np.column_stack([*state, no_nis, std_torque, std_force, *smooth])


def _two_sided(y: Array, model: Array, noise: Array, variance: float) -> ArrayPair:
    """Return the states (n, m, c) of a steady fixed-interval smoother with measurements (n, c) of
    the first, and their standard deviations (m,).
    """
    m = len(model)
    P = solve_discrete_are(model.T, np.eye(m, 1), noise + 1e-18 * np.eye(m), variance * np.eye(1))
    gain = P[0] / (P[0, 0] + variance)
    after = P - np.outer(gain, P[0])
    back = np.linalg.solve(P, model @ after).T
    smoothed = solve_discrete_lyapunov(back, after - back @ P @ back.T)
    states = np.empty((len(y), m, y.shape[1]))
    x = np.zeros(states.shape[1:])
    x[0] = np.mean(y[: max(1, len(y) // 200)], axis=0)
    for k, measured in enumerate(y):
        states[k] = x + np.outer(gain, measured - x[0])
        x = model @ states[k]
    for k in range(len(y) - 2, -1, -1):
        states[k] += back @ (states[k + 1] - model @ states[k])
    return states, np.sqrt(np.maximum(np.diagonal(smoothed), 0.0))


def _notes(log: FlightLog, pieces: list[InertialSignals], vehicle: Vehicle) -> Names:
    if pose_rate(log) > 0.0:
        return (
            "gyro and accelerometer were smoothed together with the "
            + ("poses" if log.valid.any() else "positions"),
        )
    bias = vehicle.mass * np.max([s.bias_std for s in pieces])
    return (
        "the log has no pose: the wrench is read from gyro and accelerometer. Its force is "
        "along level axes, horizontal ones as the vehicle pointed at the start, which drift "
        f"with the gyro; a steady force below {bias:.2g} N may be the accelerometer's bias. "
        "Height, place and velocity are not known, and drag is part of the force",
    )
