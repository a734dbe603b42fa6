"""Controllers in a user's files: ``my_laws.py:Gentle``."""

import inspect
from typing import Any

from ..runtime.errors import InputError
from ..runtime.python_file import named_in_file

_WHAT = "a Python file with a class whose objects have __call__(observation, info)"


def load_controller(name: str) -> Any:
    """Return a new controller from ``FILE.py:CLASS``, or from ``FILE.py`` with one class.

    Raises:
        InputError: no such file or class, an error while it runs, or no controller.
    """
    kind = named_in_file(name, "controller", _WHAT, _is_controller)
    try:
        return kind()
    except TypeError as error:
        raise InputError(
            f"{name}: cannot be made without arguments: {error}; expected defaults for all of them"
        ) from error


def _is_controller(value: Any) -> bool:
    return inspect.isclass(value) and any("__call__" in vars(base) for base in value.__mro__)
