"""Biases of gyro and accelerometer, and the last step's noise, beside the filter's error state.

Neither enters the dynamics. A bias walks on its own. The noise of a step ends with the step. So
both are kept as a regression on the error state e and a rest that is independent of e,

    c = c_mean + T' e + r,   cov(r) = E,   r and e independent,

their joint normal distribution with e: cov(e, c) = P T, cov(c) = T' P T + E. In this form

* the joint covariance is positive definite whenever P and E are, whatever happens to P.
* A measured pose is of e alone and changes neither T nor E. The pose moves c_mean by T' times the
  correction of e, and a refused pose moves nothing.
* The prediction carries cov(e, c) with the transition of P, and solves for T anew.

The companions c are the biases of gyro (3, rad/s) and accelerometer (3, m/s2), both in body axes.
The noise of the last step follows, in standard deviations: motor torque (3) and thrust (3). A
specific force measured over a step shares the step's noise with the velocity. With the noise as a
state no cross terms are missing, before or after the pose of the moment (Bar-Shalom, Li and
Kirubarajan, 2001, section 8.2.1).
"""

import math

import numpy as np

from ..dynamics.effects.base import STEP
from ..runtime.compiled import Record, compiled
from .covariance import carry_rows, divide, divide_transposed, root_of
from .error_state import error_from
from .estimate import NIS, Array
from .filter_record import AGREEING, BIASES, COMPANIONS, N
from .tuning import UKFTuning

_FARTHEST = 1e6  # largest NIS for which a linear correction means anything, gate or not
_BLIND = 1e-12  # of a variance: less than this cannot be left of it


def load_imu(f: np.void, tuning: UKFTuning, gate: float | None) -> None:
    """Write an IMU's numbers of ``tuning`` and ``gate``, a probability or None, into a filter's
    record.
    """
    imu = f["imu"]
    for where, gyro, accelerometer in (
        ("walk", tuning.gyro_bias_walk, tuning.accelerometer_bias_walk),
        ("prior", tuning.gyro_bias_std, tuning.accelerometer_bias_std),
    ):
        imu[where][:3], imu[where][3:] = np.square(gyro), np.square(accelerometer)
    imu["bound"][:3], imu["bound"][3:] = tuning.gyro_bias_bound, tuning.accelerometer_bias_bound
    imu["gate"] = _FARTHEST
    if gate is not None:
        from scipy.stats import chi2

        imu["gate"] = chi2.ppf(gate, (3, 6, 3 * (AGREEING - 1)))
    forget_biases(f)


@compiled
def forget_biases(f: Record) -> None:
    """Give the biases their prior, and forget the step before with its rotors. A start does so. A
    restart at a pose does, too: the contradicted poses have gone into the biases.
    """
    imu = f.imu
    imu.known, imu.in_row = 0, 0
    imu.doubt[:] = -1.0
    imu.mean[:], imu.rest[:], imu.regression[:] = 0.0, 0.0, 0.0
    # a bias is in its sensor from the first sample on; the noise of a step, from the first step on
    imu.sensitivity[:], imu.bias_covariance[:] = 0.0, 0.0
    for i in range(BIASES):
        imu.rest[i, i], imu.rest[BIASES + i, BIASES + i] = imu.prior[i], 1.0
        imu.bias_covariance[i, i], imu.sensitivity[i, i] = imu.prior[i], 1.0


@compiled
def reset_imu(record: Record) -> None:
    """Start without an inertial measurement."""
    forget_biases(record[0])
    record[0].imu.refused = 0


@compiled
def begin_imu(record: Record) -> None:
    """Start to carry biases with a filter that had none so far. The correlation of the last step's
    noise with the error state is known if nothing was corrected since. Otherwise an accelerometer
    counts from the next step on.
    """
    f = record[0]
    reset_imu(record)
    f.imu.used = 1
    if f.time > 0.0 and math.isnan(f.x[NIS]):
        carry_companions(f, f.rotors[STEP], np.zeros((N, BIASES)))


@compiled
def bound_biases(f: Record) -> None:
    """Keep the biases within what a sensor of their class can have."""
    imu = f.imu
    for i in range(BIASES):
        imu.mean[i] = min(max(imu.mean[i], -imu.bound[i]), imu.bound[i])


@compiled
def restore_bias_prior(f: Record, first: int) -> None:
    """Give the bias of a sensor, of first number ``first`` (0 or 3), its prior variance without any
    correlation: measurements contradicted the bias for too long.
    """
    imu, last = f.imu, first + 3
    imu.regression[:, first:last] = 0.0
    imu.rest[first:last], imu.rest[:, first:last] = 0.0, 0.0
    imu.bias_covariance[first:last], imu.bias_covariance[:, first:last] = 0.0, 0.0
    for i in range(first, last):
        imu.rest[i, i], imu.bias_covariance[i, i] = imu.prior[i], imu.prior[i]


@compiled
def cross_covariance(f: Record, columns: int) -> Array:
    """Return the covariance (18, n) of the error state with the first n companions, P T."""
    cross: Array = f.P @ np.ascontiguousarray(f.imu.regression[:, :columns])
    return cross


@compiled
def split(f: Record, cross: Array, joint: Array) -> None:
    """Write regression and rest of the companions, from their covariance with the error state,
    ``cross`` (18, 12), and among themselves, ``joint`` (12, 12).
    """
    P, imu = f.P, f.imu
    imu.bias_covariance[:] = joint[:BIASES, :BIASES]
    # a forgotten number is correlated with nothing
    for i in range(N):
        if np.count_nonzero(P[i]) <= 1:
            cross[i] = 0.0
    root = root_of(P)
    whitened = divide(root, cross)
    imu.rest[:] = joint - whitened.T @ whitened
    rest = root_of(imu.rest)
    for i in range(COMPANIONS):
        if not rest[i, i] * rest[i, i] > _BLIND * joint[i, i]:
            # the filter's covariance was bounded since (of an unknown attitude), and no longer
            # belongs to these cross covariances
            imu.rest[:], imu.regression[:] = joint, 0.0
            return
    divide_transposed(root, whitened)
    imu.regression[:] = whitened


@compiled
def carry_companions(f: Record, dt: float, cross: Array) -> None:
    """Take a step of ``dt`` s: the biases walk, and the step has a noise of its own.

    ``cross`` (18, 6): covariance of the error state after the step with the biases before.
    """
    imu, joint = f.imu, np.eye(COMPANIONS)
    joint[:BIASES, :BIASES] = imu.bias_covariance
    for i in range(BIASES):
        joint[i, i] += dt / f.period * imu.walk[i]
        imu.sensitivity[i, i] = 1.0
    imu.mean[BIASES:] = 0.0
    # the accelerations of the noise, in body axes: velocity is rows 9-11
    turned = f.centre_rotation.T @ np.ascontiguousarray(f.B[:, 9:12].T)
    imu.sensitivity[3:, BIASES:] = turned / dt
    # one standard deviation of each input, as ``add_noise`` leaves them
    all_cross = np.empty((N, COMPANIONS))
    all_cross[:, :BIASES], all_cross[:, BIASES:] = cross, f.B.T
    split(f, all_cross, joint)
    imu.known = 1
    for s in range(2):
        if imu.doubt[s] >= 0.0:
            imu.doubt[s] += dt


@compiled
def carry_with_points(f: Record, dt: float, cross: Array) -> Array:
    """Return ``cross`` (18, n), covariance of the error state with a constant, carried over the
    last unscented prediction.

    A constant beside the state is a further row of the root. In columns drawn as pairs of points
    its entries go with half the difference of the pair. The others go with the linear part of the
    model.
    """
    S, pairs = f.S, 6 if f.wrench_count == 0 else 12
    rows, rest, out = np.empty((pairs, cross.shape[1])), cross.copy(), np.empty_like(cross)
    for j in range(pairs):
        for m in range(rows.shape[1]):
            rows[j, m] = rest[j, m] / S[j, j]
            for i in range(j, N):
                rest[i, m] -= S[j, i] * rows[j, m]
    rest[6:pairs] = 0.0
    carry_rows(f, dt, rest[6:], out)
    out += f.H[:pairs].T @ rows
    return out


@compiled
def correct_companions(f: Record, before: Array) -> None:
    """Move the companions with a pose's correction of the error state; ``before`` (20,): the state
    before the correction.
    """
    imu, error = f.imu, np.empty(N)
    error_from(f.x, before, error)
    imu.mean[:] += imu.regression.T @ error
    bound_biases(f)
    biases = np.ascontiguousarray(imu.regression[:, :BIASES])
    imu.bias_covariance[:] = imu.rest[:BIASES, :BIASES] + biases.T @ (f.P @ biases)


def joint_covariance(f: np.void) -> Array:
    """Return the covariance (24, 24) of the error state and the biases of gyro and
    accelerometer.
    """
    imu, cross = f["imu"], cross_covariance(f, BIASES)
    biases = imu["regression"][:, :BIASES].T @ cross + imu["rest"][:BIASES, :BIASES]
    return np.block([[f["P"], cross], [cross.T, biases]])
