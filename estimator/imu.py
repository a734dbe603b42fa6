"""Gyro and accelerometer as further measurements of the same filter.

The paper says that it "can easily be extended to GPS and IMU". A gyro measures the body rate and
its bias. An accelerometer at the geometric centre measures its bias and the specific force ``R' (a
+ g)``, ``a`` being the acceleration (4) over the last step. The accelerometer sees the external
force at once, a pose only after two integrations. The rotor model's error in that step
(``thrust_noise``) is in the specific force and in the velocity. So the error is a state of its own
until the next step (``bias_states``).

An accelerometer says nothing of the external force while the rotors' is unknown: before the first
prediction, and between a restart and the next one, the gyro alone is taken in. A gyro measures the
rate after the step, torque noise included.
"""

import math

import numpy as np

from ..dynamics.model import apply_effects
from ..dynamics.motion import accelerations
from ..dynamics.rotation import quaternion_to_matrix
from ..runtime.compiled import Record, compiled
from .bias_states import bound_biases, cross_covariance, restore_bias_prior, split
from .covariance import divide, root_of
from .error_state import displace, fold, symmetrise
from .estimate import NIS, Array
from .filter_record import AGREEING, COMPANIONS, N

# s of nothing but refusals after which a sensor's bias is no longer believed: longer than the burst
# of vibration of a touch-down
_PATIENCE = 0.5


@compiled
def expected_imu(f: Record, x: Array, out: Array) -> None:
    """Write what gyro and accelerometer without bias would measure in a state ``x`` into ``out``
    (6,).
    """
    R = f.rotation
    quaternion_to_matrix(x[3:7], R)
    apply_effects(f, x[0:3], R, x[7:10], x[10:13])
    accelerations(
        f.body, R, x[10:13], f.rotor_wrench, x[13:16], x[16:19], f.effect_wrench, f.acceleration
    )
    a = f.acceleration
    for i in range(3):
        out[i] = x[10 + i]
        out[3 + i] = R[0, i] * a[0] + R[1, i] * a[1] + R[2, i] * (a[2] + f.body.gravity)


@compiled
def take_in_imu(record: Record, z: Array, gyro: bool, accelerometer: bool) -> None:
    """Correct with the measured parts of ``z`` (6,), gyro and accelerometer, unless the gate
    refuses them: (29)-(37) with the 37 sigma points of the error state; biases and noise are linear
    in it.
    """
    f = record[0]
    x, imu = f.x, f.imu
    x[NIS] = math.nan
    first, last = 0 if gyro else 3, 6 if accelerometer and imu.known > 0 else 3
    if first >= last:
        return
    C, T = imu.sensitivity, imu.regression
    root = root_of(f.P)
    covariance, innovation, pairs = _innovation(f, z, root, T.T @ root)
    # of the error state and of the companions with what is measured
    cross = root @ pairs
    companions = T.T @ cross + imu.rest @ C.T
    covariance += C @ imu.rest @ C.T
    covariance += np.diag(f.imu_noise)
    innovation -= C @ imu.mean
    x[NIS] = _nis(covariance, innovation, first, last)
    first, last = _believed(f, covariance, innovation, first, last)
    if first < last:
        _correct(f, covariance, innovation, cross, companions, first, last)


@compiled
def _innovation(f: Record, z: Array, root: Array, turned: Array) -> tuple[Array, Array, Array]:
    """Return the error state's part of the innovation's covariance (6, 6), the innovation (6,)
    without the companions' mean, and the scaled half differences (18, 6) of pairs.

    ``turned`` (12, 18): the companions along each column of the root.
    """
    x, C = f.x, f.imu.sensitivity
    spread, weight = math.sqrt(N + f.kappa), 0.5 / (N + f.kappa)  # (28)
    centre, plus, minus = np.empty(6), np.empty((N, 6)), np.empty((N, 6))
    expected_imu(f, x, centre)
    columns = root.T.copy()
    for j in range(N):
        displace(x, columns[j], spread, f.rho, f.q, f.point)
        expected_imu(f, f.point, plus[j])
        displace(x, columns[j], -spread, f.rho, f.q, f.point)
        expected_imu(f, f.point, minus[j])
    half, second = 0.5 * (plus - minus) / spread, plus + minus - 2.0 * centre
    pairs = half + turned.T @ C.T
    mean = weight * np.sum(second, axis=0)
    # with a pair of deviations p and m: pp' + mm' = ((p - m)(p - m)' + (p + m)(p + m)') / 2, and
    # 2 weight spread^2 = 1
    S = pairs.T @ pairs + 0.5 * weight * (second.T @ second) - np.outer(mean, mean)
    return S, z - centre - mean, pairs


@compiled
def _nis(covariance: Array, innovation: Array, first: int, last: int) -> float:
    y = divide(root_of(covariance[first:last, first:last]), innovation[first:last].reshape(-1, 1))
    nis: float = np.sum(y * y)
    return nis


@compiled
def _believed(
    f: Record, covariance: Array, innovation: Array, first: int, last: int
) -> tuple[int, int]:
    """Return the rows that the gate lets in. One of two sensors that are unlikely together may be
    right: a saturated accelerometer does not cost the gyro.
    """
    imu, gate = f.imu, f.imu.gate
    if f.x[NIS] <= gate[1 if last - first == 6 else 0]:
        for s in range(first // 3, last // 3):
            imu.doubt[s] = -1.0
        if last == 6:
            imu.in_row = 0
        return first, last
    gyro = _nis(covariance, innovation, 0, 3) if first == 0 else math.inf
    accelerometer = _nis(covariance, innovation, 3, 6) if last == 6 else math.inf
    pushed = last == 6 and accelerometer > gate[0] and _is_push(f, covariance, innovation)
    if last == 6 and accelerometer <= gate[0]:
        imu.in_row = 0
    # unlikely only together: the likelier of the two
    take_gyro = gyro <= gate[0] and (pushed or gyro < accelerometer)
    take_accelerometer = pushed or (accelerometer <= gate[0] and not take_gyro)
    begin, end = 0 if take_gyro else 3, 6 if take_accelerometer else 3
    if end - begin < last - first:
        imu.refused += 1
    for s in range(first // 3, last // 3):
        if begin <= 3 * s and 3 * s < end:
            imu.doubt[s] = -1.0
        elif imu.doubt[s] < 0.0:
            imu.doubt[s] = 0.0
        elif imu.doubt[s] > _PATIENCE:
            restore_bias_prior(f, 3 * s)
            imu.doubt[s] = 0.0
            # the innovation at hand is that of the old bias
            return first, first
    return begin, end


@compiled
def _is_push(f: Record, covariance: Array, innovation: Array) -> bool:
    """Return whether the accelerometer samples that were unlikely in a row are a push: far from
    what the filter expects, by no more than two weights, and no farther from each other than noise
    alone makes them. Vibration does not agree with itself, and a saturated sensor is too far.
    """
    imu = f.imu
    imu.unlikely[imu.in_row % AGREEING] = innovation[3:]
    imu.in_row += 1
    if imu.in_row < AGREEING:
        return False
    mean = np.sum(imu.unlikely, axis=0) / AGREEING
    if np.any(np.abs(mean) > 2.0 * f.body.gravity):
        return False
    apart = (imu.unlikely - mean).T
    whitened = divide(root_of(covariance[3:6, 3:6]), apart)
    agreed: bool = np.sum(whitened * whitened) <= imu.gate[2]
    return agreed


@compiled
def _correct(
    f: Record,
    covariance: Array,
    innovation: Array,
    cross: Array,
    companions: Array,
    first: int,
    last: int,
) -> None:
    """Update error state and companions with rows ``first`` to ``last`` of the innovation."""
    x, P, imu = f.x, f.P, f.imu
    root = root_of(covariance[first:last, first:last])
    W = divide(root, np.ascontiguousarray(cross[:, first:last].T))
    V = divide(root, np.ascontiguousarray(companions[:, first:last].T))
    y = divide(root, innovation[first:last].reshape(-1, 1))
    covariances = cross_covariance(f, COMPANIONS)
    T = imu.regression
    joint = T.T @ covariances + imu.rest - V.T @ V
    covariances -= W.T @ V
    P -= W.T @ W
    symmetrise(P)
    f.centre[:NIS] = x[:NIS]
    fold(f, f.centre, (W.T @ y)[:, 0])
    imu.mean[:] += (V.T @ y)[:, 0]
    bound_biases(f)
    split(f, covariances, joint)
