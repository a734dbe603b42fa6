"""The wrench filter: an unscented Kalman filter over pose, twist and external wrench of a
quadrotor.

McKinnon and Schoellig, *Unscented External Force and Torque Estimation for Quadrotors*, IROS 2016,
(15)-(37). The filter is exact to the paper's 61 and 49 sigma points and cheaper:

* The model is linear in the noise and in all states but attitude and rate. Pairs of sigma points
  along linear directions add exactly ``A S S' A'`` and ``B Q B'`` to the covariance. The 13 points
  of attitude and rate remain (25 if a declared effect depends on position or velocity).
* The root of the covariance is lower triangular: the filter needs its first 6 (or 12) columns, and
  the others through the Schur complement.
* The measurement is linear in the error state: the correction by 49 redrawn points is the Kalman
  update.

``core/ukf.hpp`` steps the filter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..dynamics.effects import compile_effects
from ..dynamics.effects.own import raise_errors
from ..dynamics.model import lay_addresses, reset_model, without_addresses
from ..dynamics.vehicle import Vehicle
from ..runtime.arguments import real_numbers
from ..runtime.errors import InputError
from .estimate import (
    ESTIMATE_SIZE,
    NIS,
    POSITION,
    QUATERNION,
    RATE,
    STATE_SIZE,
    VELOCITY,
    WITHOUT_COVARIANCE,
    Array,
    WrenchEstimate,
)
from .filter_record import BIASES, ESTIMATE, FILTER, fields_between, filter_record
from .imu import joint_covariance, load_imu
from .recovery import BELIEVING, N, Recovery
from .sample import Sample
from .tuning import UKFTuning

# A call of a filter: rotor speeds and pose, bits of the measured parts, s, V; or gyro and
# accelerometer, and their bits
CALL = np.dtype([("z", "f8", (11,)), ("parts", "i8"), ("dt", "f8"), ("voltage", "f8")])
IMU_PARTS = 4, 8  # gyro and accelerometer, beside the parts of a pose
_VARIANCES = slice(WITHOUT_COVARIANCE, None, N + 1)  # among an estimate's numbers
_POSES = FILTER.fields["poses"][1]  # type: ignore[index]  # where their memory begins
_STRAINED = 0.01  # share of a variance: less is not reported


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
    vehicle's uncertainty (N, 7, 3). ``innovations`` (N, 12): the last pose's, whitened, and
    the diagonal of the root of their covariance. Return the number of calls up to a quaternion
    that is no rotation.
    """
    memory = np.ascontiguousarray(calls).view(np.uint8)
    made = _core.make_calls(record.ctypes.data, memory, rows, numbers, std, loads, innovations)
    raise_errors()
    return made


class WrenchUKF:
    """Unscented Kalman filter for the external force and torque on a quadrotor.

    Call ``reset`` with a first pose, then ``step`` once a period; or ``predict`` and ``correct``
    with measurements at separate times. A measurement, or a part, that is None or not finite counts
    as missing. The sign of a quaternion has no meaning. The last finite rotor speeds replace speeds
    that are not finite.

    Args:
        vehicle: the declared vehicle; its declared effects are part of the prediction model, and
            the estimated wrench is what they do not explain.
        tuning: noise of model and measurement; default ``UKFTuning.for_vehicle(vehicle, period)``.
        period: time between steps, s.
        gate: a probability, such as 0.999. The filter refuses a pose, or a part, whose NIS has a
            smaller chance than ``1 - gate``, unless the pose continues the one before; None: no
            gate. Refused poses that agree with each other for ``recovery.patience`` are believed,
            and the filter restarts there.
        recovery: how gaps, outliers and restarts are dealt with, gate or not; default
            ``Recovery()``.

    ``estimate.status`` is the verdict on a step's measurement, ``estimate.restarts`` counts
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
            InputError: a wrong shape, a number that is not finite, a quaternion without a rotation,
                or a covariance that is not symmetric and positive definite.
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
        raise_errors()
        for name in (*fields_between("status", "model"), "poses", "load"):
            f[name] = 0.0
        f["predicted"] = np.diag(f["P"])[12:]
        f["poses"]["seen"] = f["x"][:7]
        self._begin()

    def _begin(self) -> None:
        """Do what a kind of filter adds to ``reset``."""

    @property
    def step_address(self) -> int:
        """Address of the step, for loops of the core; it knows nothing of an IMU.

        Raises:
            InputError: ``correct_imu`` was called.
        """
        if self.record[0]["imu"]["used"]:
            raise InputError("step_address: a filter that was given an IMU steps in Python only")
        return self._step_address()

    @property
    def memory(self) -> tuple[NDArray[np.uint8], ...]:
        """The filter's memory, as bytes to copy and to write back."""
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
        raise_errors()
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
