"""Which effects act: the posterior over sets of up to four, and what they leave unexplained.

Every effect of the library is as likely as every other before the flight, and one is expected to be
missing. A set's evidence is that of the likelier noise of two: that beside no effect, and that
beside the best set, because what is not explained counts as a disturbance.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ..findings import Ranking
from ..inference.regression import START_PREFIX, Column, Flights, moves_time, typical_size
from ..inference.starting_points import starting_points
from .likelihood import Likelihood
from .priors import Base, Setting, in_prior_units, variants_of
from .sets import Posterior

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RankingSettings:
    """How often sets are tried anew, and where lags are."""

    # typical sizes at which a lag or a delay is tried as a whole: their columns change with them
    time_starts: tuple[float, ...] = (0.3, 0.6, 1.2)
    rounds: int = 4  # of fitting the noise beside the best set


RANKING = RankingSettings()


def rank(
    flights: Flights,
    library: Sequence[str],
    proposed: Setting | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> Ranking:
    """Return the posterior over sets of effects of a library, of those that flights can show.

    Args:
        flights: whose poses are explained.
        library: names of effects that may act.
        proposed: effects with coefficients that another search has found: its columns are asked
            beside those of the sets that the posterior comes upon by itself.
        report: called with a line of progress.
    """
    library = [e for e in library if e not in flights.not_identifiable]
    near = Likelihood(flights, {})
    starts = starts_of(flights, library, {})
    sums = near.sums(wanted_columns(library, {}, starts), starts, unknown=False)
    loud = in_prior_units(flights, sums, {}, starts)
    explained = _whole_library(loud)
    now = in_prior_units(flights, near.quieter(explained), {}, starts)
    tried: dict[frozenset[str], Setting] = {frozenset(): {}}
    beside: _Beside | None = None
    others: tuple[Base, ...] = ()
    if proposed and proposed.keys() <= set(library):
        tried[frozenset(proposed)] = proposed
        beside = _Beside(flights, library, proposed, near)
        others = (beside.base(),)
    found = Posterior(flights, library, (loud, *others, now))
    # the best effect first, alone: another set's columns are those of the model that has it
    setting = found.best_setting(1)
    last: _Beside | None = None
    for _ in range(RANKING.rounds):
        # the columns of the same set change with its coefficients, where these have moved far
        if not found.is_elsewhere(setting, tried):
            setting = found.best_setting()
            if not found.is_elsewhere(setting, tried):
                break
        tried[frozenset(setting)] = setting
        if beside and beside.setting.keys() == setting.keys():
            beside, others = None, ()
        report(f"trying {', '.join(setting)}")
        last = _Beside(flights, library, setting, last.likelihood if last else near)
        found = Posterior(flights, library, (loud, *others, last.base()))
        setting = found.best_setting()
    # once more, with the dictionary's columns, that are dear, beside the likeliest set
    if beside and found.best_base() == 1:
        others, last = ((last.base(),) if last else (now,)), beside
    if last:
        now = last.base(unknown=True)
    else:
        near.sums(wanted_columns(library, {}, starts), starts)
        now = in_prior_units(flights, near.quieter(explained), {}, starts)
    return Posterior(flights, library, (loud, *others, now), found.tempering()).ranking()


class _Beside:
    """The likelihood beside a set of effects, and the starts of all others there."""

    def __init__(
        self, flights: Flights, library: Sequence[str], setting: Setting, near: Likelihood
    ) -> None:
        self.flights, self.library, self.setting = flights, library, setting
        self.likelihood = Likelihood(flights, setting, near)
        self.starts = starts_of(flights, library, setting)

    def base(self, unknown: bool = False) -> Base:
        """Return its sums; ``unknown``: with the dictionary's columns."""
        wanted = wanted_columns(self.library, self.setting, self.starts)
        sums = self.likelihood.sums(wanted, self.starts, unknown)
        return in_prior_units(self.flights, sums, self.setting, self.starts)


def wanted_columns(
    library: Sequence[str], setting: Setting, starts: Mapping[Column, Mapping[str, float]]
) -> dict[Column, None]:
    """Return the columns of all effects, in order."""
    return dict.fromkeys(c for e in library for v in variants_of(e, setting, starts) for c in v[1])


def _whole_library(base: Base) -> dict[Column, float]:
    """Return the coefficients of all columns of effects together, at the mode."""
    chosen = np.concatenate([base.plain, [i for c, i in base.columns.items() if c[0]]]).astype(int)
    total = base.blocks.sum(axis=0)
    mode = np.linalg.solve(total[np.ix_(chosen, chosen)] + np.eye(len(chosen)), total[chosen, -1])
    names = list(base.columns)
    return {names[i]: float(x * base.size[i]) for i, x in zip(chosen, mode, strict=True)}


def starts_of(
    flights: Flights, library: Sequence[str], setting: Setting
) -> dict[Column, Mapping[str, float]]:
    """Return columns of whole effects, with the coefficients of each: lags and delays, and effects
    whose coefficients do nothing one by one.
    """
    out: dict[Column, Mapping[str, float]] = {}
    residual: Array | None = None
    for effect in library:
        if effect in setting:
            continue
        if moves_time(effect) and get(effect).kind == "rotor input":
            name = get(effect).coefficients[0].name
            typical = typical_size((effect, name), flights.vehicle)
            for i, share in enumerate(RANKING.time_starts):
                out[effect, f"{START_PREFIX}{i}"] = {name: share * typical}
            continue
        if not flights.is_nonlinear(effect):
            continue
        if residual is None:
            residual = flights.residual({k: v for k, v in setting.items() if k})
        stated = flights.stated(effect)
        for i, start in enumerate(starting_points(effect, flights, residual, stated)):
            out[effect, f"{START_PREFIX}{i}"] = {**start, **stated}
    return out
