"""The wrench filter with the mass as a nineteenth state.

The paper: "mass and inertia may be included in the state". A vehicle that picks up a load changes
its weight and its response to thrust; the wrench filter calls the first an external force and knows
nothing of the second. At hover a changed mass and a vertical force are the same thing: which of the
two takes it is decided by how fast either may walk.

A mass is learned from how the vehicle answers to its thrust, and it stays; so does what a fault
puts into it, long after the force has come right again. The mass therefore checks what it learns.
Of a filter whose model holds, the sum of the mass's corrections over some time has just the
variance by which they claim to make the mass better known. Corrections that add up to far more than
that come from something that no mass explains: rotor speeds that lie, a push, a load that is picked
up. Then, after an innovation that a sound filter never sees, and where the filter restarts because
it was contradicted, the mass is known no better than at the start, jointly with the force: the
acceleration, which is what was seen, stays as it was (at hover, the sum of vertical force and
weight), and the standard deviations of both say that they are not told apart.
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
from .recovery import (
    NOISE,
    Recovery,
    after_prediction,
    largest_nis,
    lost_attitude,
    lost_position,
)
from .sample import check_sample, copy_estimate, empty_estimate, undo_sensing
from .tuning import UKFTuning
from .ukf import WrenchUKF, believable, innovate

# standard deviations by which the corrections of ``Recovery.patience`` may miss what they claim. A
# sound filter misses more in one of 400 such times; of these only those count that moved the mass
# by as large a part of its standard deviation as this is the inverse of, and there are none but
# while a mass is new
_DOUBTED = 3.0
# of an innovation: what a sound filter sees less often teaches nothing of the mass
_UNLIKELY = 1e-6
_FORCE, _FORCE_ROW = NIS - 3, N - 3  # where the force begins in state and covariance


@compiled
def _step_with_mass(
    record: Record,
    z: Array,
    parts: int,
    dt: float,
    voltage: float,
    mass_walk: float,
    first: Array,
    unlikely: Array,
    P: Array,
    learned: Array,
    out: Array,
) -> int:
    """Predict over ``dt`` s and correct with what is usable of ``z`` (11,).

    ``first`` (2,) is the mass at the start, kg, and its variance. ``P`` (19, 19) has the mass last.
    ``learned`` (2,) is the sum of the mass's late corrections, kg, and its variance; ``unlikely``
    (2,) is the NIS of three numbers and of six from which on an innovation is doubted.
    """
    f = record[0]
    usable: int = check_sample(f, z, parts)
    if usable < 0:
        return usable
    sample = undo_sensing(f, z, usable, dt)
    if dt > 0.0:
        restarts = f.restarts
        _predict(f, sample[0:4], dt, voltage, mass_walk, P)
        faded = math.exp(-dt / f.patience)
        learned[0] *= faded
        learned[1] *= faded * faded
        if f.restarts > restarts:  # numbers overflowed, perhaps those of the mass as well
            f.body.mass = first[0]
            for i in range(N + 1):
                P[i, N], P[N, i] = 0.0, 0.0
            P[N, N] = first[1]
            _take_over(f, P)
            _forget_mass(f, P, first, learned)
    if usable > 0:
        _correct(f, sample, usable, P, first, unlikely, learned)
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
def _correct(
    f: Record, z: Array, parts: int, P: Array, first: Array, unlikely: Array, learned: Array
) -> None:
    """(29)-(37): the correction of ``ukf``, with a nineteenth row."""
    position, quaternion = z[4:7], z[7:11]
    with_position, with_attitude = parts & 1 != 0, parts & 2 != 0
    lost = (with_position and lost_position(f)) or (with_attitude and lost_attitude(f))
    nis = innovate(f, position, quaternion, with_position, with_attitude)
    taken = believable(f, position, quaternion, with_position, with_attitude, nis)
    if not taken:
        _take_over(f, P)
        if f.status == RESTARTED:
            for i in range(N):
                P[i, N], P[N, i] = 0.0, 0.0
            # a gap says nothing of the mass; what contradicts the estimate of the wrench does so of
            # the mass, which stood for it
            if not lost:
                _forget_mass(f, P, first, learned)
        return
    # the whitened cross covariance of the mass, as ``whiten`` has it of the others
    w = np.empty(6)
    for i in range(6):
        w[i] = P[N, i if i < 3 else i + 3]
        for k in range(i):
            w[i] -= f.L[i, k] * w[k]
        w[i] *= f.scales[i]
    whiten(f)
    step, gained = 0.0, 0.0
    for k in range(6):
        step += w[k] * f.innovation[k]
        gained += w[k] * w[k]
        for i in range(N):
            P[i, N] -= w[k] * f.W[k, i]
            P[N, i] = P[i, N]
    # never below what rounding leaves of it
    P[N, N] = max(P[N, N] - gained, 1e-14 * P[N, N])
    subtract_squares(f)
    for i in range(N):
        for j in range(N):
            P[i, j] = f.P[i, j]
    for i in range(NIS):
        f.centre[i] = f.x[i]
    fold(f, f.centre, f.mean)
    f.body.mass = max(f.body.mass + step, 1e-6)
    learned[0] += step
    learned[1] += gained
    moved, doubted = learned[0] * learned[0], _DOUBTED * _DOUBTED
    contradicted = moved > doubted * learned[1] and doubted * moved > P[N, N]
    if contradicted or nis > unlikely[1 if with_position and with_attitude else 0]:
        _forget_mass(f, P, first, learned)


@compiled
def _forget_mass(f: Record, P: Array, first: Array, learned: Array) -> None:
    """Know the mass no better than at the start, and the force no better than the mass.

    What is known of everything else, given the mass, stays; so does the acceleration, which is
    what was observed: at hover the sum of vertical force and weight.
    """
    variance = P[N, N]
    for i in range(N):
        for j in range(N):
            P[i, j] -= P[i, N] * P[j, N] / variance
    for i in range(N):
        P[i, N], P[N, i] = 0.0, 0.0
    # force per mass at one acceleration: gravity alone. What the estimated acceleration was when it
    # was contradicted says nothing of the one that is flown from now on, and a force that is known
    # for another one would, with the next samples, tell a mass that nothing has shown. Nor does it
    # say that the force is right for any mass: it is doubted by as much on its own
    share = np.array([0.0, 0.0, f.body.gravity])
    for i in range(3):
        force = f.x[_FORCE + i] + share[i] * (first[0] - f.body.mass)
        if f.status == RESTARTED and force * force > f.reason[3 + i]:
            force = 0.0  # as ``recovery`` has it of wrenches that are out of all reason
        f.x[_FORCE + i] = force
        P[_FORCE_ROW + i, N] = share[i] * first[1]
        P[N, _FORCE_ROW + i] = P[_FORCE_ROW + i, N]
        P[_FORCE_ROW + i, _FORCE_ROW + i] += share[2] * share[2] * first[1]
        for j in range(3):
            P[_FORCE_ROW + i, _FORCE_ROW + j] += share[i] * share[j] * first[1]
    f.body.mass = first[0]
    P[N, N] = first[1]
    for i in range(N):
        for j in range(N):
            f.P[i, j] = P[i, j]
    learned[0], learned[1] = 0.0, 0.0


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
        P[i, N] = 0.0 if alone else P[i, N] * math.sqrt(f.P[i, i] / P[i, i])
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
        recovery: as for ``WrenchUKF``; after a gap the mass is still known.
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
        self._first = np.array([self._first_mass, self._mass_std**2])
        self._unlikely = np.array([largest_nis(1.0 - _UNLIKELY, dof) for dof in (3, 6)])
        self._learned = np.zeros(2)

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
        self._learned[:] = 0.0
        self.record[0]["body"]["mass"] = self._first_mass

    @property
    def memory(self) -> tuple[NDArray[np.uint8], ...]:
        """All that a step changes, as bytes that can be copied and put back."""
        return (
            *super().memory,
            self._P.reshape(-1).view(np.uint8),
            self._learned.view(np.uint8),
        )

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
                self._first,
                self._unlikely,
                self._P,
                self._learned,
                out,
            )
            < 0
        ):
            raise self._sample.bad_quaternion()
        return WrenchEstimate(out)
