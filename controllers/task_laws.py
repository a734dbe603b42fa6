"""The laws of each task but ``FanTracking``, with gains found by search (``tuned``)."""

from collections.abc import Callable
from functools import partial
from typing import Any

from ..runtime.errors import unknown_name
from .fan_laws import Admittance2D, Hover2D, Oracle2D, Ratio2D
from .tuned import tuned_gains
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
    found = tuned_gains(task).get(name) or tuned_gains(_AS.get(task, task)).get(name, {})
    return partial(laws[name], **found.get("gains", {}))()
