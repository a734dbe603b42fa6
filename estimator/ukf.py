"""The wrench filter: an unscented Kalman filter over pose, twist and external wrench of a
quadrotor.

McKinnon and Schoellig, *Unscented External Force and Torque Estimation for Quadrotors*, IROS 2016,
(15)-(37). The filter is exact to the paper's 61 and 49 sigma points and cheaper:

* The noise enters linearly, and so do the directions of the state that leave attitude and rate
  alone. Their pairs of sigma points average out and add exactly ``A S S' A'`` and ``B Q B'`` to the
  covariance. The 13 points of attitude and rate are left (25 where a declared effect depends on
  position or velocity).
* The root of the covariance is lower triangular: only its first 6 (or 12) columns are needed, and
  the others enter through the Schur complement.
* The measurement is linear in the error state: the correction by 49 redrawn points is the Kalman
  update.

``WrenchUKF`` steps in the compiled core (``core/ukf.hpp``). The compiled functions here have the
same bits, for loops that are not of the core yet: lanes of environments, smoother, constant gain.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..dynamics.effects import compile_effects
from ..dynamics.effects.own import raise_errors
from ..dynamics.model import lay_addresses, reset_model, without_addresses
from ..dynamics.rotation import attitude_error, quaternion_to_matrix
from ..dynamics.vehicle import Vehicle
from ..runtime.arguments import real_numbers
from ..runtime.compiled import Record, compiled, compiled_inline
from ..runtime.errors import InputError
from ..runtime.vector_lanes import all_of, any_of, choose, first_below, first_column, lanes_by
from .bias_states import joint_covariance, load_imu
from .covariance import (
    add_noise,
    add_pairs,
    carry_linear_part,
    root_of_six,
    root_of_twelve,
    subtract_squares,
    whiten,
)
from .error_state import displace, error_from, fold, symmetrise
from .estimate import (
    ESTIMATE_SIZE,
    EXCESS,
    MODEL,
    NIS,
    POSITION,
    QUATERNION,
    RATE,
    RESTARTS,
    STATE_SIZE,
    STATUS,
    VELOCITY,
    WITHOUT_COVARIANCE,
    Array,
    WrenchEstimate,
)
from .filter_record import (
    BIASES,
    ESTIMATE,
    FILTER,
    N,
    drive,
    fields_between,
    filter_record,
    move,
    propagate,
)
from .model_uncertainty import follow_loads
from .recovery import (
    BELIEVING,
    NOISE,
    Recovery,
    after_prediction,
    believable,
    doubted_variance,
    pose_noise,
)
from .sample import Sample, check_sample, undo_sensing
from .sigma_points import PAIRS, errors_of_points, halve_pairs, propagate_points, spread_points
from .tuning import UKFTuning

# A call of a filter: rotor speeds and pose, which parts of the pose there are, s, V; or gyro and
# accelerometer, and which of both
CALL = np.dtype([("z", "f8", (11,)), ("parts", "i8"), ("dt", "f8"), ("voltage", "f8")])
IMU_PARTS = 4, 8  # gyro and accelerometer, beside the parts of a pose
_VARIANCES = slice(WITHOUT_COVARIANCE, None, N + 1)  # of an estimate's numbers


@compiled
def predict(f: Record, rotor_speeds: Array, dt: float, voltage: float) -> None:
    """Carry the filter ``dt`` s ahead at rotor speeds (4,) rad/s: (18)-(27)."""
    drive(f, rotor_speeds, dt, voltage)
    if f.wrench_count == 0:
        quaternion_to_matrix(f.x[3:7], f.rotation)
        carry(f, dt)
    else:
        root_of_twelve(f)
        propagate(f, f.x, dt, f.centre)
        _carry_linear(f, dt)
        _pairs_in_turn(f, dt, 2 * PAIRS, propagate)
        add_pairs(f, 0)
        add_pairs(f, PAIRS)
        _gather(f, dt)
    f.time += dt


@compiled
def carry(f: Record, dt: float) -> None:
    """Carry a filter without wrench effects ahead, its rotors' wrench and the matrix of its
    attitude being known.
    """
    root_of_six(f)
    move(f, f.x, dt, f.centre)
    _carry_linear(f, dt)
    _pairs(f, dt)
    add_pairs(f, 0)
    _gather(f, dt)


@compiled_inline
def _pairs_in_turn(f: Record, dt: float, pairs: int, moved: Any) -> None:
    """Write the scaled half differences and half sums of the first pairs of sigma points, and their
    mean. ``moved`` carries one point after the other ahead.
    """
    spread, weight, scale = _spread_of(f)
    x, H, E, mean, error = f.x, f.H, f.E, f.mean, f.error
    for i in range(N):
        mean[i] = 0.0
    for j in range(pairs):
        for sign in range(2):
            displace(x, f.S[j], spread if sign == 0 else -spread, f.rho, f.q, f.point)
            moved(f, f.point, dt, f.next)
            error_from(f.next, f.centre, error[sign])
        for i in range(N):
            H[j, i] = scale * (error[0, i] - error[1, i])
        for i in range(12):
            total = error[0, i] + error[1, i]
            E[j, i] = scale * total
            mean[i] += weight * total  # (26)


@compiled
def _move_point(f: Record, x: Array, dt: float, out: Array) -> None:
    quaternion_to_matrix(x[3:7], f.rotation)
    move(f, x, dt, out)


@compiled
def _pairs_in_lanes(f: Record, dt: float) -> None:
    """Do as ``_pairs_together`` where each number is a vector already: one point after the other
    needs no more memory than one.
    """
    _pairs_in_turn(f, dt, PAIRS, _move_point)


@compiled
def _pairs_together(f: Record, dt: float) -> None:
    """Write the same of six pairs, all of them side by side."""
    spread, weight, scale = _spread_of(f)
    spread_points(f, spread)
    propagate_points(f, dt)
    errors_of_points(f)
    halve_pairs(f, scale, weight)


_pairs = lanes_by(_pairs_together, _pairs_in_lanes)


@compiled
def _spread_of(f: Record) -> tuple[float, float, float]:
    """Return how far out sigma points lie, and the factors of a pair's mean and of
    its differences.
    """
    weight = 0.5 / (N + NOISE + f.kappa)  # (28)
    # with a pair of errors e and d: ee' + dd' = ((e - d)(e - d)' + (e + d)(e + d)') / 2, and the
    # second half is only there where the model is nonlinear, in the first 12 rows
    return math.sqrt(N + NOISE + f.kappa), weight, math.sqrt(0.5 * weight)


@compiled
def _carry_linear(f: Record, dt: float) -> None:
    for i in range(3):
        for j in range(3):
            f.centre_rotation[i, j] = f.rotation[i, j]
    follow_loads(f, f.centre_rotation, dt)
    carry_linear_part(f, dt)
    add_noise(f, f.centre_rotation, dt)


@compiled
def _gather(f: Record, dt: float) -> None:
    """Take the mean's part off the covariance, and fold it into the estimate."""
    P, mean = f.P, f.mean
    for i in range(12):
        a = mean[i]
        for j in range(first_column(P, i), 12):
            square = a * mean[j]
            P[i, j] -= square
            if j >= first_below(P, i):
                P[j, i] -= square
    fold(f, f.centre, mean)
    symmetrise(P)
    f.x[NIS] = math.nan
    after_prediction(f, dt)


@compiled
def innovate(f: Record, pose: Array, with_position: bool, with_attitude: bool) -> float:
    """Leave the root of the innovation's covariance in ``f.L`` and the whitened innovation of what
    was measured of a pose (7,), (rho, x), in ``f.innovation``; return the NIS.

    Leaves the innovation itself in ``f.poses.residual``, its change since the last measurement
    taken in, in ``f.increment``, and the variances of the expected pose in ``f.unsure``.
    """
    x, P, L, scales, y, residual = f.x, f.P, f.L, f.scales, f.innovation, f.poses.residual
    attitude_error(pose[3:7], x[3:7], y[0:3])
    for i in range(3):
        y[3 + i] = pose[i] - x[i]
    for i in range(6):
        f.increment[i] = y[i] - residual[i]
        residual[i] = choose(with_attitude if i < 3 else with_position, y[i], residual[i])
    # y becomes the whitened innovation; whatever stands there of what was not measured, it becomes
    # zero
    nis = 0.0
    for i in range(6):
        measured = with_attitude if i < 3 else with_position
        a = i if i < 3 else i + 3  # rows of (rho, x) in the error state are 0-2 and 6-8
        for j in range(i):
            total = P[a, j if j < 3 else j + 3]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = choose(
                measured & (with_attitude if j < 3 else with_position), total / L[j, j], 0.0
            )
            y[i] -= L[i, j] * y[j]
        noise = pose_noise(f, i)
        f.unsure[i] = P[a, a]
        total = P[a, a] + noise
        for k in range(i):
            total -= L[i, k] * L[i, k]
        # never below the measurement's own variance, whatever rounding does
        L[i, i] = math.sqrt(max(total, noise))
        scales[i] = choose(measured, 1.0 / L[i, i], 0.0)
        y[i] = choose(measured, y[i] / L[i, i], 0.0)
        nis += y[i] * y[i]
    return nis


@compiled
def take_in(f: Record) -> None:
    """Correct with the innovation that ``innovate`` left, whatever its size: (29)-(37)."""
    whiten(f)
    subtract_squares(f)
    for i in range(NIS):
        f.centre[i] = f.x[i]
    fold(f, f.centre, f.mean)


@compiled
def correct(f: Record, pose: Array, with_position: bool, with_attitude: bool) -> None:
    """Take in what was measured of a pose (7,), (rho, x), unless it is not to be believed."""
    x, scales, y, residual = f.x, f.scales, f.innovation, f.poses.residual
    nis = innovate(f, pose, with_position, with_attitude)
    taken = believable(f, pose, with_position, with_attitude, nis)
    if not all_of(taken):
        if not any_of(taken):
            return
        for i in range(6):
            scales[i], y[i] = choose(taken, scales[i], 0.0), choose(taken, y[i], 0.0)
    take_in(f)
    for i in range(6):
        residual[i] -= choose(taken, f.mean[i if i < 3 else 3 + i], 0.0)
    if not all_of(taken):  # a quaternion brought to length 1 once more may change in its last digit
        for i in range(3, 7):
            x[i] = choose(taken, x[i], f.centre[i])


@compiled
def correct_parts(f: Record, z: Array, parts: int) -> None:
    """Correct with the checked ``parts`` of ``z`` (11,): 1 position, 2 attitude, 3 both."""
    if parts != 0:
        correct(f, z[4:11], parts & 1 != 0, parts & 2 != 0)


@compiled
def step(f: Record, z: Array, parts: int, dt: float, voltage: float) -> int:
    """Predict over ``dt`` s if that is positive, then correct with the ``parts`` of ``z`` (11,)
    that were measured.

    Returns the parts that could be used, or -1, with the filter as it was, if the quaternion is no
    rotation.
    """
    usable: int = check_sample(f, z, parts)
    if usable >= 0:
        sample = undo_sensing(f, z, usable, dt)
        if dt > 0.0:
            predict(f, sample[0:4], dt, voltage)
        correct_parts(f, sample, usable)
    return usable


_POSES = FILTER.fields["poses"][1]  # type: ignore[index]  # where their memory begins
_STRAINED = 0.01  # of a variance: less is not told


@compiled
def _add_doubt(record: Record, variances: Array) -> None:
    """Widen an estimate's variances (18,) by refused and unlikely poses."""
    f = record[0]
    doubted_variance(f, f.mean)
    for i in range(N):
        variances[i] += f.poses.strain * variances[i] + f.mean[i]


@compiled
def write_variances(f: Record, out: Array) -> None:
    """Write the variances (18,) of the error state, widened by refused and unlikely poses, into
    ``out``; of a single filter or of a block in hand.
    """
    m = f.poses
    doubted = (m.phase > BELIEVING) | (m.strain > _STRAINED) | (m.astray > 0.0)
    for i in range(N):
        out[i] = f.P[i, i]
    if any_of(doubted):
        _add_doubt((f,), out)
        for i in range(N):
            out[i] = choose(doubted, out[i], f.P[i, i])


@compiled
def write_numbers(f: Record, out: Array) -> None:
    """Write an estimate's numbers, without the covariance, into ``out``."""
    out[:STATE_SIZE], out[MODEL], out[EXCESS] = f.x, f.model, f.excess
    out[STATUS], out[RESTARTS] = f.status, f.restarts


def make_calls(
    record: np.ndarray,
    calls: np.ndarray,
    rows: NDArray[np.int64],
    numbers: Array,
    std: Array,
    loads: Array,
    innovations: Array | None = None,
) -> int:
    """Make calls (n,) of an unscented filter, and write the results into the row of each. Results
    are numbers (N, 30) and standard deviations (N, 18) of an estimate, and the loads of the
    vehicle's uncertainty (N, 7, 3). ``innovations`` (N, 12): of the last measured pose whitened,
    and the diagonal of the root of its covariance. Return the number of calls up to a quaternion
    that is no rotation.
    """
    given = np.ascontiguousarray(calls).view(np.uint8)
    made = _core.make_calls(record.ctypes.data, given, rows, numbers, std, loads, innovations)
    raise_errors()
    return made


class WrenchUKF:
    """Unscented Kalman filter for the external force and torque on a quadrotor.

    Call ``reset`` with a first pose, then ``step`` once a period; or ``predict`` and ``correct``
    with measurements that come at their own times. A measurement, or a part of it, that is None or
    not finite was not made. The sign of a quaternion means nothing. Rotor speeds that are not
    finite are taken to be the last ones that were.

    Args:
        vehicle: the declared vehicle; its declared effects are part of the prediction model, and
            the estimated wrench is what they do not explain.
        tuning: noise of model and measurement; default ``UKFTuning.for_vehicle(vehicle, period)``.
        period: time between steps, s.
        gate: refuse poses, or parts of one, with an NIS of a smaller chance than ``1 - gate``
            (0.999, say), unless they go on from the pose before; None takes in any. Refused poses
            that agree with each other for ``recovery.patience`` are believed, and the filter
            restarts there.
        recovery: how gaps, outliers and restarts are dealt with, gate or not; default
            ``Recovery()``.

    What became of a step's measurement is ``estimate.status``, and ``estimate.restarts`` counts
    restarts (``estimator.recovery`` says when and why).

    Raises:
        InputError: period or gate out of range.
    """

    # the step of a filter at an address, and the address of that function
    _step_at: Callable[..., int] = staticmethod(_core.step)
    _step_address: Callable[[], int] = staticmethod(_core.step_address)
    _no_imu = ""  # why a kind of filter takes no inertial measurements

    def __init__(
        self,
        vehicle: Vehicle,
        tuning: UKFTuning | None = None,
        period: float = 0.005,
        gate: float | None = None,
        recovery: Recovery | None = None,
    ) -> None:
        if not isinstance(vehicle, Vehicle):
            raise InputError(
                f"{type(self).__name__}: vehicle must be a Vehicle, such as "
                f"load_vehicle('ardrone2'), got {vehicle!r}"
            )
        if not (math.isfinite(period) and period > 0):
            raise InputError(f"WrenchUKF: period must be positive, in s, got {period!r}")
        if gate is not None and not 0.5 <= gate < 1.0:
            raise InputError(
                f"WrenchUKF: gate must be a probability from 0.5 to below 1, got {gate!r}"
            )
        self.vehicle = vehicle
        self.tuning = UKFTuning.for_vehicle(vehicle, period) if tuning is None else tuning
        self.period = float(period)
        self.gate = gate
        self.recovery = Recovery() if recovery is None else recovery
        self.record = filter_record(vehicle, self.tuning, self.period, gate, self.recovery)
        load_imu(self.record[0], self.tuning, gate)
        _core.forget_biases(self.record.ctypes.data)
        self._voltage = vehicle.voltage_ref
        self._bind()
        self._prepare()

    def _prepare(self) -> None:
        """Do what a kind of filter adds to ``__init__``."""

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.vehicle.name}: period {self.period:g} s, "
            f"{self.estimate.status}>"
        )

    def _bind(self) -> None:
        """Lay what Python reads and writes in a step over the record."""
        self._sample = Sample(self.record["z"][0])
        self._address: int = self.record.ctypes.data
        self._now: Array = np.ndarray(ESTIMATE_SIZE, buffer=self.record, offset=ESTIMATE)
        # phase, strain and astray, read at a third of an array's cost
        self._doubts = memoryview(np.ndarray(3, buffer=self.record, offset=_POSES))  # type: ignore[arg-type]
        self._begun = False

    def __getstate__(self) -> dict[str, object]:
        return {
            name: value
            for name, value in self.__dict__.items()
            if name not in ("_sample", "_address", "_now", "_doubts", "_begun")
        } | {"record": without_addresses(self.record)}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        lay_addresses(self.record[0], compile_effects(self.vehicle))
        self._bind()

    def __copy__(self) -> Self:
        """Return a filter with a memory of its own that stands where this one stands."""
        return deepcopy(self)

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
            InputError: a shape is wrong, a number is not finite, the quaternion is not one of a
                rotation, or the covariance is not symmetric and positive definite.
        """
        x = np.zeros(STATE_SIZE)
        for name, value, where in (
            ("position", position, POSITION),
            ("quaternion", quaternion, QUATERNION),
            ("velocity", velocity, VELOCITY),
            ("angular_velocity", angular_velocity, RATE),
        ):
            x[where] = _finite(f"reset: {name}", value, x[where].size)
        length = float(np.linalg.norm(x[3:7]))
        if not 0.9 < length < 1.1:
            raise InputError(f"reset: quaternion must have length 1, got {length:g}")
        x[3:7] /= length
        x[NIS] = math.nan
        if covariance is None:
            P = default_covariance(self.vehicle, self.tuning)
        else:
            P = np.array(covariance, dtype=np.float64)
            if (
                P.shape != (N, N)
                or not np.all(np.isfinite(P))
                or not np.allclose(P, P.T, rtol=1e-8, atol=1e-300)
            ):
                raise InputError(
                    f"reset: covariance must be a finite symmetric (18, 18) matrix, got shape "
                    f"{P.shape}"
                )
            if np.linalg.eigvalsh(P)[0] <= 0:
                raise InputError("reset: covariance must be positive definite")
        f = self.record[0]
        f["x"], f["P"] = x, P
        reset_model(f)
        _core.start(self._address)
        for name in (*fields_between("status", "model"), "poses", "load"):
            f[name] = 0.0
        f["predicted"] = np.diag(f["P"])[12:]
        f["poses"]["seen"] = f["x"][:7]
        self._begin()

    def _begin(self) -> None:
        """Do what a kind of filter adds to ``reset``."""

    @property
    def step_address(self) -> int:
        """Address of the step for ``call_step``, in compiled loops; it knows nothing of an IMU.

        Raises:
            InputError: ``correct_imu`` was called.
        """
        if self.record[0]["imu"]["used"]:
            raise InputError("step_address: a filter that was given an IMU steps in Python only")
        return self._step_address()

    @property
    def memory(self) -> tuple[NDArray[np.uint8], ...]:
        """All that a step changes, as bytes that can be copied and put back."""
        return (self.record.view(np.uint8),)

    @property
    def covariance(self) -> Array:
        """Covariance (18, 18) of the error state (rho, omega, x, v, torque, force), rho being a
        world-frame MRP.
        """
        return self.estimate.covariance

    @property
    def dead_reckoning(self) -> float:
        """How long, s, the wrench has been a prediction: since a whole pose was taken in."""
        poses = self.record[0]["poses"]
        return float(max(poses["position_age"], poses["attitude_age"]))

    @property
    def covariance_with_biases(self) -> Array:
        """Covariance (24, 24) of the same and of the biases of gyro and accelerometer, last."""
        return joint_covariance(self.record[0])

    @property
    def gyro_bias(self) -> Array:
        """Estimated bias (3,) of the gyro, rad/s, body."""
        return np.array(self.record[0]["imu"]["mean"][:3])

    @property
    def accelerometer_bias(self) -> Array:
        """Estimated bias (3,) of the accelerometer, m/s2, body."""
        return np.array(self.record[0]["imu"]["mean"][3:BIASES])

    @property
    def gyro_bias_std(self) -> Array:
        """Standard deviation (3,) of the gyro's estimated bias, rad/s."""
        return np.array(np.sqrt(np.diagonal(self.record[0]["imu"]["bias_covariance"])[:3]))

    @property
    def accelerometer_bias_std(self) -> Array:
        """Standard deviation (3,) of the accelerometer's estimated bias, m/s2."""
        return np.array(np.sqrt(np.diagonal(self.record[0]["imu"]["bias_covariance"])[3:]))

    @property
    def imu_refused(self) -> int:
        """How many inertial measurements the gate has refused, wholly or in part, since
        ``reset``.
        """
        return int(self.record[0]["imu"]["refused"])

    @property
    def estimate(self) -> WrenchEstimate:
        """The estimate now. While poses are refused, or unlikely ones taken in, its covariance
        widens.
        """
        numbers, doubts = self._now.copy(), self._doubts
        if doubts[0] > BELIEVING or doubts[1] > _STRAINED or doubts[2] > 0.0:
            variances = numbers[_VARIANCES].copy()
            _core.add_doubt(self._address, variances)
            numbers[_VARIANCES] = variances
        return WrenchEstimate(numbers)

    def step(
        self,
        rotor_speeds: ArrayLike,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        voltage: float | None = None,
    ) -> WrenchEstimate:
        """Predict over one period with the rotor speeds of that period, then take in the pose at
        its end.

        Args:
            rotor_speeds: (4,) rad/s.
            position: (3,) m, world, or None.
            quaternion: (4,) body to world, scalar first, or None.
            voltage: battery voltage, V, for effects that depend on it; default ``voltage_ref``.

        Raises:
            InputError: a shape or type is wrong, a rotor speed is negative, or the quaternion's
                length is not 1; the filter stays as it was. Or a declared effect of a user's own
                raised an error; the step was made without the effect.
        """
        parts = self._sample.read(rotor_speeds, position, quaternion)
        return self._run(parts, self.period, voltage)

    def predict(
        self, rotor_speeds: ArrayLike, dt: float | None = None, voltage: float | None = None
    ) -> WrenchEstimate:
        """Carry the filter ``dt`` s (default: one period) ahead without a measurement."""
        dt = self.period if dt is None else dt
        if not (math.isfinite(dt) and dt > 0):
            raise InputError(f"predict: dt must be positive, in s, got {dt!r}")
        return self._run(self._sample.read(rotor_speeds, None, None), dt, voltage)

    def correct(self, position: ArrayLike | None, quaternion: ArrayLike | None) -> WrenchEstimate:
        """Take in a pose, or a part of one, measured now."""
        return self._run(self._sample.read(self._sample.z[0:4], position, quaternion), 0.0, None)

    def correct_imu(
        self, gyro: ArrayLike | None = None, accelerometer: ArrayLike | None = None
    ) -> WrenchEstimate:
        """Take in an inertial measurement made now, at the geometric centre; see ``estimator.imu``.

        From the first call on the filter also estimates the biases of both. The accelerometer is
        left out while nothing is known of the rotors: before the first step after ``reset``.

        Args:
            gyro: (3,) rad/s, body, or None.
            accelerometer: (3,) m/s2, body, specific force (+g along z at hover) at the end of the
                last step or averaged over it, or None.

        Raises:
            InputError: a shape is wrong or a number is not finite; the filter stays as it was.
        """
        if self._no_imu:
            raise InputError(f"{type(self).__name__}: {self._no_imu}")
        z = np.zeros(6)
        for name, value, where in (
            ("gyro", gyro, slice(0, 3)),
            ("accelerometer", accelerometer, slice(3, 6)),
        ):
            if value is not None:
                z[where] = _finite(f"correct_imu: {name}", value, 3)
        _core.take_in_imu(self._address, z, gyro is not None, accelerometer is not None)
        return self.estimate

    def _run(self, parts: int, dt: float, voltage: float | None) -> WrenchEstimate:
        if not self._begun:
            self._begun = bool(self.record[0]["x"][3:7].any())
            if not self._begun:
                raise InputError(f"{type(self).__name__}: call reset before a step")
        volts = self._voltage if voltage is None else voltage
        if self._step_at(self._address, parts, dt, volts) < 0:
            raise self._sample.bad_quaternion()
        raise_errors()
        return self.estimate


def _finite(what: str, value: ArrayLike, size: int) -> Array:
    """Return some finite numbers (size,).

    Raises:
        InputError: the shape is another, or a number is not finite.
    """
    array = real_numbers(value)
    if array is None or array.shape != (size,) or not np.all(np.isfinite(array)):
        raise InputError(f"{what} must be {size} finite numbers, got {value!r}")
    return array


def default_covariance(vehicle: Vehicle, tuning: UKFTuning) -> Array:
    """Return the covariance (18, 18) of a vehicle that was just seen, near rest, with an unknown
    wrench.
    """
    deviations = np.empty(N)
    deviations[0:3] = np.asarray(tuning.attitude_noise, dtype=np.float64) / 4.0
    deviations[3:6] = 0.5  # rad/s
    deviations[6:9] = tuning.position_noise
    deviations[9:12] = 0.5  # m/s
    deviations[12:15] = 0.05 * vehicle.weight * vehicle.arm_l
    deviations[15:18] = 0.1 * vehicle.weight
    return np.diag(np.square(deviations))
