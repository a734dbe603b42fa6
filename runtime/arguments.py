"""Arguments of functions that should be numbers: as arrays, and in words where they are not."""

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Array
from .errors import InputError


def real_numbers(value: object) -> Array | None:
    """Return an array of real numbers as doubles, NaN where masked; None for anything else, strings
    of digits among them.
    """
    try:
        array: NDArray[Any] = np.asanyarray(value)
        if array.dtype.kind not in "biuf":
            return None
        numbers = array.astype(np.float64)
        # a plain array skips this: 1 us, in each step of a filter
        masked = isinstance(numbers, np.ma.MaskedArray)
        return np.asarray(np.ma.filled(numbers, np.nan) if masked else numbers)
    except (TypeError, ValueError):
        return None


def check_positive(
    settings: Any, three: Collection[str] = (), endless: Collection[str] = ()
) -> None:
    """Check all fields of a data class: positive finite numbers; fields named in ``three`` may be
    three of x, y and z, fields in ``endless`` infinite.

    Raises:
        InputError: one is not.
    """
    for name, value in vars(settings).items():
        array, several = real_numbers(value), name in three
        shapes = ((), (3,)) if several else ((),)
        if (
            array is None
            or array.shape not in shapes
            or not np.all((array > 0) & (np.isfinite(array) | (name in endless)))
        ):
            size = "positive" if name in endless else "positive and finite"
            what = f"{size}, a number{' or three' if several else ''}"
            raise InputError(f"{type(settings).__name__}: {name} must be {what}, got {value!r}")


def described(value: object) -> str:
    """Describe an argument, for a message: its type, or the shape of an array of numbers."""
    array = real_numbers(value)
    kind = type(value).__name__
    if array is not None:
        return f"{array.item():g}" if array.ndim == 0 else f"shape {array.shape}"
    if isinstance(value, (list, tuple)) and value:
        kinds = sorted({type(item).__name__ for item in value})
        return f"a {kind} of {' and '.join(kinds)}"
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype}"
    return kind


def in_brackets(values: Array) -> str:
    """Return a vector (n,) with three significant digits, for a short ``repr``."""
    return f"({', '.join(f'{x:.3g}' for x in values)})"
