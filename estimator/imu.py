"""Gyro and accelerometer as further measurements of the same filter.

The paper's filter "can easily be extended to GPS and IMU". A gyro measures the body rate and
its bias. An accelerometer at the geometric centre measures its bias and the specific force ``R' (a
+ g)``, ``a`` being the acceleration (4) over the last step. The accelerometer sees the external
force at once, a pose only after two integrations. The rotor model's error in that step
(``thrust_noise``) is in the specific force and in the velocity. So the error is a state of its own
until the next step.

An accelerometer says nothing of the external force while the rotors' is unknown: before the first
prediction, and between a restart and the next one, the gyro alone is taken in. A gyro measures the
rate after the step, torque noise included.

Biases and the noise of the last step do not enter the dynamics. A bias walks on its own. The noise
of a step ends with the step. So both are kept beside the filter's error state e, as a regression on
e and a rest that is independent of e,

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
Kirubarajan, 2001, section 8.2.1). ``core/imu.hpp`` takes the measurements in,
``core/bias_states.hpp`` carries the companions.
"""

import numpy as np

from .estimate import Array
from .filter_record import AGREEING, BIASES
from .recovery import largest_nis
from .tuning import UKFTuning

_FARTHEST = 1e6  # largest NIS for which a linear correction means anything, gate or not


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


def joint_covariance(f: np.void) -> Array:
    """Return the covariance (24, 24) of the error state and the biases of gyro and
    accelerometer.
    """
    imu = f["imu"]
    regression = imu["regression"][:, :BIASES]
    cross = f["P"] @ regression
    biases = regression.T @ cross + imu["rest"][:BIASES, :BIASES]
    return np.block([[f["P"], cross], [cross.T, biases]])
