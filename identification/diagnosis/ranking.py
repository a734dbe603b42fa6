"""Which effects act: the posterior over sets of up to five, and what they leave unexplained.

Every effect of the library is as likely as every other before the flight, and one is expected to be
missing. A set's evidence is that of the likelier noise of two: that beside no effect, and that
beside the best set, because what is not explained counts as a disturbance.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ..findings import Disturbance, Ranking
from .climbing import Height, linearised, mode
from .likelihood import Likelihood
from .priors import Base, Setting, Starts
from .regression import START_PREFIX, Column, Flights, moves_time, typical_size
from .sets import Posterior
from .starting_points import starting_points

Array = NDArray[np.float64]


# typical sizes at which a lag or a delay is tried as a whole: their columns change with them
TIME_STARTS = (0.3, 0.6, 1.2)
ROUNDS = 6  # of fitting the noise beside the best set


@dataclass(frozen=True, eq=False)
class Found:
    """The posterior of flights, and what the likeliest set is a fit of."""

    posterior: Posterior
    ranking: Ranking
    setting: Setting  # coefficients of the likeliest set
    # of each channel, where the likelihood has a noise of the motion; none for a force balance
    gusts: tuple[Disturbance, ...] = ()
    # biases and time offsets of the sensors, with their standard deviations
    sensors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # of each effect of the set, those that the logs do not show and that do as well in its place
    behind: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def rank(
    flights: Flights,
    library: Sequence[str],
    report: Callable[[str], None] = lambda text: None,
) -> Found:
    """Return the posterior over sets of effects of a library, of those that flights can show.

    Args:
        flights: whose poses are explained.
        library: names of effects that may act.
        report: called with a line of progress.
    """

    def beside(setting: Setting) -> tuple[Likelihood, Starts]:
        return Likelihood(flights, setting, near), starts_of(flights, library, setting, {})

    near = Likelihood(flights, {})
    best, starts = nothing = near, starts_of(flights, library, {})
    loud = best.base(library, starts)
    quiet = best.quieter(_whole_library(loud), starts)
    found = Posterior(flights, library, (loud, quiet))
    # the best effect first, alone: another set's columns are those of the model that has it
    setting = found.best_setting(1)
    tried: dict[frozenset[str], Setting] = {frozenset(): {}}
    for _ in range(ROUNDS):
        # the columns of the same set change with its coefficients, where these have moved far
        if not found.is_elsewhere(setting, tried):
            setting = found.best_setting()
            if not found.is_elsewhere(setting, tried):
                break
        report(f"trying {', '.join(setting)}")

        def height(x: Setting, near: Likelihood = near) -> Height:
            base = Likelihood(flights, x, near, same_noise=True).base(x, {})
            return linearised(flights, base, base.asked, x)

        setting = mode(setting, height)
        tried[frozenset(setting)] = setting
        near, starts = beside(setting)
        best = near
        found = Posterior(flights, library, (loud, best.base(library, starts)))
        setting = found.best_setting()
    # once more, with the dictionary's columns, that are dear, beside the likeliest set
    if setting.keys() != best.setting.keys():
        best, starts = beside(setting) if setting else nothing
    whole = best.base(library, starts, unknown=True)
    found = Posterior(flights, library, (loud, whole), found.tempering())
    column, size, gained = found.strangest()
    # of so many columns one explains as much by chance, and no noise beside it would be likelier
    by_chance = 2.0 * math.log(len(whole.dictionary))
    ranking = found.ranking(best.quieter({column: size}, starts) if gained > by_chance else None)
    late = {c[1]: x for c, x in found.nuisances().items() if c in flights.offsets}
    return Found(found, ranking, found.best_setting(), best.gusts(), late)


def _whole_library(base: Base) -> dict[Column, float]:
    """Return the coefficients of all columns of effects together, at the mode."""
    chosen = np.append(base.plain, base.at(base.asked))
    names = list(base.columns)
    coefficients = base.mode(chosen)[0] * base.size[chosen]
    return {names[i]: float(x) for i, x in zip(chosen, coefficients, strict=True)}


def starts_of(
    flights: Flights, library: Sequence[str], setting: Setting, *others: Setting
) -> Starts:
    """Return columns of whole effects that are not in a setting, with the coefficients of each:
    lags and delays, and effects whose coefficients do nothing one by one. These start from what the
    setting leaves unexplained, and what ``others`` do: an effect may act in the place of another.
    """
    out: dict[Column, Mapping[str, float]] = {}
    residuals: list[Array] = []
    for effect in library:
        if effect in setting:
            continue
        if moves_time(effect) and get(effect).kind == "rotor input":
            name = get(effect).coefficients[0].name
            typical = typical_size((effect, name), flights.vehicle)
            for i, share in enumerate(TIME_STARTS):
                out[effect, f"{START_PREFIX}{i}"] = {name: share * typical}
            continue
        if not flights.is_nonlinear(effect):
            continue
        residuals = residuals or [flights.residual(x) for x in (setting, *others)]
        stated = flights.stated(effect)
        beside = [*setting, *(e.name for e in flights.vehicle.effects)]
        found = [x for y in residuals for x in starting_points(effect, flights, y, stated, beside)]
        for i, start in enumerate(found):
            out[effect, f"{START_PREFIX}{i}"] = {**start, **stated}
    return out
