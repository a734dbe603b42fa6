"""Winds as velocity fields, and their evaluation in a flight."""

from __future__ import annotations

import math
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ... import _core
from ...runtime.arrays import Array
from ...runtime.errors import InputError


@runtime_checkable
class Wind(Protocol):
    """A velocity field of the air."""

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """Return the air's velocity (n, 3) m/s, world, at points (n, 3) m of the world and a time
        in s.
        """
        ...


class CompiledWind:
    """A wind of this room: one of the core's formulas, and the formula's parameters.

    A flight adds up the winds at the stations of a vehicle without Python. A flight holds the
    addresses of formula and parameters alone, and calls all kinds of winds alike.

    Args:
        formula: ``steady``, ``waves``, ``jets`` or ``grid``.
        parameters: (1,) of a structured type, with stated fields and units.
        tables: arrays, by the fields with the address of their first number.

    Attributes:
        calls: (1, 2) addresses of the formula and of its parameters; of a sum (winds, 2).
    """

    def __init__(
        self,
        formula: str,
        parameters: np.ndarray,
        tables: dict[str, np.ndarray] | None = None,
    ) -> None:
        self._formula = formula, parameters, tables or {}
        self._bind()

    def _bind(self) -> None:
        """Write down this process's addresses of the formula, its parameters and its tables."""
        formula, parameters, tables = self._formula
        for name, table in tables.items():
            parameters[name] = table.ctypes.data
        address = _core.wind_formula(formula, parameters.itemsize)
        self.calls = np.array([[address, parameters.ctypes.data]])

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "calls"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """Return the air's velocity (n, 3) m/s, world, at points (n, 3) m of the world and a time
        in s.

        Raises:
            InputError: points have another shape, or numbers are not finite.
        """
        rows = _check_points(points, time)
        out = np.zeros_like(rows)
        _core.add_winds(self.calls, time, rows, out)
        return np.ascontiguousarray(out.T)

    def __add__(self, other: Wind) -> Sum:
        return Sum(self, other)


class Sum(CompiledWind):
    """The sum of winds: this room's, and behind them ``own``, the user's own.

    Raises:
        InputError: one of them is no wind.
    """

    def __init__(self, *winds: Wind, where: str = "Sum") -> None:
        for wind in winds:
            if not isinstance(wind, Wind):
                raise InputError(
                    f"{where}: expected a wind of windwrench.envs.wind, or an object with "
                    f"velocity(points (n, 3), time), got {type(wind).__name__}"
                )
        self.winds = [part for wind in winds for part in winds_of(wind)]
        self.own = [wind for wind in self.winds if not isinstance(wind, CompiledWind)]
        self._bind()

    def _bind(self) -> None:
        calls = [wind.calls for wind in self.winds if isinstance(wind, CompiledWind)]
        self.calls = np.concatenate([np.zeros((0, 2), dtype=np.int64), *calls])

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """Return the air's velocity (n, 3) m/s, as ``CompiledWind`` does."""
        out = super().velocity(points, time)
        for wind in self.own:
            out += np.asarray(wind.velocity(points, time), dtype=np.float64)
        return out


def winds_of(wind: Wind) -> list[Wind]:
    """Return the parts of a sum, or the wind itself."""
    return wind.winds if isinstance(wind, Sum) else [wind]


def _check_points(points: ArrayLike, time: float) -> Array:
    """Return points (n, 3) as rows (3, n).

    Raises:
        InputError: the shape is another, or numbers are not finite.
    """
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or not np.all(np.isfinite(array)):
        raise InputError(
            f"wind: points must be finite numbers in m, shape (n, 3), got shape {array.shape}"
        )
    if not math.isfinite(time):
        raise InputError(f"wind: time must be a finite number of seconds, got {time!r}")
    return np.ascontiguousarray(array.T)


def vector(value: ArrayLike, name: str) -> Array:
    """Return three finite numbers as an array (3,).

    Raises:
        InputError: something else.
    """
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise InputError(f"wind: {name} must be three finite numbers, got {value!r}")
    return array


def number(value: float, name: str, above: float = -math.inf, least: float = -math.inf) -> float:
    """Return a finite number greater than ``above``, and no less than ``least``.

    Raises:
        InputError: something else.
    """
    is_number = isinstance(value, int | float | np.number) and math.isfinite(value)
    if not (is_number and value > above and value >= least):
        limit = f" above {above:g}" * (above > -math.inf) + f" from {least:g} on" * (
            least > -math.inf
        )
        raise InputError(f"wind: {name} must be a finite number{limit}, got {value!r}")
    return float(value)
