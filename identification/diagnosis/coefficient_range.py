"""Whether the coefficients of a named effect are plausible.

An effect that stands for another one is often fitted at a bound: a dry friction, named a drag,
needs a quadratic part below zero. A true coefficient of zero is at a bound too, but its best fit is
not far outside.
"""

from collections.abc import Mapping

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Found
from .regression import Column, Flights, Setting, typical_size


def why_implausible(
    flights: Flights, setting: Setting, std: Mapping[Column, float], effect: str
) -> str:
    """Return why an effect says that its coefficients at a setting are none of its own; empty where
    they may be.
    """
    asked = get(effect).implausible
    if asked is None:
        return ""
    vehicle = flights.vehicle
    named = {*(e for e in setting if e), *(e.name for e in vehicle.effects)} - {effect}
    return asked(
        Found(
            setting[effect],
            {name: std.get((effect, name), 0.0) for name in setting[effect]},
            {c.name: typical_size((effect, c.name), vehicle) for c in get(effect).coefficients},
            flights.speed,
            frozenset(get(name).family for name in named),
        )
    )
