"""Numbers as C writes them, and the same source in single or in double precision.

Templates and translated effects are C in single precision. Numbers from Python stand in
them with all their digits (``literal``, with an F at the end). The last step on a whole file writes
each number in the chosen precision.
"""

import re
import textwrap

import numpy as np
from numpy.typing import ArrayLike

from ...runtime.errors import InputError

_WIDTH = 101  # columns, with a comma
PRECISIONS = ("single", "double")
_COMMENT = re.compile(r"(/\*.*?\*/)", re.S)
_NUMBER = r"(?<![\w.])((?:\d+\.\d*|\d+(?=[eE]))(?:[eE][-+]?\d+)?)"
_FROM_PYTHON = re.compile(_NUMBER + r"F\b")
_ANY = re.compile(_NUMBER + r"[fF]\b")
# the functions of libm in a source; with f in single
FUNCTIONS = ("sqrt", "sin", "cos", "fabs", "exp", "log", "pow", "atan2", "tanh")
_CALL = re.compile(rf"\b({'|'.join(FUNCTIONS)})f\b")


def literal(value: float, what: str = "a number") -> str:
    """Return a number as a C literal with all its digits, within the range of single precision.

    Raises:
        InputError: single precision does not hold the number; ``what`` names the number.
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


def in_precision(source: str, precision: str) -> str:
    """Return a C source with its numbers, types and functions of libm in one of ``PRECISIONS``."""
    if precision == "single":
        return _FROM_PYTHON.sub(lambda number: f"{_shortest(number[1])}f", source)
    parts = _COMMENT.split(source)  # every second one is a comment
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"\bfloat\b", "double", _CALL.sub(r"\1", _ANY.sub(r"\1", parts[i])))
    return "".join(parts)


def _shortest(number: str) -> str:
    """Return the shortest text of the same number in single precision."""
    text = str(np.float32(float(number)))
    return text if "." in text or "e" in text else f"{text}.0"
