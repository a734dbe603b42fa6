"""Sensing: estimators of the external force and torque on a quadrotor, and how to check that they are consistent."""

from .estimate import WrenchEstimate, WrenchEstimator
from .tuning import UKFTuning
from .ukf import WrenchUKF

__all__ = ["UKFTuning", "WrenchEstimate", "WrenchEstimator", "WrenchUKF"]
