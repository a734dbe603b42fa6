"""Sensing: estimators of the external force and torque on a quadrotor, and their consistency."""

from .constant_gain import ConstantGainFilter
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
    "WrenchEstimate",
    "WrenchUKF",
    "WrenchUKFBatch",
    "fit_noise",
]


def __dir__() -> list[str]:
    return __all__
