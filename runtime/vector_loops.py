"""How loops over many numbers side by side are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def side_by_side(function: F) -> F:
    """Compile like ``compiled``, without the checks of each division for zero, which would keep
    loops from vector units.
    """
    return cast(F, njit(cache=True, error_model="numpy")(function))


def inlined(function: F) -> F:
    """The same for a part of such a function, which is compiled anew in each place for the arrays
    there.
    """
    return cast(F, njit(cache=True, error_model="numpy", inline="always")(function))
