"""Python files of a user's own, named on purpose: a user who names a file asks to run the file."""

import importlib.util
import os
import sys
import traceback
from pathlib import Path
from types import ModuleType

from .errors import InputError


def import_file(path: str | Path, what: str) -> ModuleType:
    """Return the module in a file, run once in a process; ``what`` is the expected thing, for
    errors.

    Its name among the modules is the absolute path, so the module never hides another and is run
    once.

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
    return module
