"""The environment for RLlib."""

from typing import Any

from gymnasium.wrappers import TimeLimit

from ..envs.fan_tracking import FanTrackingEnv
from ..evaluation.episodes import DECISIONS
from ..runtime.extras import need


def register_with_rllib(name: str = "windwrench") -> None:
    """Make the environment known to RLlib:
    ``config.environment("windwrench", env_config={"scenario": "base"})``.
    """
    need("ray", "cluster")
    from ray.tune import register_env

    register_env(name, _make_for_rllib)


def _make_for_rllib(config: Any) -> Any:
    return TimeLimit(FanTrackingEnv(**config), DECISIONS)
