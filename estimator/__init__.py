"""Sensing: estimators of the external force and torque on a quadrotor, and how to check that they
are consistent.
"""

from .constant_gain import ConstantGainFilter
from .ekf import WrenchEKF
from .estimate import WrenchEstimate, WrenchEstimator
from .late_poses import TimedFilter
from .mass_ukf import WrenchMassUKF
from .observer import NonlinearObserver, ObserverTuning
from .recovery import Recovery
from .tuning import UKFTuning
from .ukf import WrenchUKF
from .ukf_batch import WrenchEstimates, WrenchUKFBatch

__all__ = [
    "ConstantGainFilter",
    "NonlinearObserver",
    "ObserverTuning",
    "Recovery",
    "TimedFilter",
    "UKFTuning",
    "WrenchEKF",
    "WrenchEstimate",
    "WrenchEstimates",
    "WrenchEstimator",
    "WrenchMassUKF",
    "WrenchUKF",
    "WrenchUKFBatch",
]
