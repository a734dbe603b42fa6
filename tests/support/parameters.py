"""Lists of parameters of which a few are quick to show what all of them do."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def mostly_slow(values: Iterable[Any], quick: Callable[[Any], bool]) -> list[Any]:
    """Return the values with the mark ``slow`` on those that are not quick."""
    return [v if quick(v) else pytest.param(v, marks=pytest.mark.slow) for v in values]
