"""The inner flight loop, and controllers that turn the estimated wrench into commands."""

from .fan_laws import Admittance, AdmittancePID, Hover, Lead, Ratio
from .preview import Oracle
from .registry import CONTROLLERS, LAWS, Controller, make_controller
from .tracker import InformedTracker, Limit, Tracker, TrackerLQG

__all__ = [
    "CONTROLLERS",
    "LAWS",
    "Admittance",
    "AdmittancePID",
    "Controller",
    "Hover",
    "InformedTracker",
    "Lead",
    "Limit",
    "Oracle",
    "Ratio",
    "Tracker",
    "TrackerLQG",
    "make_controller",
]


def __dir__() -> list[str]:
    return __all__
