"""Numbers as C writes them."""

import textwrap

import numpy as np
from numpy.typing import ArrayLike

from ...runtime.errors import InputError

_WIDTH = 101  # columns, with a comma


def literal(value: float, what: str = "a number") -> str:
    """Return a number as a C literal with all its digits, within what single precision holds.

    Raises:
        InputError: single precision does not hold it; ``what`` names it.
    """
    with np.errstate(over="ignore"):
        number = np.float32(value)
    if np.isnan(number) or (np.isinf(number) and np.isfinite(value)):
        raise InputError(f"{what}: single precision does not hold {value:g}")
    if np.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    return f"{float(value)!r}F"


def table(values: ArrayLike, what: str = "a number") -> str:
    """Return an array as the initialiser of a C array."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 1:
        numbers = ", ".join(literal(x, what) for x in array)
        lines = textwrap.wrap(numbers, _WIDTH, break_long_words=False, break_on_hyphens=False)
        return "{" + "\n     ".join(lines) + "}"
    return "{\n    " + ",\n    ".join(table(row, what) for row in array) + "}"


def shape(values: ArrayLike) -> str:
    """Return the sizes of an array as a C declaration has them."""
    return "".join(f"[{n}]" for n in np.shape(values))
