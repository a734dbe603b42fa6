"""Numbers of an export as C and C++ write them, in single or in double precision."""

import textwrap
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ...runtime.errors import InputError

PRECISIONS = {"single": "float", "double": "double"}  # and the type of a number
_WIDTH = 96  # columns


def _literal(value: float, what: str = "a number", precision: str = "single") -> str:
    """Return a number as a literal that reads back exactly, in a precision.

    Raises:
        InputError: single precision does not hold the number; ``what`` names the number.
    """
    with np.errstate(over="ignore"):
        number = np.float32(value) if precision == "single" else np.float64(value)
    if np.isnan(number) or (np.isinf(number) and np.isfinite(value)):
        raise InputError(f"{what}: single precision does not hold {value:g}")
    if np.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    text = str(number)  # the shortest that reads back as the same number
    text = text if "." in text or "e" in text else f"{text}.0"
    return f"{text}f" if precision == "single" else text


def table(values: ArrayLike, what: str = "a number", precision: str = "single") -> str:
    """Return a number or an array as an initialiser; whole numbers stay whole."""
    array = np.asarray(values)
    if array.dtype.kind in "iu" and array.ndim == 0:
        return str(int(array))
    if array.ndim == 0:
        return _literal(float(array), what, precision)
    items = [table(item, what, precision) for item in array]
    if array.ndim > 1:
        return "{" + ",\n    ".join(items) + "}"
    lines = textwrap.wrap(", ".join(items), _WIDTH, break_long_words=False, break_on_hyphens=False)
    return "{" + "\n     ".join(lines) + "}"


def filters(precision: str) -> dict[str, Callable[..., object]]:
    """Return the templates' filters for numbers in a precision."""
    return {
        "literal": partial(_literal, precision=precision),
        "table": partial(table, precision=precision),
        # as a declaration has them
        "shape": lambda values: "".join(f"[{n}]" for n in np.shape(values)),
        "ravelled": np.ravel,
    }
