"""Optional libraries, and the package to install where one is missing."""

from importlib.util import find_spec

from .errors import InputError


def need(module: str, extra: str, where: object = "") -> None:
    """Check for an optional library, needed by ``where``, if given.

    Raises:
        InputError: the library is missing; the message names the extra to install.
    """
    if find_spec(module) is None:
        name = f"{where}{': ' if where else ''}{module.replace('_', '-')}"
        raise InputError(f"{name} is not installed; pip install 'windwrench[{extra}]' brings it")
