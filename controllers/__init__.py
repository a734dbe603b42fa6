"""Acting: the inner flight loop, and controllers from the estimated wrench to a velocity."""

from ..runtime.prompt import public
from .fan_laws import Admittance, AdmittancePID, Hover, Lead, Ratio
from .preview import Oracle
from .registry import CONTROLLERS, LAWS, Controller, make_controller
from .tracker import InformedTracker, Limit, Tracker

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
    "make_controller",
]

__dir__ = public(__all__, globals())
