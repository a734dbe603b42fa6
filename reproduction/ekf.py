"""The plain relative of the wrench filter: an error-state extended Kalman filter on the same model.

State, noise, measurement and tuning are those of ``WrenchUKF``. Only the prediction of the
covariance differs: ``F P F' + B Q B'`` with the Jacobian F of the model at the estimate.
"""

from .. import _core
from ..estimator.ukf import WrenchUKF


class WrenchEKF(WrenchUKF):
    """``WrenchUKF``, linearised; without IMU, and without the vehicle's stated uncertainty."""

    _step_at = staticmethod(_core.step_extended)
    _step_address = staticmethod(_core.step_extended_address)
    _no_imu = "this filter takes no inertial measurements"
