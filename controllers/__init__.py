"""Acting: the inner flight loop, and controllers from the estimated wrench to a velocity."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..runtime.errors import unknown_name
from .fan_laws import Admittance, AdmittancePID, Hover, Lead, Oracle, Ratio
from .tracker import InformedTracker, Limit, Tracker
from .tuned import tuned_controllers

__all__ = [
    "CONTROLLERS",
    "LAWS",
    "Admittance",
    "AdmittancePID",
    "Controller",
    "Hover",
    "InformedTracker",
    "Lead",
    "Limit",
    "Oracle",
    "Ratio",
    "Tracker",
    "make_controller",
]


class Controller(Protocol):
    """From an observation to a command; ``info`` is the environment's, for those that may see the
    truth.

    One that also has ``brief(briefing)`` is told what its vehicle, its sensors and the fan are
    (``controllers.briefing.Briefing``) before ``reset``.
    """

    def reset(self) -> None:
        """Forget the last episode."""
        ...

    def __call__(
        self, observation: NDArray[np.floating[Any]], info: Mapping[str, Any] | None = None
    ) -> NDArray[np.floating[Any]]:
        """Return the command (1,) m/s for an observation (8,)."""
        ...


# designed laws with gains that can be tuned
LAWS: dict[str, Callable[..., Controller]] = {
    "admittance": Admittance,
    "ratio": Ratio,
    "lead": Lead,
    "admittance-pid": AdmittancePID,
    "tracker": Tracker,
    "tracker-informed": InformedTracker,
}

CONTROLLERS: dict[str, Callable[[], Controller]] = {
    "hover": Hover,
    **LAWS,
    "limit": Limit,
    "oracle": Oracle,
    **tuned_controllers(LAWS),
}


def make_controller(name: str) -> Controller:
    """Return a new controller by its name.

    Raises:
        InputError: no controller has this name.
    """
    if name not in CONTROLLERS:
        raise unknown_name("controller", name, CONTROLLERS)
    return CONTROLLERS[name]()
