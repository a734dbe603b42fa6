"""Worlds: the plant in MuJoCo, the fan and its jet, winds, and the four tasks."""

from ..runtime.prompt import public
from . import headless  # noqa: F401  before anything that imports MuJoCo
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

__dir__ = public(__all__, globals())
