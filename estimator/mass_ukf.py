"""The wrench filter with the mass as a nineteenth state.

The paper: "mass and inertia may be included in the state". A vehicle that picks up a load changes
its weight and its response to thrust; the wrench filter calls the first an external force and knows
nothing of the second. At hover a changed mass and a vertical force are the same thing: which of the
two takes it is decided by how fast either may walk.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import Record, compiled
from ..runtime.errors import InputError
from .covariance import add_noise, root_of, subtract_squares, whiten
from .error_state import displace, error_from, fold, symmetrise
from .estimate import NIS, RESTARTED, Array, WrenchEstimate
from .filter_record import N, drive, propagate
from .recovery import Recovery, after_prediction
from .sample import check_sample, copy_estimate, empty_estimate, undo_sensing
from .tuning import UKFTuning
from .ukf import NOISE, WrenchUKF, believable, innovate


@compiled
def _step_with_mass(
    record: Record,
    z: Array,
    parts: int,
    dt: float,
    voltage: float,
    mass_walk: float,
    first_variance: float,
    P: Array,
    out: Array,
) -> int:
    """Predict over ``dt`` s and correct with what is usable of ``z`` (11,); ``P`` (19, 19) has the
    mass (kg) last.
    """
    f = record[0]
    usable: int = check_sample(f, z, parts)
    if usable < 0:
        return usable
    sample = undo_sensing(f, z, usable, dt)
    if dt > 0.0:
        _predict(f, sample[0:4], dt, voltage, mass_walk, P)
    if usable > 0:
        _correct(f, sample, usable, P, first_variance)
    copy_estimate(f, out)
    return usable


@compiled
def _predict(
    f: Record, rotor_speeds: Array, dt: float, voltage: float, mass_walk: float, P: Array
) -> None:
    """(18)-(27) with 39 sigma points, each with its own mass."""
    drive(f, rotor_speeds, dt, voltage)
    mass = f.body.mass
    spread = math.sqrt(N + 1 + NOISE + 1 + f.kappa)
    weight = 0.5 / (spread * spread)  # (28)
    root = root_of(P)
    propagate(f, f.x, dt, f.centre)
    for i in range(3):
        for j in range(3):
            f.centre_rotation[i, j] = f.rotation[i, j]
    errors = np.zeros((2 * (N + 1), N + 1))
    column = np.empty(N)
    for j in range(N + 1):
        for i in range(N):
            column[i] = root[i, j]
        for sign in range(2):
            signed = spread if sign == 0 else -spread
            displace(f.x, column, signed, f.rho, f.q, f.point)
            # a mass of nothing has no acceleration: far out in the tail a point stays on this side
            # of it
            f.body.mass = max(mass + signed * root[N, j], 0.1 * mass)
            propagate(f, f.point, dt, f.next)
            error_from(f.next, f.centre, errors[2 * j + sign])
            errors[2 * j + sign, N] = f.body.mass - mass
    f.body.mass = mass
    mean = np.zeros(N + 1)
    for k in range(2 * (N + 1)):
        mean += weight * errors[k]
    P[:, :] = weight * (errors.T @ errors)
    for i in range(N + 1):
        for j in range(N + 1):
            P[i, j] -= mean[i] * mean[j]
    for i in range(N):
        for j in range(N):
            f.P[i, j] = 0.0
    add_noise(f, f.centre_rotation, dt)
    for i in range(N):
        for j in range(N):
            P[i, j] += f.P[i, j]
    P[N, N] += mass_walk * mass_walk * dt / f.period
    fold(f, f.centre, mean)
    f.body.mass = mass + mean[N]
    symmetrise(P)
    for i in range(N):
        for j in range(N):
            f.P[i, j] = P[i, j]
    f.x[NIS] = math.nan
    after_prediction(f, dt)
    _take_over(f, P)
    f.time += dt


@compiled
def _correct(f: Record, z: Array, parts: int, P: Array, first_variance: float) -> None:
    """(29)-(37): the correction of ``ukf``, with a nineteenth row."""
    position, quaternion = z[4:7], z[7:11]
    with_position, with_attitude = parts & 1 != 0, parts & 2 != 0
    nis = innovate(f, position, quaternion, with_position, with_attitude)
    taken = believable(f, position, quaternion, with_position, with_attitude, nis)
    if not taken:
        _take_over(f, P)
        if f.status == RESTARTED:
            # what contradicts the estimate of the wrench does so of the mass, which stood for it
            for i in range(N):
                P[i, N], P[N, i] = 0.0, 0.0
            P[N, N] = max(P[N, N], first_variance)
        return
    # the whitened cross covariance of the mass, as ``whiten`` has it of the others
    w = np.empty(6)
    for i in range(6):
        w[i] = P[N, i if i < 3 else i + 3]
        for k in range(i):
            w[i] -= f.L[i, k] * w[k]
        w[i] *= f.scales[i]
    whiten(f)
    step = 0.0
    for k in range(6):
        step += w[k] * f.innovation[k]
        for i in range(N):
            P[i, N] -= w[k] * f.W[k, i]
            P[N, i] = P[i, N]
        P[N, N] -= w[k] * w[k]
    subtract_squares(f)
    for i in range(N):
        for j in range(N):
            P[i, j] = f.P[i, j]
    for i in range(NIS):
        f.centre[i] = f.x[i]
    fold(f, f.centre, f.mean)
    f.body.mass = max(f.body.mass + step, 1e-6)


@compiled
def _take_over(f: Record, P: Array) -> None:
    """Make the covariance (18, 18) of ``f`` that of P (19, 19); what has become independent of the
    rest there is so of the mass.
    """
    for i in range(N):
        alone = True
        for j in range(N):
            alone = alone and (i == j or f.P[i, j] == 0.0)
        # scaled as a whole: the mass keeps its correlation
        scale = 0.0 if alone else math.sqrt(f.P[i, i] / P[i, i])
        P[i, N] *= scale
        P[N, i] = P[i, N]
    for i in range(N):
        for j in range(N):
            P[i, j] = f.P[i, j]


class WrenchMassUKF(WrenchUKF):
    """``WrenchUKF`` that also estimates the vehicle's mass; made and used like it, at about four
    times its cost.

    Args:
        vehicle: the declared vehicle; its mass is the first guess.
        tuning: noise of model and measurement. A small ``force_walk`` along z lets the mass take
            what is vertical.
        period: time between steps, s.
        gate: as for ``WrenchUKF``.
        recovery: as for ``WrenchUKF``; a restart keeps the mass.
        mass_std: of the first guess, kg; default: a tenth of it.
        mass_walk: change of the mass in a step, standard deviation, kg.

    Raises:
        InputError: a setting out of range.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        tuning: UKFTuning | None = None,
        period: float = 0.005,
        gate: float | None = None,
        mass_std: float | None = None,
        mass_walk: float = 1e-5,
        recovery: Recovery | None = None,
    ) -> None:
        super().__init__(vehicle, tuning, period, gate, recovery)
        self._first_mass = float(self.record[0]["body"]["mass"])
        self._mass_std = 0.1 * self._first_mass if mass_std is None else mass_std
        for name, value in (("mass_std", self._mass_std), ("mass_walk", mass_walk)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"WrenchMassUKF: {name} must be positive, in kg, got {value!r}")
        self._mass_walk = mass_walk
        self._P = np.zeros((N + 1, N + 1))

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose, without an external wrench and with the declared mass; arguments as for
        ``WrenchUKF``.
        """
        super().reset(position, quaternion, covariance, velocity, angular_velocity)
        self._P[:] = 0.0
        self._P[:N, :N] = self.record[0]["P"]
        self._P[N, N] = self._mass_std**2
        self.record[0]["body"]["mass"] = self._first_mass

    @property
    def memory(self) -> tuple[NDArray[np.uint8], ...]:
        """All that a step changes, as bytes that can be copied and put back."""
        return (*super().memory, self._P.reshape(-1).view(np.uint8))

    @property
    def mass(self) -> float:
        """Estimated mass, kg."""
        return float(self.record[0]["body"]["mass"])

    @property
    def mass_std(self) -> float:
        """Standard deviation of the estimated mass, kg."""
        return float(math.sqrt(self._P[N, N]))

    def correct_imu(
        self, gyro: ArrayLike | None = None, accelerometer: ArrayLike | None = None
    ) -> Any:
        """Not offered together with the mass."""
        raise InputError(
            "WrenchMassUKF: correct_imu is not offered together with an estimated mass"
        )

    def _run(self, parts: int, dt: float, voltage: float | None) -> WrenchEstimate:
        out = empty_estimate()
        volts = self._voltage if voltage is None else voltage
        if (
            _step_with_mass(
                self.record,
                self._sample.z,
                parts,
                dt,
                volts,
                self._mass_walk,
                self._mass_std**2,
                self._P,
                out,
            )
            < 0
        ):
            raise self._sample.bad_quaternion()
        return WrenchEstimate(out)
