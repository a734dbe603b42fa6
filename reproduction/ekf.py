"""The plain relative of the wrench filter: an error-state extended Kalman filter on the same model.

State, noise, measurement and tuning are those of ``WrenchUKF``. Only the prediction of the
covariance differs: ``F P F' + B Q B'`` with the Jacobian F of the model at the estimate.
"""

import math
from functools import partial

from numba import carray

from ..estimator.covariance import add_noise, carry_by_jacobian
from ..estimator.error_state import symmetrise
from ..estimator.estimate import NIS, Array
from ..estimator.filter_record import FILTER, drive, propagate
from ..estimator.linear_model import model_jacobian
from ..estimator.recovery import after_prediction
from ..estimator.sample import check_sample, undo_sensing
from ..estimator.ukf import WrenchUKF, correct_parts
from ..runtime.addresses import address_of, pointer_to
from ..runtime.compiled import Record, compiled


@compiled
def _predict(f: Record, rotor_speeds: Array, dt: float, voltage: float) -> None:
    x = f.x
    drive(f, rotor_speeds, dt, voltage)
    propagate(f, x, dt, f.centre)
    model_jacobian(f, dt, f.S, True)
    carry_by_jacobian(f.P, f.S, f.H)
    add_noise(f, f.centre_rotation, dt)
    symmetrise(f.P)
    x[:NIS], x[NIS] = f.centre[:NIS], math.nan
    after_prediction(f, dt)
    f.time += dt


@compiled
def _step_at(address: int, parts: int, dt: float, voltage: float) -> int:
    f = carray(pointer_to(address), 1, FILTER)[0]
    usable: int = check_sample(f, f.z, parts)
    if usable >= 0:
        sample = undo_sensing(f, f.z, usable, dt)
        if dt > 0.0:
            _predict(f, sample[0:4], dt, voltage)
        correct_parts(f, sample, usable)
    return usable


class WrenchEKF(WrenchUKF):
    """``WrenchUKF``, linearised; without IMU, and without the vehicle's stated uncertainty."""

    _step_at = staticmethod(_step_at)
    _step_address = staticmethod(partial(address_of, _step_at.py_func))
    _no_imu = "this filter takes no inertial measurements"
