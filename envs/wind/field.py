"""What a wind is, and how a flight evaluates one."""

import math
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...runtime.compiled import specialised
from ...runtime.errors import InputError

Array = NDArray[np.float64]


@runtime_checkable
class Wind(Protocol):
    """A velocity field of the air."""

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """Return the air's velocity (n, 3) m/s, world, at points (n, 3) m of the world and a time
        in s.
        """
        ...


class CompiledWind:
    """A wind of this room: a compiled function adds the air's velocity at many points.

    Args:
        function: compiled; takes ``given``, a time in s, points (3, n) m and velocities (3, n) m/s,
            to which it adds.
        *given: arrays, and records in arrays (1,).
    """

    def __init__(self, function: Callable[..., None], *given: np.ndarray) -> None:
        columns = np.zeros((3, 1))
        self._given = given
        self._function = specialised(function, *given, 0.0, columns, columns)

    def add(self, time: float, points: Array, velocities: Array) -> None:
        """Add the air's velocity at points (3, n) m to velocities (3, n) m/s."""
        self._function(*self._given, time, points, velocities)

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """Return the air's velocity (n, 3) m/s, world, at points (n, 3) m of the world and a time
        in s.

        Raises:
            InputError: points of another shape, or numbers that are not finite.
        """
        rows = check_points(points, time)
        out = np.zeros_like(rows)
        self.add(float(time), rows, out)
        return np.ascontiguousarray(out.T)

    def __add__(self, other: Wind) -> "Sum":
        return Sum(self, other)

    def __reduce__(self) -> Any:
        """Refuse to be copied or pickled: compiled code cannot be.

        Raises:
            InputError: always.
        """
        raise InputError(
            f"a wind ({type(self).__name__}) cannot be copied or pickled; make it anew from the "
            f"same arguments and seed: it is the same"
        )


class Sum(CompiledWind):
    """The sum of winds.

    Raises:
        InputError: one of them is no wind.
    """

    def __init__(self, *winds: Wind) -> None:
        for wind in winds:
            check_wind(wind, "Sum")
        self.winds = [part for wind in winds for part in winds_of(wind)]

    def add(self, time: float, points: Array, velocities: Array) -> None:
        """Add the air's velocity at points (3, n) m to velocities (3, n) m/s."""
        for wind in self.winds:
            add_wind(wind, time, points, velocities)


def winds_of(wind: Wind) -> list[Wind]:
    """Return the parts of a sum, or the wind itself."""
    return wind.winds if isinstance(wind, Sum) else [wind]


def add_wind(wind: Wind, time: float, points: Array, velocities: Array) -> None:
    """Add any wind at points (3, n) m to velocities (3, n) m/s."""
    if isinstance(wind, CompiledWind):
        wind.add(time, points, velocities)
    else:
        velocities += np.asarray(wind.velocity(points.T, time), dtype=np.float64).T


def check_wind(wind: object, where: str) -> None:
    """Check that a wind can fly.

    Raises:
        InputError: the object has no ``velocity``.
    """
    if not isinstance(wind, Wind):
        raise InputError(
            f"{where}: expected a wind of windwrench.envs.wind, or an object with "
            f"velocity(points (n, 3), time), got {type(wind).__name__}"
        )


def check_points(points: ArrayLike, time: float) -> Array:
    """Return points (n, 3) as rows (3, n).

    Raises:
        InputError: another shape, or numbers that are not finite.
    """
    given = np.asarray(points, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] != 3 or not np.all(np.isfinite(given)):
        raise InputError(
            f"wind: points must be finite numbers in m, shape (n, 3), got shape {given.shape}"
        )
    if not math.isfinite(time):
        raise InputError(f"wind: time must be a finite number of seconds, got {time!r}")
    return np.ascontiguousarray(given.T)


def vector(value: ArrayLike, name: str) -> Array:
    """Return three finite numbers as an array (3,).

    Raises:
        InputError: something else.
    """
    given = np.asarray(value, dtype=np.float64)
    if given.shape != (3,) or not np.all(np.isfinite(given)):
        raise InputError(f"wind: {name} must be three finite numbers, got {value!r}")
    return given


def number(value: float, name: str, least: float = -math.inf) -> float:
    """Return a finite number that is above ``least``.

    Raises:
        InputError: something else.
    """
    if not (isinstance(value, int | float | np.number) and math.isfinite(value) and value > least):
        limit = "" if least == -math.inf else f" above {least:g}"
        raise InputError(f"wind: {name} must be a finite number{limit}, got {value!r}")
    return float(value)
