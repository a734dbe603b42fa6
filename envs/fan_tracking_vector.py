"""Many fan-tracking environments, by the plant that they fly."""

from typing import Any

from ..runtime.errors import unknown_name
from .lanes.vector import FanTrackingLanes
from .vector import FanTrackingVectorEnv

PLANTS: dict[str, type[FanTrackingVectorEnv]] = {
    "mujoco": FanTrackingVectorEnv,
    "lanes": FanTrackingLanes,
}


def make_fan_tracking_vector(
    num_envs: int = 1, plant: str = "mujoco", **kwargs: Any
) -> FanTrackingVectorEnv:
    """Return ``num_envs`` fan-tracking environments side by side.

    Args:
        num_envs: how many.
        plant: ``"mujoco"``, the reference (``FanTrackingVectorEnv``), or ``"lanes"``, the same
            flight in the lanes of a vector unit (``FanTrackingLanes``): several times as fast.
        **kwargs: of the class.

    Raises:
        InputError: an unknown plant, or what the class refuses.
    """
    if plant not in PLANTS:
        raise unknown_name("plant", str(plant), PLANTS, "FanTracking: plant")
    return PLANTS[plant](num_envs, **kwargs)


__all__ = ["PLANTS", "make_fan_tracking_vector"]
