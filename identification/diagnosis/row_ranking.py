"""Which effects act on flights whose pose is no measurement as it was made: the posterior over
sets, from rows of forces and, where rotors are measured, of torques.

Such are flights whose rotors are known by commands, whose pose was filtered before it was logged,
and whose motion is read from an IMU.

The likeliest set is fitted without linearisation, and so is each set that comes out likeliest after
it, until none does that was not fitted.
"""

import math
from collections.abc import Callable, Sequence

from .evidence import set_evidence
from .priors import Base, Setting
from .ranking import Found, starts_of
from .regression import Flights, without
from .row_likelihood import RowLikelihood
from .sets import Posterior, Tried, is_possible
from .settings import DIAGNOSIS

MOST_STARTS = 2  # of an effect with nonlinear coefficients, the likeliest, that are fitted


def rank_by_rows(
    flights: Flights,
    library: Sequence[str],
    first: Setting,
    fixed: Setting,
    report: Callable[[str], None] = lambda text: None,
) -> Found:
    """Return the posterior over sets of effects of a library.

    Args:
        flights: of the vehicle.
        library: effects that may act, those of ``first`` among them.
        first: effects that any set has, with coefficients about which a fit begins; none where
            rotors are measured.
        fixed: effects that are known from elsewhere, with their coefficients.
        report: called with a line of progress.
    """
    likelihood = RowLikelihood(flights, library, first, fixed)
    library = likelihood.library
    first = {e: x for e, x in first.items() if e in library}
    given = frozenset(first)
    first = likelihood.fitted(first)
    starts = starts_of(flights, library, first)
    fitted: dict[frozenset[str], Setting] = {given: first}
    bases: dict[frozenset[str], Base] = {given: likelihood.base(first, starts)}
    idle: set[frozenset[str]] = set()
    tried: Tried = {}

    def base(setting: Setting, unknown: bool = False) -> Base:
        lags = {
            c: x
            for c, x in starts.items()
            if not flights.is_nonlinear(c[0]) and c[0] not in setting
        }
        return likelihood.base(setting, lags, unknown=unknown)

    def add(setting: Setting) -> None:
        key = frozenset(setting)
        if any(map(flights.is_nonlinear, setting)):  # what was linearised elsewhere says little
            near = fitted[max(fitted, key=lambda other: len(other & key))]
            begun = {e: near.get(e, x) for e, x in setting.items()}
            setting = min(setting, begun, key=likelihood.objective)
        fitted[key] = likelihood.fitted(setting)
        found = set(fitted[key]) - given
        if likelihood.idle(fitted[key], found) or not all(
            is_possible(flights, fitted[key], {}, e, plausible=True) for e in found
        ):
            idle.add(key)
            return
        bases[key] = base(fitted[key])

    for effect in library:
        if not flights.is_nonlinear(effect) or effect in given:
            continue
        report(f"trying {effect}")
        own = [{**first, effect: dict(x)} for c, x in starts.items() if c[0] == effect]
        own.sort(key=likelihood.objective)
        if own:
            near = map(likelihood.fitted, own[:MOST_STARTS])
            add(min(near, key=likelihood.objective))

    def posterior() -> Posterior:
        return Posterior(flights, library, [*bases.values()], likelihood.power, given, idle, tried)

    def likeliest() -> Setting:
        """Return the likeliest set's fit, once no set is likelier that was not fitted."""
        while True:
            setting = posterior().best_setting(len(library))
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
            less = [without(best, out) for out in best if out not in given]
            new = [x for x in less if frozenset(x) not in fitted]
            if flights.commanded or not new:
                return best
            for setting in new:
                add(setting)

    confirmed()
    likelihood.power = posterior().tempering()
    best = confirmed()
    bases.pop(frozenset(best))  # the last is the one that has the dictionary
    bases[frozenset(best)] = base(best, unknown=True)
    found = posterior()
    hidden = sorted(flights.needs_pose - flights.without_trace - set(best))
    behind = _behind(likelihood, best, [e for e in hidden if not flights.is_nonlinear(e)])
    return Found(found, found.ranking(), best, sensors=likelihood.sensors(best), behind=behind)


def _behind(
    likelihood: RowLikelihood, best: Setting, hidden: Sequence[str]
) -> dict[str, tuple[str, ...]]:
    """Return of each effect of a set the ``hidden`` ones, which logs do not show and which may act
    all the same, that explain the flights as well in its place.
    """
    if not hidden or not best:
        return {}
    base = likelihood.base(best, {}, [*best, *hidden])
    at = base.at(base.asked)
    m = base.marginal(at, base.plain, power=likelihood.power)

    def explained(effects: set[str]) -> float:
        index = [i for i, (effect, _) in enumerate(base.asked) if effect in effects]
        return m.explained(index, set_evidence(m, index, base.low[at], base.high[at]).mode)

    # up to the deviance of a rival's likelihood
    whole = explained(set(best)) + 2.0 * math.log(DIAGNOSIS.least_rival)
    found = {e: tuple(h for h in hidden if explained({*best, h} - {e}) > whole) for e in best}
    return {e: others for e, others in found.items() if others}
