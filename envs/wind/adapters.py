"""The same wind in other simulators: PyFlyt and RotorPy. Neither is needed to make one.

Both ask for the wind at points of the world in m, z up, and take m/s, as these winds do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .field import Array, Wind


class PyFlytWind:
    """A wind as PyFlyt's ``WindFieldClass``: called with the time and positions (n, 3).

    ``Aviary(..., wind_type=pyflyt_wind_type(wind))``, or
    ``aviary.register_wind_field_function(PyFlytWind(wind))``.

    Args:
        wind: any.
        np_random: PyFlyt's generator, which is not used: a wind has a seed of its own.
    """

    def __init__(self, wind: Wind, np_random: np.random.Generator | None = None) -> None:
        self.wind, self.np_random = wind, np_random

    def __call__(self, time: float, position: ArrayLike) -> Array:
        """Return the wind (n, 3) m/s at positions (n, 3) m and a time in s."""
        return np.asarray(self.wind.velocity(position, float(time)), dtype=np.float64)


def pyflyt_wind_type(wind: Wind) -> Callable[..., Any]:
    """Return what PyFlyt's ``wind_type`` takes: a class whose objects are this wind.

    Where PyFlyt is installed the class counts as one of its ``WindFieldClass``.
    """

    class _Field(PyFlytWind):
        def __init__(self, np_random: np.random.Generator | None = None) -> None:
            super().__init__(wind, np_random)

    try:
        from PyFlyt.core.abstractions import WindFieldClass
    except ImportError:
        return _Field
    WindFieldClass.register(_Field)
    return _Field


class RotorPyWind:
    """A wind as RotorPy's ``wind_profile``: ``update(t, position)`` with one position (3,).

    Args:
        wind: any.
    """

    def __init__(self, wind: Wind) -> None:
        self.wind = wind

    def update(self, t: float, position: ArrayLike) -> Array:
        """Return the wind (3,) m/s at a position (3,) m and a time in s."""
        at = np.asarray(position, dtype=np.float64).reshape(1, 3)
        seen: Array = np.asarray(self.wind.velocity(at, float(t)), dtype=np.float64)[0]
        return seen
