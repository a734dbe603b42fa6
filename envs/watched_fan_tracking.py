"""The fan-tracking environment with more in ``info``: what else an agent could be given to see."""

from typing import Any

import numpy as np

from .fan_tracking import FanTrackingEnv

TRUTH = frozenset({"force", "torque"})  # what every environment's ``info`` holds


class SensingFanTracking(FanTrackingEnv):
    """``FanTrackingEnv`` with more in ``info``.

    ``std_force``, ``std_torque``: the filter's standard deviations (3,) N and Nm.
    """

    def _get_info(self) -> dict[str, Any]:
        info = super()._get_info()
        std = np.sqrt(np.diagonal(self.loop.covariance)[12:18])
        info["std_torque"], info["std_force"] = std[:3].copy(), std[3:].copy()
        return info


def scenario_env(
    scenario: str, sources: frozenset[str] = frozenset(), estimator: str = "ukf"
) -> FanTrackingEnv:
    """Return a scenario's environment, with what a policy must find in its ``info``.

    Args:
        scenario: name.
        sources: what ``info`` must hold, as ``controllers.features.Features.sources`` names it.
        estimator: ``ukf``, or ``constant-gain``, its fast stand-in.

    Raises:
        InputError: a name that does not exist.
    """
    if not sources - TRUTH:
        return FanTrackingEnv(scenario, estimator=estimator)
    return SensingFanTracking(scenario, estimator=estimator)
