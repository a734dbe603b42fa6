"""windwrench: a quadrotor that feels the wind.

Importing the package registers its environments with Gymnasium: ``windwrench/FanTracking-v0``,
``windwrench/FanTracking2D-v0``, ``windwrench/WindHover-v0`` and ``windwrench/WindTrajectory-v0``.
"""

from .runtime.interrupts import is_command, leaving_at_once

with leaving_at_once(is_command()):
    import gymnasium

__version__ = "1.0.0"

_TASKS = {  # pytest imports this file a second time, as a folder's
    "FanTracking": (
        "fan_tracking:FanTrackingEnv",
        "lanes.vector:make_fan_tracking_vector",
        250,
    ),
    "FanTracking2D": ("fan_tracking_2d:FanTracking2DEnv", None, 250),
    "WindHover": ("wind_tasks:WindHoverEnv", None, 500),
    "WindTrajectory": ("wind_tasks:WindTrajectoryEnv", None, 500),
}
for _name, (_single, _vector, _steps) in _TASKS.items():
    if f"windwrench/{_name}-v0" not in gymnasium.registry:
        gymnasium.register(
            id=f"windwrench/{_name}-v0",
            entry_point=f"windwrench.envs.{_single}",
            vector_entry_point=f"windwrench.envs.{_vector}" if _vector else None,
            max_episode_steps=_steps,
        )
