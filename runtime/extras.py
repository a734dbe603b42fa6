"""Libraries that not everyone needs, and what to install where one is missing."""

from importlib.util import find_spec

from .errors import InputError


def need(module: str, extra: str) -> None:
    """Check that an optional library is there.

    Raises:
        InputError: it is not; the message says how to install it.
    """
    if find_spec(module) is None:
        raise InputError(
            f"{module.replace('_', '-')} is not installed; pip install 'windwrench[{extra}]' "
            f"brings it"
        )
