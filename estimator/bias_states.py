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
Kirubarajan, 2001, section 8.2.1). ``core/bias_states.hpp`` carries them.
"""

import numpy as np

from ..runtime.compiled import Record, compiled
from .estimate import Array
from .filter_record import AGREEING, BIASES
from .recovery import largest_nis
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
        imu["gate"] = largest_nis(gate, 3, 6, 3 * (AGREEING - 1))


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


def joint_covariance(f: np.void) -> Array:
    """Return the covariance (24, 24) of the error state and the biases of gyro and
    accelerometer.
    """
    imu = f["imu"]
    regression = imu["regression"][:, :BIASES]
    cross = f["P"] @ regression
    biases = regression.T @ cross + imu["rest"][:BIASES, :BIASES]
    return np.block([[f["P"], cross], [cross.T, biases]])
