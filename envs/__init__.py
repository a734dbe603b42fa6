"""Worlds: the plant in MuJoCo, the fan and its jet, and the fan-tracking environment."""

from . import headless  # noqa: F401  before anything that imports MuJoCo
from .copies import Copyable
from .fan import Fan
from .fan_tracking import FanTrackingEnv
from .scenarios import SCENARIOS, Scenario

__all__ = ["SCENARIOS", "Copyable", "Fan", "FanTrackingEnv", "Scenario"]
