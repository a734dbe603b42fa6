"""Worlds: the plant in MuJoCo, the fan and its jet, winds, and the four tasks."""

from . import display  # noqa: F401  before anything that imports MuJoCo
from .actions import ACTIONS
from .closed_loop import ClosedLoop, Stage
from .fan import Fan
from .fan_tracking import FanTrackingEnv
from .fan_tracking_2d import FanTracking2DEnv
from .observations import OBSERVATIONS
from .scenarios import SCENARIOS, Scenario
from .state import Start, State
from .task import Task
from .wind_tasks import WindHoverEnv, WindTrajectoryEnv

__all__ = [
    "ACTIONS",
    "OBSERVATIONS",
    "SCENARIOS",
    "ClosedLoop",
    "Fan",
    "FanTracking2DEnv",
    "FanTrackingEnv",
    "Scenario",
    "Stage",
    "Start",
    "State",
    "Task",
    "WindHoverEnv",
    "WindTrajectoryEnv",
]


def __dir__() -> list[str]:
    return __all__
