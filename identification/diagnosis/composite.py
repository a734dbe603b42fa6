"""Pairs of effects that are together the exact equivalent of a third.

Thrust is known by what it moves: only its ratios to mass and to inertia show. So of mass, inertia
and a scale of thrust any two that change alike are the third, the other way round.
"""

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import Vehicle
from .regression import CENTRAL, unit_of_change

Array = NDArray[np.float64]
Setting = Mapping[str, Mapping[str, float]]


# from when on two changes are alike: standard deviations, of any component, that they may be apart,
# and the share of the changes to which effect models are alike
MOST_APART, SHARE = 2.5, 0.1
ROLES = (Role.MASS, Role.THRUST, Role.INERTIA)


def composites(vehicle: Vehicle, setting: Setting, std: Setting) -> tuple[str, ...]:
    """Return, as sentences, which single effect may be the cause of two of a setting.

    Args:
        vehicle: as it is declared.
        setting: coefficients of effects.
        std: their standard deviations.
    """
    found = []
    for third in ROLES:
        pair = [playing(role, among=setting) for role in ROLES if role != third]
        for a, b in itertools.product(*pair):
            (x, dx), (y, dy) = (_relative(vehicle, e, setting[e], std[e]) for e in (a, b))
            off = np.subtract.outer(x, y)
            alike = SHARE * np.maximum.outer(np.abs(x), np.abs(y))
            size = np.sqrt(np.add.outer(dx**2, dy**2) + alike**2)
            if np.all(np.abs(off) < MOST_APART * size):
                other = " or ".join(playing(third))
                found.append(f"{a} and {b} change alike: {other} may be the one cause")
    return tuple(found)


def _relative(
    vehicle: Vehicle, effect: str, values: Mapping[str, float], std: Mapping[str, float]
) -> tuple[Array, Array]:
    """Return the relative changes of what an effect changes, and their standard deviations."""
    names = [c.name for c in get(effect).coefficients if c.name in values and c.name != CENTRAL]
    unit = np.array([unit_of_change((effect, name), vehicle) for name in names])
    size = np.array([[values[name], std.get(name, 0.0)] for name in names]).T
    return size[0] / unit, size[1] / unit
