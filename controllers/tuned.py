"""Gains of the hand-designed laws found by search, ``tuned.yaml``; the file says for which scenario
and how.
"""

from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib import resources
from typing import Any

import yaml

# the scenario whose gains a law has that is called no more than tuned
STANDARD = "base"
# tasks that have a section of their own in the file; all else are laws of FanTracking
_SECTIONS = ("FanTracking2D", "WindHover", "WindTrajectory")


@cache
def _file() -> dict[str, dict[str, dict[str, Any]]]:
    text = (resources.files(__package__) / "tuned.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text) or {}


def tuned_gains(task: str = "FanTracking") -> dict[str, dict[str, Any]]:
    """Return what is known of a task's gains: law, of FanTracking also scenario, and then ``gains``
    and how they were found.
    """
    if task in _SECTIONS:
        return _file().get(task, {})
    return {law: found for law, found in _file().items() if law not in _SECTIONS}


def tuned_controllers(laws: Mapping[str, Callable[..., Any]]) -> dict[str, Callable[[], Any]]:
    """Return ``LAW-tuned`` (for the base scenario) and ``LAW-tuned-SCENARIO`` for all gains that
    are known.
    """
    return {
        f"{law}-tuned" + ("" if scenario == STANDARD else f"-{scenario}"): partial(
            laws[law], **found["gains"]
        )
        for law, scenarios in tuned_gains().items()
        for scenario, found in scenarios.items()
    }
