"""What a wind is, and how compiled code calls one by its address."""

import ctypes
import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from ...runtime.addresses import address_of
from ...runtime.errors import InputError

Array = NDArray[np.float64]

# void wind(record, count, time, points, velocities): addresses, but for the count. ``time`` is that
# of one number (s), ``points`` and ``velocities`` those of arrays (3, count); it adds to the latter
SIGNATURE = types.void(*[types.int64] * 5)
_CALL = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 5)


@runtime_checkable
class Wind(Protocol):
    """A velocity field of the air."""

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """Return the air's velocity (n, 3) m/s, world, at points (n, 3) m of the world and a time
        in s.
        """
        ...


class CompiledWind:
    """A wind that compiled code evaluates.

    Args:
        function: a plain function of ``SIGNATURE``, which is compiled at its first use.
        record: an array (1,) of a structured type that the function reads; it may hold addresses of
            arrays in ``kept``.
        kept: what must live as long as the record.
    """

    def __init__(
        self, function: Callable[..., None], record: np.ndarray, kept: Sequence[Any] = ()
    ) -> None:
        self.function, self.record, self.kept = function, record, tuple(kept)

    def velocity(self, points: ArrayLike, time: float) -> Array:
        """Return the air's velocity (n, 3) m/s, world, at points (n, 3) m of the world and a time
        in s.

        Raises:
            InputError: points of another shape, or numbers that are not finite.
        """
        rows, now = check_points(points, time)
        out = np.zeros_like(rows)
        for one in winds_of(self):
            _CALL(one.address)(
                one.record.ctypes.data, rows.shape[1], now.ctypes.data, rows.ctypes.data,
                out.ctypes.data,
            )  # fmt: skip
        return np.ascontiguousarray(out.T)

    @property
    def address(self) -> int:
        """The address of the compiled function."""
        return address_of(self.function, SIGNATURE)

    def __add__(self, other: "CompiledWind") -> "Sum":
        return Sum(self, other)

    def __reduce__(self) -> Any:
        """Refuse to be copied or pickled: compiled code knows its arrays by address.

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
        InputError: one of them is not compiled.
    """

    def __init__(self, *winds: CompiledWind) -> None:
        for wind in winds:
            check_compiled(wind, "Sum")
        self.winds = [part for wind in winds for part in winds_of(wind)]


def winds_of(wind: CompiledWind) -> list[CompiledWind]:
    """Return the parts of a wind that compiled code calls one by one."""
    return wind.winds if isinstance(wind, Sum) else [wind]


def check_compiled(wind: object, where: str) -> None:
    """Check that a wind can fly.

    Raises:
        InputError: it cannot.
    """
    if not isinstance(wind, CompiledWind):
        raise InputError(
            f"{where}: expected a wind of windwrench.envs.wind, got {type(wind).__name__}; a wind "
            f"of your own flies as on_grid(wind, ...), which samples it"
        )


def check_points(points: ArrayLike, time: float) -> tuple[Array, Array]:
    """Return points (n, 3) as rows (3, n), and the time as an array (1,).

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
    return np.ascontiguousarray(given.T), np.array([float(time)])


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
