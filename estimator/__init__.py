"""Sensing: estimators of the external force and torque on a quadrotor, and their consistency."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .constant_gain import ConstantGainFilter
    from .estimate import WrenchEstimate
    from .late_poses import TimedFilter
    from .noise_fit import NoiseFit, NoiseFitSettings, fit_noise
    from .recovery import Recovery
    from .smoother import RecordingUKF
    from .tuning import UKFTuning
    from .ukf import WrenchUKF
    from .ukf_batch import WrenchUKFBatch

# modules of names, imported when they are asked for
_MODULES = {
    "ConstantGainFilter": "constant_gain",
    "NoiseFit": "noise_fit",
    "NoiseFitSettings": "noise_fit",
    "RecordingUKF": "smoother",
    "Recovery": "recovery",
    "TimedFilter": "late_poses",
    "UKFTuning": "tuning",
    "WrenchEstimate": "estimate",
    "WrenchUKF": "ukf",
    "WrenchUKFBatch": "ukf_batch",
    "fit_noise": "noise_fit",
}
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


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(f".{_MODULES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
