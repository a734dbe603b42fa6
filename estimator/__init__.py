"""Sensing: estimators of the external force and torque on a quadrotor, and how to check that they are consistent."""

from .ekf import WrenchEKF
from .estimate import WrenchEstimate, WrenchEstimator
from .mass_ukf import WrenchMassUKF
from .observer import NonlinearObserver, ObserverTuning
from .tuning import UKFTuning
from .ukf import WrenchUKF

__all__ = [
    "NonlinearObserver", "ObserverTuning", "UKFTuning", "WrenchEKF", "WrenchEstimate", "WrenchEstimator", "WrenchMassUKF",
    "WrenchUKF",
]
