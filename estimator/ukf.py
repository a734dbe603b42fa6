"""The wrench filter: an unscented Kalman filter over pose, twist and external wrench of a quadrotor.

McKinnon and Schoellig, *Unscented External Force and Torque Estimation for Quadrotors*, IROS 2016, (15)-(37).
The filter is exact to the paper's 61 and 49 sigma points and cheaper:

* The noise enters linearly, and so do those directions of the state that leave attitude and rate alone. Their pairs of
  sigma points average out and add exactly ``A S S' A'`` and ``B Q B'`` to the covariance. What is left are the 13
  points of attitude and rate (25 where a declared effect depends on position or velocity).
* The root of the covariance is lower triangular, so only its first 6 (or 12) columns are needed; the others enter
  through the Schur complement.
* The measurement is linear in the error state, so the correction by 49 redrawn points is the Kalman update.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from ..dynamics.compiled import Record, compiled
from ..dynamics.errors import InputError
from ..dynamics.model import reset_model
from ..dynamics.rotation import attitude_error
from ..dynamics.vehicle import Vehicle
from .error_state import displace, error_from, fold, symmetrise
from .estimate import NIS, STATE_SIZE, Array, WrenchEstimate
from .filter_record import N, drive, filter_record, propagate
from .imu import take_in_imu
from .sample import Sample, check_sample, copy_estimate, empty_estimate, undo_first_pose, undo_sensing
from .tuning import UKFTuning

NOISE = 12  # noise inputs of the prediction: motor torque, torque walk, thrust, force walk
_PATIENCE = 0.1  # s of measurements that the gate may refuse in a row


@compiled
def _root(f: Record, columns: int) -> None:
    """Factor P: the first columns of its lower root into ``S``, the rest's Schur complement into ``M``."""
    P, S, M = f.P, f.S, f.M
    for j in range(columns):
        pivot = P[j, j]
        for k in range(j):
            pivot -= S[k, j] * S[k, j]
        # rounding may eat the smallest pivots; a tiny positive one keeps the filter alive and changes nothing
        pivot = max(pivot, 1e-14 * P[j, j] + 1e-300)
        scale = 1.0 / math.sqrt(pivot)
        for i in range(N):
            S[j, i] = P[j, i]
        for k in range(j):
            a = S[k, j]
            for i in range(j, N):
                S[j, i] -= a * S[k, i]
        for i in range(j):
            S[j, i] = 0.0
        for i in range(j, N):
            S[j, i] *= scale
    # the Schur complement, six columns at once; rows of x and v have none where they are among the columns
    last = 0 if columns == 6 else 6
    for i in range(12):
        for j in range(12):
            M[i, j] = P[6 + i, 6 + j] if i >= last and j >= last else 0.0
    for k in range(0, columns, 6):
        for i in range(last, 12):
            a0, a1, a2 = S[k, 6 + i], S[k + 1, 6 + i], S[k + 2, 6 + i]
            a3, a4, a5 = S[k + 3, 6 + i], S[k + 4, 6 + i], S[k + 5, 6 + i]
            for j in range(last, 12):
                M[i, j] -= ((a0 * S[k, 6 + j] + a1 * S[k + 1, 6 + j]) + (a2 * S[k + 2, 6 + j] + a3 * S[k + 3, 6 + j])
                            + (a4 * S[k + 4, 6 + j] + a5 * S[k + 5, 6 + j]))


@compiled
def _linear_rows(f: Record, rotation: Array, dt: float, source: Array, out: Array) -> None:
    """Apply the linear part of the model to the rows (x, v, torque, force) of ``source`` (12, n): ``out`` (18, n)."""
    columns = source.shape[1]
    J, c, mass = f.body.inverse_inertia, f.body.com, f.body.mass
    offset = c[0] != 0.0 or c[1] != 0.0 or c[2] != 0.0
    for i in range(3):
        a0 = J[i, 0] * rotation[0, 0] + J[i, 1] * rotation[0, 1] + J[i, 2] * rotation[0, 2]
        a1 = J[i, 0] * rotation[1, 0] + J[i, 1] * rotation[1, 1] + J[i, 2] * rotation[1, 2]
        a2 = J[i, 0] * rotation[2, 0] + J[i, 1] * rotation[2, 1] + J[i, 2] * rotation[2, 2]
        for j in range(columns):
            out[i, j] = 0.0
            out[3 + i, j] = dt * (a0 * source[6, j] + a1 * source[7, j] + a2 * source[8, j])
            out[9 + i, j] = dt / mass * source[9 + i, j]
            out[12 + i, j] = source[6 + i, j]
            out[15 + i, j] = source[9 + i, j]
    if offset:
        # the geometric centre also moves with the angular acceleration: com x alpha
        for j in range(columns):
            ax, ay, az = out[3, j], out[4, j], out[5, j]
            px, py, pz = c[1] * az - c[2] * ay, c[2] * ax - c[0] * az, c[0] * ay - c[1] * ax
            for i in range(3):
                out[9 + i, j] += rotation[i, 0] * px + rotation[i, 1] * py + rotation[i, 2] * pz
    for i in range(3):
        for j in range(columns):
            gain = out[9 + i, j]
            out[6 + i, j] = source[i, j] + dt * (source[3 + i, j] + 0.5 * gain)
            out[9 + i, j] = source[3 + i, j] + gain


@compiled
def _add_squares(P: Array, rows: Array, first: int, sign: float) -> None:
    """Add ``sign r' r`` to P for six rows (18,) of ``rows`` from ``first`` on; six at once for speed."""
    b0, b1, b2, b3, b4, b5 = first, first + 1, first + 2, first + 3, first + 4, first + 5
    for i in range(N):
        a0, a1, a2 = sign * rows[b0, i], sign * rows[b1, i], sign * rows[b2, i]
        a3, a4, a5 = sign * rows[b3, i], sign * rows[b4, i], sign * rows[b5, i]
        for j in range(N):
            P[i, j] += ((a0 * rows[b0, j] + a1 * rows[b1, j]) + (a2 * rows[b2, j] + a3 * rows[b3, j])
                        + (a4 * rows[b4, j] + a5 * rows[b5, j]))


@compiled
def add_noise(f: Record, rotation: Array, dt: float) -> None:
    """Add ``B Q B'`` to P: what 24 of the 61 sigma points come to, (16)."""
    P, J, c, B = f.P, f.body.inverse_inertia, f.body.com, f.B
    # stated per period: white noise averages over a longer step, a walk grows with it
    white, walk = f.period / dt, dt / f.period
    for n in range(3):
        P[12 + n, 12 + n] += walk * f.torque_walk[n]
        P[15 + n, 15 + n] += walk * f.force_walk[n]
        torque, thrust = dt * math.sqrt(white * f.motor_torque[n]), dt * math.sqrt(white * f.thrust[n]) / f.body.mass
        ax, ay, az = J[0, n], J[1, n], J[2, n]
        px, py, pz = c[1] * az - c[2] * ay, c[2] * ax - c[0] * az, c[0] * ay - c[1] * ax
        for i in range(3):
            B[n, 3 + i] = torque * J[i, n]
            B[n, 9 + i] = torque * (rotation[i, 0] * px + rotation[i, 1] * py + rotation[i, 2] * pz)
            B[n, 6 + i] = 0.5 * dt * B[n, 9 + i]
            B[3 + n, 9 + i] = thrust * rotation[i, n]
            B[3 + n, 6 + i] = 0.5 * dt * B[3 + n, 9 + i]
    _add_squares(P, B, 0, 1.0)


@compiled
def predict(f: Record, rotor_speeds: Array, dt: float, voltage: float) -> None:
    """Carry the filter ``dt`` s ahead at turn rates (4,) rad/s: (18)-(26)."""
    x, P, H, E, mean, error = f.x, f.P, f.H, f.E, f.mean, f.error
    drive(f, rotor_speeds, dt, voltage)
    columns = 6 if f.wrench_count == 0 else 12
    _root(f, columns)
    propagate(f, x, dt, f.centre)
    for i in range(3):
        for j in range(3):
            f.centre_rotation[i, j] = f.rotation[i, j]
    _linear_rows(f, f.centre_rotation, dt, f.M, f.Y)
    for i in range(12):
        for j in range(N):
            f.Z[i, j] = f.Y[j, i]
    _linear_rows(f, f.centre_rotation, dt, f.Z, P)
    add_noise(f, f.centre_rotation, dt)
    spread = math.sqrt(N + NOISE + f.kappa)
    weight = 0.5 / (N + NOISE + f.kappa)  # (28)
    # with a pair of errors e and d: ee' + dd' = ((e - d)(e - d)' + (e + d)(e + d)') / 2, and the second half is only
    # there where the model is nonlinear, in the first 12 rows
    scale = math.sqrt(0.5 * weight)
    for i in range(N):
        mean[i] = 0.0
    for j in range(columns):
        for sign in range(2):
            displace(x, f.S[j], spread if sign == 0 else -spread, f.rho, f.q, f.point)
            propagate(f, f.point, dt, f.next)
            error_from(f.next, f.centre, error[sign])
        for i in range(N):
            H[j, i] = scale * (error[0, i] - error[1, i])
        for i in range(12):
            total = error[0, i] + error[1, i]
            E[j, i] = scale * total
            mean[i] += weight * total  # (25)
    for first in range(0, columns, 6):
        _add_squares(P, H, first, 1.0)
        _add_squares(P, E, first, 1.0)
    for i in range(12):
        a = mean[i]
        for j in range(12):
            P[i, j] -= a * mean[j]
    fold(f, f.centre, mean)
    symmetrise(P)
    f.time += dt
    x[NIS] = math.nan


@compiled
def correct(f: Record, position: Array, quaternion: Array, first: int, last: int) -> bool:
    """Take in rows ``first`` to ``last`` of the measurement (rho, x), (27)-(37), unless the gate refuses it."""
    x, P, L, W, y = f.x, f.P, f.L, f.W, f.innovation
    attitude_error(quaternion, x[3:7], y[0:3])
    for i in range(3):
        y[3 + i] = position[i] - x[i]
    # rows of (rho, x) in the error state are 0-2 and 6-8
    for i in range(first, last):
        a = i if i < 3 else i + 3
        for j in range(first, i + 1):
            b = j if j < 3 else j + 3
            total = P[a, b]
            if i == j:
                total += f.noise[i]
            for k in range(first, j):
                total -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(total) if i == j else total / L[j, j]
    # y becomes the whitened innovation, W the whitened cross covariance
    nis = 0.0
    for i in range(first, last):
        for k in range(first, i):
            y[i] -= L[i, k] * y[k]
        y[i] /= L[i, i]
        nis += y[i] * y[i]
    x[NIS] = nis
    if f.gate > 0.0 and nis > f.gate and f.refused < f.patience:
        f.refused += 1
        return False
    f.refused = 0
    mean = f.mean
    for j in range(N):
        mean[j] = 0.0
    for i in range(first, last):
        a = i if i < 3 else i + 3
        for j in range(N):
            W[i, j] = P[a, j]
        for k in range(first, i):
            b = L[i, k]
            for j in range(N):
                W[i, j] -= b * W[k, j]
        b = 1.0 / L[i, i]
        for j in range(N):
            W[i, j] *= b
            mean[j] += W[i, j] * y[i]
    for i in range(6):
        if i < first or i >= last:
            W[i, :] = 0.0
    _add_squares(P, W, 0, -1.0)
    for i in range(NIS):
        f.centre[i] = x[i]
    fold(f, f.centre, mean)
    return True


@compiled
def correct_parts(f: Record, z: Array, parts: int) -> None:
    """Correct with the checked ``parts`` of ``z`` (11,): 1 position, 2 attitude, 3 both."""
    if parts == 3:
        correct(f, z[4:7], z[7:11], 0, 6)
    elif parts == 2:
        correct(f, z[4:7], z[7:11], 0, 3)
    elif parts == 1:
        correct(f, z[4:7], f.x[3:7], 3, 6)


@compiled
def step(f: Record, z: Array, parts: int, dt: float, voltage: float) -> int:
    """Predict over ``dt`` s if that is positive, then correct with the ``parts`` of ``z`` (11,) that were measured.

    Returns the parts that could be used, or -1, with the filter as it was, if the quaternion is no rotation.
    """
    usable: int = check_sample(f, z, parts)
    if usable >= 0:
        sample = undo_sensing(f, z, usable, dt)
        if dt > 0.0:
            predict(f, sample[0:4], dt, voltage)
        correct_parts(f, sample, usable)
    return usable


@compiled
def _step_and_copy(record: Record, z: Array, parts: int, dt: float, voltage: float, out: Array) -> int:
    f = record[0]
    usable: int = step(f, z, parts, dt, voltage)
    copy_estimate(f, out)
    return usable


class WrenchUKF:
    """Unscented Kalman filter for the external force and torque on a quadrotor.

    Call ``reset`` with a first pose, then ``step`` once a period; or ``predict`` and ``correct`` with measurements that
    come at their own times. A measurement, or a part of it, that is None or not finite was not made. The sign of a
    quaternion means nothing. Turn rates that are not finite are taken to be the last ones that were.

    Args:
        vehicle: the declared vehicle; its declared effects are part of the prediction model, and the estimated wrench
            is what they do not explain.
        tuning: noise of model and measurement; default ``UKFTuning.for_vehicle(vehicle, period)``.
        period: time between steps, s.
        gate: refuse measurements whose NIS has a smaller chance than ``1 - gate`` (0.999, say); None takes in any.
            After 0.1 s of nothing but refusals the next one is believed.

    Raises:
        InputError: period or gate out of range.
    """

    _compiled_step = staticmethod(_step_and_copy)

    def __init__(
        self, vehicle: Vehicle, tuning: UKFTuning | None = None, period: float = 0.005, gate: float | None = None
    ) -> None:
        if not (math.isfinite(period) and period > 0):
            raise InputError(f"WrenchUKF: period must be positive, in s, got {period!r}")
        if gate is not None and not 0.5 <= gate < 1.0:
            raise InputError(f"WrenchUKF: gate must be a probability from 0.5 to below 1, got {gate!r}")
        self.vehicle = vehicle
        self.tuning = UKFTuning.for_vehicle(vehicle, period) if tuning is None else tuning
        self.period = float(period)
        largest = 0.0 if gate is None else _chi2_quantile(gate)
        patience = max(1, round(_PATIENCE / period))
        self.record = filter_record(vehicle, self.tuning, self.period, largest, patience)
        self._sample = Sample()
        self._voltage = vehicle.voltage_ref

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose, without an external wrench.

        Args:
            position: (3,) m, world.
            quaternion: (4,) body to world, scalar first.
            covariance: (18, 18) of (rho, omega, x, v, torque, force), rho being an MRP; default
                ``default_covariance(vehicle, tuning)``.
            velocity: (3,) m/s, world.
            angular_velocity: (3,) rad/s, body.

        Raises:
            InputError: a shape is wrong, a number is not finite, the quaternion is not one of a rotation, or the
                covariance is not symmetric and positive definite.
        """
        x = np.zeros(STATE_SIZE)
        for name, value, where in (("position", position, slice(0, 3)), ("quaternion", quaternion, slice(3, 7)),
                                   ("velocity", velocity, slice(7, 10)),
                                   ("angular_velocity", angular_velocity, slice(10, 13))):
            array = np.asarray(value, dtype=np.float64)
            if array.shape != x[where].shape or not np.all(np.isfinite(array)):
                raise InputError(f"reset: {name} must be {x[where].size} finite numbers, got {value!r}")
            x[where] = array
        length = float(np.linalg.norm(x[3:7]))
        if not 0.9 < length < 1.1:
            raise InputError(f"reset: quaternion must have length 1, got {length:g}")
        x[3:7] /= length
        x[NIS] = math.nan
        if covariance is None:
            P = default_covariance(self.vehicle, self.tuning)
        else:
            P = np.array(covariance, dtype=np.float64)
            if P.shape != (N, N) or not np.all(np.isfinite(P)) or not np.allclose(P, P.T, rtol=1e-8, atol=1e-300):
                raise InputError(f"reset: covariance must be a finite symmetric (18, 18) matrix, got shape {P.shape}")
            if np.linalg.eigvalsh(P)[0] <= 0:
                raise InputError("reset: covariance must be positive definite")
        f = self.record[0]
        f["x"], f["P"] = x, P
        f["refused"] = 0
        reset_model(f)
        undo_first_pose(self.record)

    @property
    def covariance(self) -> Array:
        """Covariance (18, 18) of the error state (rho, omega, x, v, torque, force), rho being a world-frame MRP."""
        return np.array(self.record[0]["P"])

    @property
    def estimate(self) -> WrenchEstimate:
        """What the filter believes now."""
        f = self.record[0]
        return WrenchEstimate(np.concatenate([f["x"], f["P"].ravel()]))

    def step(
        self,
        rotor_speeds: ArrayLike,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        voltage: float | None = None,
    ) -> WrenchEstimate:
        """Predict over one period with the turn rates of that period, then take in the pose at its end.

        Args:
            rotor_speeds: (4,) rad/s.
            position: (3,) m, world, or None.
            quaternion: (4,) body to world, scalar first, or None.
            voltage: battery voltage, V, for effects that depend on it; default ``voltage_ref``.

        Raises:
            InputError: a shape is wrong or the quaternion's length is not 1; the filter stays as it was.
        """
        parts = self._sample.read(rotor_speeds, position, quaternion)
        return self._run(parts, self.period, voltage)

    def predict(self, rotor_speeds: ArrayLike, dt: float | None = None, voltage: float | None = None) -> WrenchEstimate:
        """Carry the filter ``dt`` s (default: one period) ahead without a measurement."""
        dt = self.period if dt is None else dt
        if not (math.isfinite(dt) and dt > 0):
            raise InputError(f"predict: dt must be positive, in s, got {dt!r}")
        return self._run(self._sample.read(rotor_speeds, None, None), dt, voltage)

    def correct(self, position: ArrayLike | None, quaternion: ArrayLike | None) -> WrenchEstimate:
        """Take in a pose, or a part of one, measured now."""
        return self._run(self._sample.read(self._sample.z[0:4], position, quaternion), 0.0, None)

    def correct_imu(self, gyro: ArrayLike | None = None, accelerometer: ArrayLike | None = None) -> WrenchEstimate:
        """Take in an inertial measurement made now, at the geometric centre; see ``estimator.imu``.

        Args:
            gyro: (3,) rad/s, body, without bias, or None.
            accelerometer: (3,) m/s2, body, specific force (+g along z at hover), without bias, or None.

        Raises:
            InputError: a shape is wrong or a number is not finite; the filter stays as it was.
        """
        z = np.zeros(6)
        for name, value, where in (("gyro", gyro, slice(0, 3)), ("accelerometer", accelerometer, slice(3, 6))):
            if value is not None:
                array = np.asarray(value, dtype=np.float64)
                if array.shape != (3,) or not np.all(np.isfinite(array)):
                    raise InputError(f"correct_imu: {name} must be three finite numbers, got {value!r}")
                z[where] = array
        take_in_imu(self.record, z, gyro is not None, accelerometer is not None)
        return self.estimate

    def _run(self, parts: int, dt: float, voltage: float | None) -> WrenchEstimate:
        out = empty_estimate()
        volts = self._voltage if voltage is None else voltage
        if self._compiled_step(self.record, self._sample.z, parts, dt, volts, out) < 0:
            raise self._sample.bad_quaternion()
        return WrenchEstimate(out)


def default_covariance(vehicle: Vehicle, tuning: UKFTuning) -> Array:
    """Return the covariance (18, 18) of a vehicle that was just seen, near rest, with an unknown wrench."""
    deviations = np.empty(N)
    deviations[0:3] = np.asarray(tuning.attitude_noise, dtype=np.float64) / 4.0
    deviations[3:6] = 0.5  # rad/s
    deviations[6:9] = tuning.position_noise
    deviations[9:12] = 0.5  # m/s
    deviations[12:15] = 0.05 * vehicle.weight * vehicle.arm_l
    deviations[15:18] = 0.1 * vehicle.weight
    return np.diag(np.square(deviations))


def _chi2_quantile(probability: float) -> float:
    """Return the NIS (6 numbers) below which a consistent measurement lies with a probability."""
    from scipy.stats import chi2

    return float(chi2.ppf(probability, 6))
