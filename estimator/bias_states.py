"""Biases of gyro and accelerometer, and the last step's noise, beside the filter's error state.

Neither enters the dynamics. A bias walks on its own; the noise of a step ends with it. So both are
kept as what the error state e says of them and a rest that it says nothing of,

    c = c_mean + T' e + r,   cov(r) = E,   r and e independent,

which is their joint normal distribution with e: cov(e, c) = P T, cov(c) = T' P T + E. In this form

* the joint covariance is positive definite whenever P and E are, whatever is done to P;
* a measured pose, which is of e alone, changes neither T nor E: it moves c_mean by T' times the
  correction of e, and a pose that is refused moves nothing;
* the prediction carries cov(e, c) with the transition that carries P, and T is solved for anew.

The companions c are the biases of gyro (3, rad/s) and accelerometer (3, m/s2), both in body axes,
then the noise of the last step in standard deviations: motor torque (3) and thrust (3). With that
noise as a state, a specific force that was measured over this step and a velocity that has moved
with the same noise need no cross terms (Bar-Shalom, Li and Kirubarajan, 2001, section 8.2.1): they
are there, before and after the pose of that moment.
"""

import math

import numpy as np

from ..dynamics.effects.base import STEP
from ..runtime.compiled import Record, compiled
from .covariance import carry_rows
from .error_state import error_from
from .estimate import NIS, Array
from .filter_record import AGREEING, BIASES, COMPANIONS, N
from .tuning import UKFTuning

_FARTHEST = 1e6  # largest NIS for which a linear correction means anything, gate or not
_BLIND = 1e-12  # of a variance: less than this cannot be left of it


def load_imu(f: np.void, tuning: UKFTuning, gate: float | None) -> None:
    """Write what ``tuning`` and ``gate``, a probability or None, say of an IMU into a filter's
    record.
    """
    imu = f["imu"]
    for where, gyro, accelerometer in (
        ("walk", tuning.gyro_bias_walk, tuning.accelerometer_bias_walk),
        ("prior", tuning.gyro_bias_std, tuning.accelerometer_bias_std),
    ):
        imu[where][:3], imu[where][3:] = np.square(gyro), np.square(accelerometer)
    imu["gate"] = _FARTHEST
    if gate is not None:
        from scipy.stats import chi2

        imu["gate"] = chi2.ppf(gate, (3, 6, 3 * (AGREEING - 1)))
    _forget(f)


@compiled
def _forget(f: Record) -> None:
    imu = f.imu
    imu.known, imu.refused, imu.in_row = 0, 0, 0
    for s in range(2):
        imu.doubt[s] = -1.0
    for i in range(COMPANIONS):
        imu.mean[i] = 0.0
        for j in range(COMPANIONS):
            imu.rest[i, j] = 0.0
        imu.rest[i, i] = imu.prior[i] if i < BIASES else 1.0
    # a bias is in its sensor from the first sample on; what a step's noise does there, the first
    # step says
    for i in range(BIASES):
        for j in range(COMPANIONS):
            imu.sensitivity[i, j] = 0.0
        imu.sensitivity[i, i] = 1.0
    _uncorrelate(f)
    _keep_bias_covariance(f, imu.rest)


@compiled
def reset_imu(record: Record) -> None:
    """Give the biases their prior, and forget the step before: what its rotors did is unknown."""
    _forget(record[0])


@compiled
def begin_imu(record: Record) -> None:
    """Start to carry biases with a filter that had none so far.

    What the last step's noise has to do with the error state is known if nothing was corrected
    since; else an accelerometer says something from the next step on.
    """
    f = record[0]
    _forget(f)
    f.imu.used = 1
    if f.time > 0.0 and math.isnan(f.x[NIS]):
        carry_companions(f, f.rotors[STEP], np.zeros((N, BIASES)))


@compiled
def _uncorrelate(f: Record) -> None:
    for i in range(N):
        for j in range(COMPANIONS):
            f.imu.regression[i, j] = 0.0


@compiled
def _keep_bias_covariance(f: Record, joint: Array) -> None:
    for i in range(BIASES):
        for j in range(BIASES):
            f.imu.bias_covariance[i, j] = joint[i, j]


@compiled
def restart_biases(f: Record) -> None:
    """Keep the biases with their covariance, and let nothing that happens to pose, twist and wrench
    touch them: after a restart at a new pose, what was wrong before it says nothing of what is
    wrong after it.
    """
    imu = f.imu
    for i in range(COMPANIONS):
        for j in range(COMPANIONS):
            imu.rest[i, j] = 0.0
        imu.rest[i, i] = 1.0
    for i in range(BIASES):
        for j in range(BIASES):
            imu.rest[i, j] = imu.bias_covariance[i, j]
        imu.mean[BIASES + i] = 0.0
    imu.known = 0
    _uncorrelate(f)


@compiled
def restore_bias_prior(f: Record, first: int) -> None:
    """Give the bias of the sensor whose first number is ``first`` (0 or 3) its prior variance, and
    no correlation with anything: it was contradicted for too long.
    """
    imu = f.imu
    for i in range(first, first + 3):
        for j in range(COMPANIONS):
            imu.rest[i, j] = 0.0
            imu.rest[j, i] = 0.0
        for j in range(N):
            imu.regression[j, i] = 0.0
        imu.rest[i, i] = imu.prior[i]
        for j in range(BIASES):
            imu.bias_covariance[i, j] = 0.0
            imu.bias_covariance[j, i] = 0.0
        imu.bias_covariance[i, i] = imu.prior[i]


@compiled
def lower_root(A: Array) -> Array:
    """Return the lower triangular root of a covariance (n, n), with a floor under what rounding
    leaves of a pivot.
    """
    n = len(A)
    root = np.zeros((n, n))
    for j in range(n):
        pivot = A[j, j]
        for k in range(j):
            pivot -= root[j, k] * root[j, k]
        root[j, j] = math.sqrt(max(pivot, 1e-14 * A[j, j] + 1e-300))
        for i in range(j + 1, n):
            total = A[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = total / root[j, j]
    return root


@compiled
def divide(root: Array, rows: Array) -> Array:
    """Return ``root^-1 rows`` for a lower triangular root (n, n) and rows (n, m)."""
    n, m = rows.shape
    out = np.empty((n, m))
    for i in range(n):
        inverse = 1.0 / root[i, i]
        for j in range(m):
            out[i, j] = rows[i, j]
        for k in range(i):
            a = root[i, k]
            for j in range(m):
                out[i, j] -= a * out[k, j]
        for j in range(m):
            out[i, j] *= inverse
    return out


@compiled
def divide_transposed(root: Array, rows: Array) -> None:
    """Replace rows (n, m) with ``root'^-1 rows`` for a lower triangular root (n, n)."""
    n, m = rows.shape
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            a = root[k, i]
            for j in range(m):
                rows[i, j] -= a * rows[k, j]
        inverse = 1.0 / root[i, i]
        for j in range(m):
            rows[i, j] *= inverse


@compiled
def cross_covariance(f: Record, columns: int) -> Array:
    """Return the covariance (18, n) of the error state with the first n companions, P T."""
    P, T = f.P, f.imu.regression
    out = np.zeros((N, columns))
    for i in range(N):
        for k in range(N):
            a = P[i, k]
            for j in range(columns):
                out[i, j] += a * T[k, j]
    return out


@compiled
def split(f: Record, cross: Array, joint: Array) -> None:
    """Write what the error state says of the companions, and what it does not, from their
    covariance with it, ``cross`` (18, 12), and among themselves, ``joint`` (12, 12).
    """
    P, imu = f.P, f.imu
    _keep_bias_covariance(f, joint)
    # what the filter has forgotten is correlated with nothing
    for i in range(N):
        alone = True
        for j in range(N):
            alone = alone and (i == j or P[i, j] == 0.0)
        if alone:
            for j in range(COMPANIONS):
                cross[i, j] = 0.0
    root = lower_root(P)
    whitened = divide(root, cross)
    for i in range(COMPANIONS):
        for j in range(i + 1):
            total = joint[i, j]
            for k in range(N):
                total -= whitened[k, i] * whitened[k, j]
            imu.rest[i, j] = total
            imu.rest[j, i] = total
    if not _is_positive(imu.rest, joint):
        # the filter's covariance was bounded since (an attitude that nobody knows), and no longer
        # belongs to these cross covariances
        for i in range(COMPANIONS):
            for j in range(COMPANIONS):
                imu.rest[i, j] = joint[i, j]
        _uncorrelate(f)
        return
    divide_transposed(root, whitened)
    for i in range(N):
        for j in range(COMPANIONS):
            imu.regression[i, j] = whitened[i, j]


@compiled
def _is_positive(rest: Array, joint: Array) -> bool:
    n = len(rest)
    root = np.zeros((n, n))
    for j in range(n):
        pivot = rest[j, j]
        for k in range(j):
            pivot -= root[j, k] * root[j, k]
        if not pivot > _BLIND * joint[j, j]:
            return False
        root[j, j] = math.sqrt(pivot)
        for i in range(j + 1, n):
            total = rest[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = total / root[j, j]
    return True


@compiled
def carry_companions(f: Record, dt: float, cross: Array) -> None:
    """Take a step of ``dt`` s: the biases walk, and the step has a noise of its own.

    ``cross`` (18, 6) is the covariance of the error state after the step with the biases before it.
    """
    imu = f.imu
    walk = dt / f.period
    all_cross = np.empty((N, COMPANIONS))
    joint = np.zeros((COMPANIONS, COMPANIONS))
    for i in range(BIASES):
        for j in range(BIASES):
            joint[i, j] = imu.bias_covariance[i, j]
        joint[i, i] += walk * imu.walk[i]
        joint[BIASES + i, BIASES + i] = 1.0
        imu.mean[BIASES + i] = 0.0
        for j in range(N):
            all_cross[j, i] = cross[j, i]
            # one standard deviation of each input, as ``add_noise`` leaves them
            all_cross[j, BIASES + i] = f.B[i, j]
    # the accelerations of the same, in body axes: velocity is rows 9-11
    R = f.centre_rotation
    for i in range(3):
        for n in range(6):
            total = 0.0
            for j in range(3):
                total += R[j, i] * f.B[n, 9 + j]
            imu.sensitivity[3 + i, BIASES + n] = total / dt
        imu.sensitivity[i, i] = 1.0
        imu.sensitivity[3 + i, 3 + i] = 1.0
    split(f, all_cross, joint)
    imu.known = 1
    for s in range(2):
        if imu.doubt[s] >= 0.0:
            imu.doubt[s] += dt


@compiled
def carry_with_points(f: Record, dt: float, cross: Array) -> Array:
    """Return ``cross`` (18, n), the covariance of the error state with something constant, carried
    over the unscented prediction that was just made.

    A constant beside the state is a further row of the root. Its entries in the columns that were
    drawn as pairs of points go with half the difference of the pair; the others with the linear
    part of the model.
    """
    S, H = f.S, f.H
    pairs = 6 if f.wrench_count == 0 else 12
    n = cross.shape[1]
    rows, rest = np.empty((pairs, n)), cross.copy()
    for j in range(pairs):
        for m in range(n):
            rows[j, m] = rest[j, m] / S[j, j]
        for i in range(j, N):
            for m in range(n):
                rest[i, m] -= S[j, i] * rows[j, m]
    for i in range(6, pairs):
        for m in range(n):
            rest[i, m] = 0.0
    out = np.empty((N, n))
    carry_rows(f, dt, rest[6:], out)
    for j in range(pairs):
        for i in range(N):
            a = H[j, i]
            for m in range(n):
                out[i, m] += a * rows[j, m]
    return out


@compiled
def carry_with_jacobian(f: Record, dt: float, cross: Array) -> Array:
    """Return the same for the prediction of ``ekf.py``, which leaves the first rows of F - 1 in
    ``f.S``.
    """
    out: Array = cross + np.concatenate((f.S @ cross, np.zeros((N - 12, cross.shape[1]))))
    return out


@compiled
def correct_companions(f: Record, before: Array) -> None:
    """Move the companions with a correction of the error state by a pose; ``before`` (20,) is the
    state before it.
    """
    imu, error = f.imu, np.empty(N)
    error_from(f.x, before, error)
    for j in range(COMPANIONS):
        total = 0.0
        for i in range(N):
            total += imu.regression[i, j] * error[i]
        imu.mean[j] += total
    cross = cross_covariance(f, BIASES)
    for i in range(BIASES):
        for j in range(BIASES):
            total = imu.rest[i, j]
            for k in range(N):
                total += imu.regression[k, i] * cross[k, j]
            imu.bias_covariance[i, j] = total


def joint_covariance(f: np.void) -> Array:
    """Return the covariance (24, 24) of the error state and the biases of gyro and
    accelerometer.
    """
    imu = f["imu"]
    T, out = imu["regression"][:, :BIASES], np.empty((N + BIASES, N + BIASES))
    out[:N, :N] = f["P"]
    out[:N, N:] = f["P"] @ T
    out[N:, :N] = out[:N, N:].T
    out[N:, N:] = T.T @ out[:N, N:] + imu["rest"][:BIASES, :BIASES]
    return out
