"""The controllers of each task by name: designed laws, tuned gains (``tuned.yaml``, with scenario
and command), and the kit's trained policies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib import resources
from pathlib import Path
from typing import Any, Protocol

from ..runtime.arrays import Floats
from ..runtime.errors import unknown_name
from ..runtime.python_file import is_file_name
from ..runtime.yaml_file import read_yaml
from .fan_laws import Admittance, AdmittancePID, Hover, Lead, Ratio
from .law_file import is_law_file, read_law
from .lqg import LQG
from .own_file import load_controller
from .preview import Oracle, WindOracle
from .tracker import InformedTracker, Limit, Tracker, TrackerLQG
from .wind_laws import INDI, PID, FlightLoopAlone, L1Adaptive, PIDWithForce, PIDWithWrench

STANDARD_TASK = "FanTracking"
STANDARD_SCENARIO = "base"  # whose gains a law called no more than tuned has


class Controller(Protocol):
    """Turns an observation into a command; ``info`` is the environment's, for controllers that read
    true values.

    A method ``brief(briefing)`` gets vehicle, sensors and fan (``controllers.briefing.Briefing``)
    before ``reset``. A controller without a memory needs no ``reset``.
    """

    def reset(self) -> None:
        """Forget the last episode."""
        ...

    def __call__(self, observation: Floats, info: Mapping[str, Any] | None = None) -> Floats:
        """Return the command (1,) m/s for an observation (8,)."""
        ...


Laws = dict[str, Callable[..., Any]]


@cache
def tuned_gains(task: str = STANDARD_TASK) -> dict[str, dict[str, Any]]:
    """Return a task's tuned gains: law, of FanTracking also scenario, and then ``gains`` and how
    they were found.
    """
    sections: dict[str, dict[str, dict[str, Any]]] = read_yaml(
        Path(__file__).with_name("tuned.yaml"), "tuned gains"
    )
    if task != STANDARD_TASK:
        return sections.get(task, {})
    return {law: entries for law, entries in sections.items() if law in LAWS}


def _tuned() -> Laws:
    """Return ``LAW-tuned`` (for the scenario base) and ``LAW-tuned-SCENARIO`` of FanTracking."""
    return {
        f"{law}-tuned" + ("" if scenario == STANDARD_SCENARIO else f"-{scenario}"): partial(
            LAWS[law], **entry["gains"]
        )
        for law, scenarios in tuned_gains().items()
        for scenario, entry in scenarios.items()
    }


# designed laws of FanTracking with gains that can be tuned
LAWS: Laws = {
    "admittance": Admittance,
    "ratio": Ratio,
    "lead": Lead,
    "admittance-pid": AdmittancePID,
    "tracker": Tracker,
    "tracker-informed": InformedTracker,
}
CONTROLLERS: Laws = {
    "hover": Hover,
    **LAWS,
    "tracker-lqg": TrackerLQG,
    "limit": Limit,
    "oracle": Oracle,
    **_tuned(),
}
_WIND: Laws = {
    "hover": FlightLoopAlone,
    "pid": PID,
    "pid-force": PIDWithForce,
    "pid-wrench": PIDWithWrench,
    "indi": INDI,
    "l1": L1Adaptive,
    "lqg": LQG,
    "oracle": WindOracle,
}
TASK_LAWS: dict[str, Laws] = {
    STANDARD_TASK: CONTROLLERS,
    "FanTracking2D": {
        "hover": partial(Hover, axes=2),
        "admittance": partial(Admittance, gain_z=18.0),
        "ratio": partial(Ratio, gain_z=8.0),
        "oracle": partial(Oracle, axes=(1, 2)),
    },
    "WindHover": _WIND,
    "WindTrajectory": _WIND,
}
# laws of a user's own by name, for every task: ``OWN_LAWS["me/gentle"] = Gentle``
OWN_LAWS: Laws = {}
# tasks that are flown with the gains of another where the file has none of their own
_AS = {"WindTrajectory": "WindHover"}


def make_controller(name: str, task: str = STANDARD_TASK) -> Any:
    """Return a new ``Controller`` of a task by its name, by a law's YAML file, or of a
    Python file (``FILE.py:CLASS``). In tasks other than FanTracking a law has its tuned gains,
    if any; a file's gains replace them.

    Raises:
        InputError: no task or no controller has this name, or a file holds none.
    """
    if is_file_name(name):
        return load_controller(name)
    if task not in TASK_LAWS:
        raise unknown_name("task", task, TASK_LAWS)
    laws = OWN_LAWS | TASK_LAWS[task]
    gains: dict[str, Any] = {}
    if is_law_file(name):
        stated = read_law(name, task, laws)
        name, gains = stated.law, stated.gains
    if name not in laws:
        raise unknown_name("controller", name, [*laws, *shipped_policies(task)])
    if task == STANDARD_TASK:
        return laws[name](**gains)
    entry = tuned_gains(task).get(name) or tuned_gains(_AS.get(task, task)).get(name, {})
    return laws[name](**{**entry.get("gains", {}), **gains})


@cache
def shipped_policies(task: str = STANDARD_TASK) -> dict[str, Path]:
    """Return the file of each installed policy of a task, sorted by name. A wheel has one seed of
    each kind, a checkout all.
    """
    folder = Path(str(resources.files(__package__))).parent / "training" / "policies"
    start = "" if task == STANDARD_TASK else f"{task}-"
    files = (folder / "tasks" if start else folder).glob(f"{start}*.npz")
    weights = (path for path in files if path.with_suffix(".json").exists())
    return {path.stem.removeprefix(start): path for path in sorted(weights)}
