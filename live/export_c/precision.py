"""The same source in single or in double precision.

Templates and translated effects are C in single precision. Numbers that come from Python stand in
them with all their digits (``c_numbers.literal``, which ends in F); what is left to do once a file
is whole is to write each as the precision has it.
"""

import re

import numpy as np

PRECISIONS = ("single", "double")
_COMMENT = re.compile(r"(/\*.*?\*/)", re.S)
_NUMBER = r"(?<![\w.])((?:\d+\.\d*|\d+(?=[eE]))(?:[eE][-+]?\d+)?)"
_FROM_PYTHON, _ANY = re.compile(_NUMBER + r"F\b"), re.compile(_NUMBER + r"[fF]\b")
# all of libm that a source may call; with f in single
FUNCTIONS = ("sqrt", "sin", "cos", "fabs", "exp", "log", "pow", "atan2", "tanh")
_CALL = re.compile(rf"\b({'|'.join(FUNCTIONS)})f\b")


def in_precision(source: str, precision: str) -> str:
    """Return a C source with its numbers, types and functions of libm in one of ``PRECISIONS``."""
    if precision == "single":
        return _FROM_PYTHON.sub(lambda found: f"{_shortest(found[1])}f", source)
    parts = _COMMENT.split(source)  # every second one is a comment
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"\bfloat\b", "double", _CALL.sub(r"\1", _ANY.sub(r"\1", parts[i])))
    return "".join(parts)


def _shortest(number: str) -> str:
    """Return the shortest number that single precision reads as the same."""
    text = str(np.float32(float(number)))
    return text if "." in text or "e" in text else f"{text}.0"
