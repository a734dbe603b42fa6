"""Sensing: estimators of the external force and torque on a quadrotor, and how to check that they
are consistent.
"""

from ..runtime.prompt import public
from .constant_gain import ConstantGainFilter
from .ekf import WrenchEKF
from .estimate import WrenchEstimate
from .late_poses import TimedFilter
from .noise_fit import NoiseFit, NoiseFitSettings, fit_noise
from .recovery import Recovery
from .smoother import RecordingUKF
from .tuning import UKFTuning
from .ukf import WrenchUKF
from .ukf_batch import WrenchUKFBatch

__all__ = [
    "ConstantGainFilter",
    "NoiseFit",
    "NoiseFitSettings",
    "RecordingUKF",
    "Recovery",
    "TimedFilter",
    "UKFTuning",
    "WrenchEKF",
    "WrenchEstimate",
    "WrenchUKF",
    "WrenchUKFBatch",
    "fit_noise",
]

__dir__ = public(__all__, globals())
