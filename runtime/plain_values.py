"""Values as files hold them: types of JSON and YAML in place of NumPy's, paths and data classes."""

import math
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any


def plain(value: Any, digits: int | None = None) -> Any:
    """Return a value for strict JSON: arrays and tuples as lists, paths as texts, infinity and NaN
    as None.

    Args:
        value: numbers, texts, arrays, and mappings, lists and data classes of them.
        digits: significant ones of each float; default: all.
    """
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {as_text(key): plain(item, digits) for key, item in value.items()}
    if hasattr(value, "tolist"):  # NumPy's arrays and numbers
        value = value.tolist()
    if isinstance(value, list | tuple | set):
        return [plain(item, digits) for item in value]
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return value if digits is None else float(f"{value:.{digits}g}")
    return value if value is None or isinstance(value, bool | int) else as_text(value)


def as_text(value: object) -> str:
    """Return the text of a value, with a question mark for each byte of a file's name outside
    UTF-8.
    """
    return str(value).encode("utf-8", "replace").decode()
