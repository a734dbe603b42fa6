"""windwrench: a quadrotor that feels the wind.

Importing the package registers its environments with Gymnasium: ``windwrench/FanTracking``,
``FanTracking2D``, ``WindHover`` and ``WindTrajectory``, each as ``-v1``: normalised, for learners,
or with ``normalize=False`` in SI units, for designed laws. ``-v0`` is the latter's id until 3.0.
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
    for _version, _entry, _vector_entry, _given in (
        (1, _single, f"lanes.vector:{_vector}", {"normalize": True}),
        (0, "aliases:make_single", "aliases:make_many", {"task": _name}),
    ):
        if f"windwrench/{_name}-v{_version}" not in gymnasium.registry:
            gymnasium.register(
                id=f"windwrench/{_name}-v{_version}",
                entry_point=f"windwrench.envs.{_entry}",
                vector_entry_point=f"windwrench.envs.{_vector_entry}",
                max_episode_steps=_steps,
                kwargs=_given,
            )
# the alias says more
warnings.filterwarnings("ignore", r".*windwrench/\w+-v0 is out of date", DeprecationWarning)


def __getattr__(name: str) -> Any:
    if name in __all__:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
