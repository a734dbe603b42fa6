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

``core/imu.hpp`` takes the measurements in. The functions here are for the export to C.
"""

import math

import numpy as np

from ..dynamics.model import apply_effects
from ..dynamics.motion import accelerations
from ..dynamics.rotation import quaternion_to_matrix
from ..runtime.compiled import Record, compiled
from .bias_states import restore_bias_prior
from .covariance import divide, root_of
from .estimate import NIS, Array
from .filter_record import AGREEING

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
