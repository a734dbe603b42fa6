"""A flight's motion by an IMU, for logs without a pose or with a few positions a second.

The specific force is the balance of forces in body axes itself, whatever the attitude; the gyro is
the angular velocity. So the effects of rotors and body show without a pose. Attitude, and with it
effects in the world's axes, comes from ``inertial_fusion``. Its errors turn needed and modelled
force alike and make no residual of their own. Velocity and position are as uncertain as the fusion
states.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from ..logs.table import Array, Mask, Pair, Rows, finite_rows, median_step
from .inertial_fusion import FusedMotion, ImuPiece, Readings, fuse
from .signals import LONGEST_GAP, SHORTEST_PIECE, Signals, in_body, voltage_at
from .smoothing import (
    CUTOFFS,
    derivative,
    even_times,
    high_pass,
    low_pass,
    mean_square,
    resampled,
    robust_std,
    running_integral,
    unbroken,
)


@dataclass(frozen=True, eq=False)
class InertialSignals(Signals):
    """Signals of an IMU, with its sensors' readings and the standard deviations of the rest."""

    std: Array  # (n, 9) of attitude (rad, body), velocity (m/s) and position (m), world
    bias_std: Array  # (3,) m/s2, of the accelerometer's subtracted bias


def pose_rate(log: FlightLog) -> float:
    """Return the number of new poses a second in a log; 0 without any."""
    times = log.t[_changed(np.flatnonzero(finite_rows(log.position)), log.position)]
    return 1.0 / median_step(times) if len(times) > 1 else 0.0


def reads_imu(log: FlightLog) -> bool:
    """Return whether a log's motion is of its IMU: the log has one, and no pose fast enough (45 a
    second) to show the motion alone.
    """
    return log.gyro is not None and log.accelerometer is not None and pose_rate(log) < 45.0


def imu_noise(log: FlightLog) -> Pair:
    """Return the standard deviation of one sample of gyro (rad/s) and accelerometer (m/s2), an
    axis, by the noise above a quarter of the sampling rate.
    """
    return _level(log.gyro), _level(log.accelerometer)


def _level(x: Array | None) -> float:
    if x is None or len(read := x[finite_rows(x)]) < 50:
        return 0.0
    return robust_std(high_pass(read, CUTOFFS.noise_share_of_rate))


def imu_rows(log: FlightLog) -> Rows:
    """Return the rows with readings of both gyro and accelerometer."""
    if log.gyro is None or log.accelerometer is None:
        return np.flatnonzero([])
    return np.flatnonzero(finite_rows(np.column_stack([log.gyro, log.accelerometer])))


def inertial_pieces(log: FlightLog) -> list[Rows]:
    """Return the rows of each unbroken run of IMU readings of sufficient length."""
    return unbroken(log.t, imu_rows(log), LONGEST_GAP, 50, SHORTEST_PIECE)


def inertial_signals(log: FlightLog, gravity: float) -> list[InertialSignals]:
    """Return the motion over each unbroken piece of a log's IMU. No low-pass smooths the readings,
    unlike a twice differentiated pose: 15 Hz would take a per cent at 5 Hz.

    Args:
        log: with gyro and accelerometer; its positions and attitudes are used, however few.
        gravity: m/s2.

    Raises:
        InputError: no piece is longer than 3 s.
    """
    pieces = inertial_pieces(log)
    if not pieces:
        raise InputError(
            f"{log.name}: no unbroken piece of gyro and accelerometer is longer than "
            f"{SHORTEST_PIECE:g} s"
        )
    return [_piece(log, rows, gravity) for rows in pieces]


def _piece(log: FlightLog, rows: Rows, gravity: float) -> InertialSignals:
    assert log.gyro is not None
    assert log.accelerometer is not None
    imu_times = log.t[rows]
    fine = median_step(imu_times)
    # readings beyond 250 Hz are low-passed and thinned out
    thin = max(1, int(np.ceil(1.0 / (250.0 * fine) - 1e-6)))
    period = thin * fine
    even = even_times(imu_times, fine)

    def sampled(times: Array, x: Array) -> Array:
        even_x = resampled(even, times, x)
        return low_pass(even_x, 0.4 / period, fine)[::thin] if thin > 1 else even_x

    gyro, force = (sampled(imu_times, x[rows]) for x in (log.gyro, log.accelerometer))
    speeds = sampled(log.t, log.rotor_speeds)
    t = even[::thin]
    noise = np.array(imu_noise(log)) / np.sqrt(thin)
    fused = _fused(log, ImuPiece(t, gyro, force, gravity, noise))
    t = t[: np.searchsorted(t, fused.t[-1] + 1e-9)]
    velocity, position, *biases = np.split(resampled(t, fused.t, fused.linear), 4, axis=1)
    gyro, force = gyro[: len(t)] - biases[0], force[: len(t)] - biases[1]
    rotation = _dense(t, gyro, fused)
    return InertialSignals(
        t,
        period,
        position,
        rotation,
        velocity,
        np.einsum("nij,nj->ni", rotation, force) - np.array([0.0, 0.0, gravity]),
        gyro,
        derivative(gyro, period),
        np.maximum(speeds[: len(t)], 0.0),
        voltage_at(log, t),
        resampled(t, fused.t, fused.std[:, :9]),
        np.median(fused.std[:, 12:], axis=0),
    )


def _fused(log: FlightLog, imu: ImuPiece) -> FusedMotion:
    """Return the fused motion, with the noise of positions and attitudes by their own scatter."""
    placed = _measured(log, finite_rows(log.position), imu.t)
    turned = _measured(log, finite_rows(log.quaternion) & log.valid, imu.t)
    positions = attitudes = None
    # first guesses of a measured axis' standard deviation in m and rad
    if len(placed) > 3:
        positions = Readings(log.t[placed], log.position[placed], 0.02)
    if len(turned) > 3:
        matrices = Rotation.from_quat(log.quaternion[turned], scalar_first=True).as_matrix()
        attitudes = Readings(log.t[turned], matrices, 0.01)
    fused = fuse(imu, positions, attitudes)
    if positions is None:
        return fused
    off = positions.values - resampled(positions.t, fused.t, fused.linear[:, 3:6])
    off -= np.median(off, axis=0)
    # a smoother leaves less than noise; below 0.5 mm and 1 mrad no noise is credible
    std = max(1.3 * robust_std(off), 0.0005)
    kept = np.linalg.norm(off, axis=1) < 10.0 * std  # others are leaps
    positions = Readings(positions.t[kept], positions.values[kept], std)
    if attitudes is not None:
        knot = np.clip(np.searchsorted(fused.t, attitudes.t), 0, len(fused.t) - 1)
        near = np.abs(fused.t[knot] - attitudes.t) < 0.004
        if near.sum() > 20:
            seen = Rotation.from_matrix(attitudes.values[near])
            off = (fused.rotation[knot[near]].inv() * seen).as_rotvec()
            std = max(1.3 * robust_std(off - np.median(off, axis=0)), 0.001)
            attitudes = attitudes._replace(std=std)
    return fuse(imu, positions, attitudes)


def _measured(log: FlightLog, there: Mask, t: Array) -> Rows:
    """Return the rows of new measurements within a piece; a pose equal to the one before to the
    last digit was held.
    """
    rows = np.flatnonzero(there & (log.t >= t[0]) & (log.t <= t[-1]))
    return _changed(rows, np.column_stack([log.position, np.nan_to_num(log.quaternion)]))


def _changed(rows: Rows, values: Array) -> Rows:
    """Return the rows whose values (N, k) differ from the row before among them."""
    return rows[np.diff(values[rows], axis=0, prepend=np.inf).any(axis=1)]


def _dense(t: Array, gyro: Array, fused: FusedMotion) -> Array:
    """Return the attitude (n, 3, 3) at all samples: from the knot before, by the gyro."""
    knot = np.searchsorted(fused.t, t + 1e-9, side="right") - 1
    first = np.searchsorted(t, fused.t - 1e-9)[knot]
    turned = running_integral(gyro, t)
    since = Rotation.from_rotvec(turned - turned[first])
    return np.asarray((fused.rotation[knot] * since).as_matrix())


def with_drift(s: InertialSignals, rng: np.random.Generator, gravity: float) -> InertialSignals:
    """Return signals with other errors of the fusion, drawn from its standard deviations: slow
    drifts of attitude, velocity and position.
    """
    from scipy.ndimage import gaussian_filter1d  # needed without a pose alone

    slow = gaussian_filter1d(rng.standard_normal((len(s.t), 9)), 3.0 / s.period, axis=0)
    slow /= np.sqrt(mean_square(slow)) + 1e-30
    slow *= s.std
    turn = Rotation.from_rotvec(slow[:, :3]).as_matrix()
    down, rotation = np.array([0.0, 0.0, gravity]), s.rotation @ turn
    felt = in_body(s.acceleration + down, s.rotation)
    return replace(
        s,
        rotation=rotation,
        acceleration=np.einsum("nij,nj->ni", rotation, felt) - down,
        velocity=s.velocity + slow[:, 3:6],
        position=s.position + slow[:, 6:],
    )
