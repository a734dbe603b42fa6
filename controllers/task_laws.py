"""The laws of each task but ``FanTracking``, with gains found by search, ``task_gains.yaml``; the
file says how.
"""

from collections.abc import Callable
from functools import partial
from importlib import resources
from typing import Any

import yaml

from ..runtime.errors import unknown_name
from .fan_laws import Admittance2D, Hover2D, Oracle2D, Ratio2D
from .wind_laws import INDI, PID, FlightLoopAlone, L1Adaptive, PIDWithForce, WindOracle

_WIND: dict[str, Callable[..., Any]] = {
    "hover": FlightLoopAlone,
    "pid": PID,
    "pid-force": PIDWithForce,
    "indi": INDI,
    "l1": L1Adaptive,
    "oracle": WindOracle,
}
TASK_LAWS: dict[str, dict[str, Callable[..., Any]]] = {
    "FanTracking2D": {
        "hover": Hover2D,
        "admittance": Admittance2D,
        "ratio": Ratio2D,
        "oracle": Oracle2D,
    },
    "WindHover": _WIND,
    "WindTrajectory": _WIND,
}


# tasks that are flown with the gains of another where the file has none of their own
_AS = {"WindTrajectory": "WindHover"}


def task_gains() -> dict[str, dict[str, dict[str, Any]]]:
    """Return the gains found by search: task, law, and then ``gains`` and how they were found."""
    text = (resources.files(__package__) / "task_gains.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text) or {}


def make_task_law(name: str, task: str) -> Any:
    """Return a new law of a task by its name, with the gains that were found for it.

    Raises:
        InputError: no task or no law has this name.
    """
    if task not in TASK_LAWS:
        raise unknown_name("task", task, TASK_LAWS)
    laws = TASK_LAWS[task]
    if name not in laws:
        raise unknown_name("controller", name, laws)
    known = task_gains()
    found = known.get(task, {}).get(name) or known.get(_AS.get(task, ""), {}).get(name, {})
    return partial(laws[name], **found.get("gains", {}))()
