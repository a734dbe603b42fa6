"""Python files of a user's own, named on purpose: a user who names a file asks to run the file."""

import importlib.util
import inspect
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from .errors import InputError, unknown_name


def is_file_name(name: str) -> bool:
    """Return whether this names a Python file, with or without a name behind a colon."""
    return ".py:" in name or name.endswith(".py")


def named_in_file(name: str, kind: str, what: str, fits: Callable[[Any], bool]) -> Any:
    """Return the object of ``FILE.py:NAME``; NAME may be left out where one object fits.

    Args:
        name: the file, and the object's name in it.
        kind: a word for the object, for errors.
        what: the expected file, for errors.
        fits: whether an object is of this kind.

    Raises:
        InputError: no such file or object, an error while the file runs, or an unfit object.
    """
    stem, _, wanted = name.partition(".py:")
    path = f"{stem}.py" if wanted else name.removesuffix(":")
    module = import_file(path, what)

    def is_own(value: Any) -> bool:
        made = inspect.isclass(value) or inspect.isroutine(value)
        return fits(value) and (not made or value.__module__ == module.__name__)

    objects = {key: value for key, value in vars(module).items() if is_own(value)}
    if wanted in objects:
        return objects[wanted]
    if not objects:
        raise InputError(f"{path}: holds no {kind}; expected {what}")
    if wanted:
        if wanted in vars(module):
            raise InputError(f"{path}: {wanted} is no {kind}; expected {what}")
        raise unknown_name(kind, wanted, objects, path)
    if len(objects) > 1:
        raise InputError(
            f"{path}: holds {', '.join(objects)}; expected one of them behind the name, "
            f"{path}:{next(iter(objects))}"
        )
    return next(iter(objects.values()))


def import_file(path: str | Path, what: str) -> ModuleType:
    """Return the module in a file, run once in a process; ``what`` is the expected thing, for
    errors.

    Its name among the modules is the absolute path, so the module never hides another and is run
    once. An entry point ``stem:name`` finds the module, too, unless another has this name.

    Raises:
        InputError: no such file, or an error while it runs; the message names the line.
    """
    path = Path(path).resolve()
    name = str(path)
    if name in sys.modules:
        return sys.modules[name]
    if not os.path.isfile(path):  # False for too long a name
        raise InputError(f"{path}: there is no such file; expected {what}")
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: is no Python file; expected {what}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        frames = traceback.extract_tb(error.__traceback__)
        lines = [f.lineno for f in frames if f.filename == name]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        where = f", line {line}" if line else ""
        raise InputError(
            f"{path}{where}: {type(error).__name__}: {error}; expected {what}"
        ) from error
    other = importlib.util.find_spec(path.stem) if path.stem.isidentifier() else spec
    if other is None or other.origin == name:
        sys.modules.setdefault(path.stem, module)
    return module
