"""Which effects act on flights whose rotors are known by commands: the posterior over sets, from
the force balance alone.

The likeliest set is fitted without linearisation, and so is each set that comes out likeliest after
it, until none does that was not fitted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..inference.regression import Column, Flights
from .force_likelihood import ForceLikelihood
from .priors import Base, Setting
from .ranking import Found, starts_of
from .sets import Posterior, is_possible


@dataclass(frozen=True)
class ForceRankingSettings:
    """Which starts are fitted."""

    most_starts: int = 2  # of an effect with nonlinear coefficients, the likeliest, that are fitted


FORCE_RANKING = ForceRankingSettings()


def rank_by_force(
    flights: Flights,
    library: Sequence[str],
    first: Setting,
    fixed: Setting,
    report: Callable[[str], None] = lambda text: None,
) -> Found:
    """Return the posterior over sets of effects of a library.

    Args:
        flights: with rotors that are known by commands.
        library: effects that may act, those of ``first`` among them.
        first: effects that any set has, with coefficients about which a fit begins.
        fixed: effects that are known from elsewhere, with their coefficients.
        report: called with a line of progress.
    """
    likelihood = ForceLikelihood(flights, library, first, fixed)
    library = likelihood.library
    first = {e: x for e, x in first.items() if e in library}
    given = frozenset(first)
    first = likelihood.fitted(first)
    starts = starts_of(flights, library, first)
    alone = likelihood.base(first, starts)
    fitted: dict[frozenset[str], Setting] = {given: first}
    bases: dict[frozenset[str], Base] = {given: alone}
    lags: dict[Column, dict[str, float]] = {
        c: dict(x) for c, x in starts.items() if not flights.is_nonlinear(c[0])
    }

    idle: set[frozenset[str]] = set()

    def add(setting: Setting) -> None:
        key = frozenset(setting)
        fitted[key] = likelihood.fitted(setting)
        found = set(fitted[key]) - given
        if found & likelihood.idle(fitted[key]) or not all(
            is_possible(flights, fitted[key], {}, e, plausible=True) for e in found
        ):
            idle.add(key)
            return
        others = {c: x for c, x in lags.items() if c[0] not in setting}
        bases[key] = likelihood.base(fitted[key], others)

    for effect in library:
        if not flights.is_nonlinear(effect) or effect in given:
            continue
        report(f"trying {effect}")
        own = [{**first, effect: dict(x)} for c, x in starts.items() if c[0] == effect]
        near = sorted(own, key=likelihood.objective)[: FORCE_RANKING.most_starts]
        if near:
            add(min(map(likelihood.fitted, near), key=likelihood.objective))

    def likeliest() -> Setting:
        """Return the likeliest set's fit, once no set is likelier that was not fitted."""
        while True:
            found = Posterior(flights, library, list(bases.values()), likelihood.power, given, idle)
            setting = found.best_setting(len(library))
            if (key := frozenset(setting)) in bases:
                return fitted[key]
            report(f"trying {', '.join(e for e in setting if e not in given) or 'no effect'}")
            add(setting)

    def confirmed() -> Setting:
        """Return the likeliest set's fit, once no set that lacks one of its effects is likelier
        where it is fitted as well.
        """
        while True:
            best = likeliest()
            less = [{e: x for e, x in best.items() if e != out} for out in best if out not in given]
            new = [x for x in less if frozenset(x) not in fitted]
            if flights.commanded or not new:
                return best
            for setting in new:
                add(setting)

    likelihood.power = likelihood.tempered(confirmed())
    best = confirmed()
    key = frozenset(best)
    others = {c: x for c, x in lags.items() if c[0] not in key}
    bases.pop(key)
    bases[key] = likelihood.base(best, others, unknown=True)
    found = Posterior(flights, library, list(bases.values()), likelihood.power, given, idle)
    return Found(found, found.ranking(), best, sensors=likelihood.sensors(best))
