"""Worlds: the plant in MuJoCo, the fan and its jet, winds, and the four tasks."""

from . import display  # noqa: F401  before anything that imports MuJoCo
from .closed_loop import ClosedLoop, Stage
from .fan import Fan
from .fan_tracking import FanTrackingEnv
from .scenarios import SCENARIOS, Scenario

__all__ = [
    "SCENARIOS",
    "ClosedLoop",
    "Fan",
    "FanTrackingEnv",
    "Scenario",
    "Stage",
]


def __dir__() -> list[str]:
    return __all__
