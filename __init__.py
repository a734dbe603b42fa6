"""windwrench: a quadrotor that feels the wind.

Importing the package registers the environment ``windwrench/FanTracking-v0`` with Gymnasium.
"""

from .runtime.interrupts import is_command, leaving_at_once

with leaving_at_once(is_command()):
    import gymnasium

    from .runtime.moved_modules import keep_old_paths

__version__ = "0.1.0"

if (
    "windwrench/FanTracking-v0" not in gymnasium.registry
):  # pytest imports this file a second time, as a folder's
    gymnasium.register(
        id="windwrench/FanTracking-v0",
        entry_point="windwrench.envs.fan_tracking:FanTrackingEnv",
        vector_entry_point="windwrench.envs.vector:FanTrackingVectorEnv",
        max_episode_steps=250,
    )

keep_old_paths()
