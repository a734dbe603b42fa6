"""Acting: the inner flight loop, and controllers from the estimated wrench to a velocity."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..runtime.errors import unknown_name
from .admittance import Admittance, Ratio
from .references import Hover, Oracle
from .tuned import tuned_controllers

__all__ = ["CONTROLLERS", "Admittance", "Controller", "Hover", "Oracle", "Ratio", "make_controller"]


class Controller(Protocol):
    """From an observation to a command; ``info`` is the environment's, for those that may see the
    truth.
    """

    def reset(self) -> None:
        """Forget the last episode."""
        ...

    def __call__(
        self, observation: NDArray[np.floating[Any]], info: Mapping[str, Any] | None = None
    ) -> NDArray[np.floating[Any]]:
        """Return the command (1,) m/s for an observation (8,)."""
        ...


CONTROLLERS: dict[str, Callable[[], Controller]] = {
    "hover": Hover,
    "admittance": Admittance,
    "ratio": Ratio,
    "oracle": Oracle,
    **tuned_controllers({"admittance": Admittance, "ratio": Ratio}),
}


def make_controller(name: str) -> Controller:
    """Return a new controller by its name.

    Raises:
        InputError: no controller has this name.
    """
    if name not in CONTROLLERS:
        raise unknown_name("controller", name, CONTROLLERS)
    return CONTROLLERS[name]()
