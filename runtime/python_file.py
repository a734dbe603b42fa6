"""Python files of a user's own, named on purpose: running them is what is asked for."""

import importlib.util
import os
import sys
import traceback
from pathlib import Path
from types import ModuleType

from .errors import InputError


def import_file(path: str | Path, what: str) -> ModuleType:
    """Return the module in a file, run once in a process; ``what`` says in errors what was
    expected.

    It goes by its absolute path among the modules, so that it never hides another and is found
    again.

    Raises:
        InputError: there is no such file, or running it fails; the message names the line.
    """
    path = Path(path).resolve()
    name = str(path)
    if name in sys.modules:
        return sys.modules[name]
    if not os.path.isfile(path):  # False for a name that is too long
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
