"""Which other effect would have left the same traces: decided from the flights and the laws, not from the noise's luck.

An effect's own part of the residual is projected on the columns of another one. What is left over is the energy, in units of
the noise, by which the flights can tell the two apart.
"""

from .search import Fit, Search
from .selection import PRIOR, gram

APART = 30.0  # whitened energy; five standard deviations and a little
APART_SHARE = 0.001  # of the effect's own energy: laws are no truer than that
_NEAR = 40.0  # times the limit: what the linear fit leaves of an effect that is worth a fit of its own
_PLAUSIBLE = 1.2 * PRIOR  # typical sizes


def equivalents(search: Search, fit: Fit, effect: str) -> list[str]:
    """Return the effects of the library that would explain what ``effect`` explains, given all others of the fit."""
    flights = search.flights
    less = fit.without(effect)
    regression = search.linearise(less)
    whole = flights.residual(fit.setting)
    part = flights.residual(less.setting) - whole
    g = gram(flights, less.setting, search.whiten, regression.columns, part)
    limit = max(APART, APART_SHARE * search.whitened_energy(part))
    out = []
    for other in search.gains(less, regression, g):
        if other.effect == effect or other.size > _PLAUSIBLE or other.left > _NEAR * limit:
            continue
        # what is far from linear is fitted to the flights themselves
        swapped = search.refit(other.fit)
        if search.whitened_energy(flights.residual(swapped.setting) - whole) < limit:
            out.append(other.effect)
    return out
