"""Controllers in files of a user's own: ``my_laws.py:Gentle``."""

import inspect
from typing import Any

from ..runtime.errors import InputError, unknown_name
from ..runtime.python_file import import_file

_WHAT = "a Python file with a class whose objects have __call__(observation, info)"


def is_file_name(name: str) -> bool:
    """Return whether this names a Python file, with or without a class behind a colon."""
    return name.partition(".py:")[1] != "" or name.endswith(".py")


def load_controller(name: str) -> Any:
    """Return a new controller from ``FILE.py:CLASS``; the class may be left out where the file has
    only one.

    Raises:
        InputError: no such file or class, an error while it runs, or no controller.
    """
    stem, _, wanted = name.partition(".py:")
    path = f"{stem}.py" if wanted else name.removesuffix(":")
    module = import_file(path, _WHAT)
    known = {
        key: value
        for key, value in vars(module).items()
        if inspect.isclass(value)
        and value.__module__ == module.__name__
        and any("__call__" in vars(base) for base in value.__mro__)
    }
    if not known:
        raise InputError(f"{path}: holds no controller; expected {_WHAT}")
    if not wanted and len(known) > 1:
        raise InputError(
            f"{path}: holds {', '.join(known)}; expected one of them behind the name, "
            f"{path}:{next(iter(known))}"
        )
    if wanted and wanted not in known:
        if wanted in vars(module):
            raise InputError(f"{path}: {wanted} is no controller; expected {_WHAT}")
        raise unknown_name("controller", wanted, known, path)
    try:
        return known[wanted or next(iter(known))]()
    except TypeError as error:
        raise InputError(
            f"{name}: cannot be made without arguments: {error}; expected defaults for all of them"
        ) from error
