"""Whether the coefficients of a named effect are plausible.

An effect that stands for another one is often fitted at a bound: a dry friction, named a drag,
needs a quadratic part below zero. A true coefficient of zero is at a bound too, but its best fit is
not far outside.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Found
from .regression import CENTRAL, Column, Flights, Setting, typical_size
from .search import FittedEffects, Search


@dataclass(frozen=True)
class RangeSettings:
    """From which coefficients on, a named effect is doubtful."""

    # standard deviations beyond a bound; those of true effects are within 2
    most_excess_in_std: float = 3.5
    # share of the effect's own size by which it must exceed a bound: effect models are true to that
    least_excess_share: float = 0.05
    most_typical_sizes: float = 10.0


RANGES = RangeSettings()


def implausible_coefficients(search: Search, fit: FittedEffects) -> list[str]:
    """Return, as sentences, which coefficients would leave their range, or are implausible for
    their effect.

    Of 340 flights with a wrong name it doubts 71, and 10 as the only check.
    """
    vehicle = search.flights.vehicle
    found = []
    size = {
        effect: max(
            (
                abs(v) / typical_size((effect, k), vehicle)
                for k, v in fit.setting[effect].items()
                if k != CENTRAL
            ),
            default=0.0,
        )
        for effect in fit.effects
    }
    for effect in fit.effects:
        if size[effect] > RANGES.most_typical_sizes and not get(effect).any_size:
            found.append(
                f"{effect} is {size[effect]:.0f} times its typical size: another effect may be the "
                "cause"
            )
    found += [
        f"{effect} {reason}: another effect may be the cause"
        for effect in fit.effects
        if (reason := why_implausible(search.flights, fit.setting, fit.std, effect))
    ]
    g = search.gram_at(fit)
    total, k = g.blocks.sum(axis=0), len(g.columns)
    normal = total[:k, :k] + np.diag(g.precision)
    change = np.linalg.solve(normal, total[:k, -1] - g.precision * g.value)
    std = np.sqrt(np.diag(np.linalg.inv(normal)))
    beyond: dict[str, list[str]] = {}
    for (effect, name), d, s, low, high in zip(
        g.columns, change, std, g.lower, g.upper, strict=True
    ):
        least = (
            RANGES.least_excess_share
            * typical_size((effect, name), vehicle)
            * (1.0 if name == CENTRAL else size.get(effect, 0.0))
        )
        if (
            effect
            and ((low >= 0.0 and d < 0.0) or (high <= 0.0 and d > 0.0))
            and abs(d) > max(RANGES.most_excess_in_std * s, least)
        ):
            beyond.setdefault(effect, []).append(name)
    found += [
        f"{effect}: the best fit of {', '.join(names)} lies outside the allowed range: another "
        "effect may be the cause"
        for effect, names in beyond.items()
    ]
    return found


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
