"""Libraries that not everyone needs, and what to install where one is missing."""

from importlib.util import find_spec

from .errors import InputError


def need(module: str, extra: str, where: object = "") -> None:
    """Check that an optional library is there, for ``where`` if that is said.

    Raises:
        InputError: it is not; the message says how to install it.
    """
    if find_spec(module) is None:
        name = f"{where}{': ' if where else ''}{module.replace('_', '-')}"
        raise InputError(f"{name} is not installed; pip install 'windwrench[{extra}]' brings it")
