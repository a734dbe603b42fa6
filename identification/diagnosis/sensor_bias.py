"""The bias of an accelerometer, which a regression on its readings must allow for.

A fusion takes out what it knows of it; what is left, three numbers a flight, is fitted beside the
effects. So a steady force along the body is told from a bias only where attitude, thrust or the
force itself changes.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


PREFIX = "accelerometer bias "


def bias_columns(count: int) -> list[tuple[str, str]]:
    """Return the columns of the biases of ``count`` flights."""
    return [("", f"{PREFIX}{axis} {i}") for i in range(count) for axis in "xyz"]


def flight_and_axis(name: str) -> tuple[int, int]:
    """Return the flight and the axis of a bias, by its name."""
    axis, flight = name.removeprefix(PREFIX).split(" ")
    return int(flight), "xyz".index(axis)


def bias(setting: Mapping[str, Mapping[str, float]], flight: int) -> Array:
    """Return the bias (3,) m/s2, body, of a flight at a setting."""
    own = setting.get("", {})
    return np.array([own.get(f"{PREFIX}{axis} {flight}", 0.0) for axis in "xyz"])


def biases(setting: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return what of a setting is bias: the sensors' and not the model's."""
    own = {k: v for k, v in setting.get("", {}).items() if k.startswith(PREFIX)}
    return {"": own} if own else {}
