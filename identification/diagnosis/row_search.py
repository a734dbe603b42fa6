"""The search for the likeliest sets by the balance of forces and torques.

Rotors known by commands, a filtered pose, or a motion read from an IMU leave rows of forces and,
with measured rotors, of torques, with one noise for all sets. The likeliest set is fitted without
linearisation, and so is each next likeliest, until the likeliest is a fitted one.
"""

from collections.abc import Callable, Sequence

from .coefficients import Setting, without
from .priors import Base
from .regression import RegressedFlights
from .row_likelihood import RowLikelihood
from .sets import Posterior, is_possible
from .starting_points import starts_of

MOST_STARTS = 2  # likeliest starts of an effect with nonlinear coefficients, fitted by rows


def search_by_rows(
    flights: RegressedFlights,
    library: Sequence[str],
    first: Setting,
    fixed: Setting,
    report: Callable[[str], None],
) -> tuple[RowLikelihood, Setting, Posterior]:
    """Return the likelihood of the rows, the fit of the likeliest set, and the posterior.

    Args:
        flights: the vehicle's flights.
        library: names of effects, with ``first``.
        first: effects of every set, with coefficients for the start of a fit; none with measured
            rotors.
        fixed: effects known from elsewhere, with their coefficients.
        report: called with a line of progress.
    """
    likelihood = RowLikelihood(flights, library, first, fixed)
    library = likelihood.library
    first = {e: x for e, x in first.items() if e in library}
    given = frozenset(first)
    first = likelihood.fitted(first)
    starts = starts_of(flights, library, first)
    fitted = {given: first}
    bases = {given: likelihood.base(first, starts)}

    def base(setting: Setting, unknown: bool = False) -> Base:
        lags = {
            c: x
            for c, x in starts.items()
            if not flights.is_nonlinear(c.effect) and c.effect not in setting
        }
        return likelihood.base(setting, lags, unknown=unknown)

    def add(setting: Setting) -> None:
        key = frozenset(setting)
        if any(map(flights.is_nonlinear, setting)):  # a linearisation elsewhere says little
            near = fitted[max(fitted, key=lambda other: len(other & key))]
            begun = {e: near.get(e, x) for e, x in setting.items()}
            setting = min(setting, begun, key=likelihood.objective)
        fitted[key] = best = likelihood.fitted(setting)
        own = key - given
        possible = all(is_possible(flights, best, {}, e, plausible=True) for e in own)
        if possible and not likelihood.is_idle(best, own):
            bases[key] = base(best)

    for effect in library:
        if not flights.is_nonlinear(effect) or effect in given:
            continue
        report(f"trying {effect}")
        each = ({**first, effect: dict(x)} for c, x in starts.items() if c.effect == effect)
        if own := sorted(each, key=likelihood.objective):
            near = map(likelihood.fitted, own[:MOST_STARTS])
            add(min(near, key=likelihood.objective))

    def posterior() -> Posterior:
        idle = fitted.keys() - bases.keys()
        return Posterior(flights, library, [*bases.values()], likelihood.power, given, idle)

    def likeliest() -> Setting:
        """Return the likeliest set's fit, once no unfitted set is likelier. With measured rotors
        the sets with one effect less are fitted as well.
        """
        while True:
            setting = posterior().best_setting()
            new = [setting]
            if (key := frozenset(setting)) in bases:
                best = fitted[key]
                less = [without(best, out) for out in best if out not in given]
                new = [x for x in less if not flights.commanded and frozenset(x) not in fitted]
            if not new:
                return best
            for some in new:
                report(f"trying {', '.join(e for e in some if e not in given) or 'no effect'}")
                add(some)

    likeliest()
    likelihood.power = posterior().tempering()
    best = likeliest()
    bases.pop(frozenset(best))  # the last base has the dictionary
    bases[frozenset(best)] = base(best, unknown=True)
    return likelihood, best, posterior()
