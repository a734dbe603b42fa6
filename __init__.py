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

__version__ = "2.0.0"
# rooms that are imported when they are asked for
__all__ = ["__version__", "controllers", "dynamics", "envs", "estimator", "identification"]

# module and class of each task, function that makes many, and decisions of 20 s
_TASKS = {  # pytest imports this file a second time, as a folder's
    "FanTracking": ("fan_tracking", "FanTrackingEnv", "fan_tracking_vector", 250),
    "FanTracking2D": ("fan_tracking_2d", "FanTracking2DEnv", "fan_tracking_2d_vector", 250),
    "WindHover": ("wind_tasks", "WindHoverEnv", "wind_hover_vector", 500),
    "WindTrajectory": ("wind_tasks", "WindTrajectoryEnv", "wind_trajectory_vector", 500),
}
for _name, (_module, _single, _vector, _steps) in _TASKS.items():
    _own = f"{_module}:{_single}", f"{_module}:{_vector}"
    for _version, _entries, _most, _given in (
        (2, _own, None, {"normalize": True, "observation": "wrench"}),
        (1, _own, _steps, {"normalize": True}),
        (0, ("aliases:make_single", "aliases:make_many"), _steps, {"task": _name}),
    ):
        if f"windwrench/{_name}-v{_version}" not in gymnasium.registry:
            gymnasium.register(
                id=f"windwrench/{_name}-v{_version}",
                entry_point=f"windwrench.envs.{_entries[0]}",
                vector_entry_point=f"windwrench.envs.{_entries[1]}",
                max_episode_steps=_most,
                kwargs=_given,
            )
# earlier versions stay as they are, and the alias says more
warnings.filterwarnings("ignore", r".*windwrench/\w+-v[01] is out of date", DeprecationWarning)


def __getattr__(name: str) -> Any:
    if name in __all__:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
