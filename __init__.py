"""windwrench: a quadrotor that feels the wind.

Importing the package registers its environments with Gymnasium: ``windwrench/FanTracking``,
``FanTracking2D``, ``WindHover`` and ``WindTrajectory``, each as ``-v0`` in SI units, for designed
laws, and as ``-v1`` normalised, for learners.
"""

import warnings
from importlib import import_module
from typing import Any

from .runtime.interrupts import is_command, leaving_at_once

with leaving_at_once(is_command()):
    import gymnasium

__version__ = "1.1.0"
# rooms that are imported when they are asked for
__all__ = ["__version__", "controllers", "dynamics", "envs", "estimator", "identification"]

_TASKS = {  # pytest imports this file a second time, as a folder's
    "FanTracking": ("fan_tracking:FanTrackingEnv", "make_fan_tracking_vector", 250),
    "FanTracking2D": ("fan_tracking_2d:FanTracking2DEnv", "make_fan_tracking_2d_vector", 250),
    "WindHover": ("wind_tasks:WindHoverEnv", "make_wind_hover_vector", 500),
    "WindTrajectory": ("wind_tasks:WindTrajectoryEnv", "make_wind_trajectory_vector", 500),
}
for _name, (_single, _vector, _steps) in _TASKS.items():
    for _version in (0, 1):
        if f"windwrench/{_name}-v{_version}" not in gymnasium.registry:
            gymnasium.register(
                id=f"windwrench/{_name}-v{_version}",
                entry_point=f"windwrench.envs.{_single}",
                vector_entry_point=f"windwrench.envs.lanes.vector:{_vector}",
                max_episode_steps=_steps,
                kwargs={"version": _version} if _version else {},
            )
# Gymnasium takes the older for outdated
warnings.filterwarnings("ignore", r".*windwrench/\w+-v0 is out of date", DeprecationWarning)


def __getattr__(name: str) -> Any:
    if name in __all__:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
