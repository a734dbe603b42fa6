"""Whether two effects together would explain what one effect with several coefficients explains.

An effect that brings several free numbers can stand for two that have nothing in common:
in a hover four rotor efficiencies are any constant thrust and torque. Whoever asks for a single
other cause alone does not see that. A pair counts where it needs no more coefficients than the
effect itself really uses, so a single weak rotor, one number, is not doubted for four.
"""

from itertools import combinations

from .equivalence import EQUIVALENCE, limit_of
from .gram_matrix import gram
from .regression import CENTRAL, is_nonlinear
from .search import FittedEffects, Search, coefficient_count


def pair_doubts(search: Search, fit: FittedEffects) -> list[str]:
    """Return, as sentences, which named effects two others of the library may stand for together.

    Args:
        search: the flights and the noise that the search settled on.
        fit: the named effects with their standard deviations.
    """
    if search.flights.commanded:  # every name of them rests on an assumed thrust already
        return []
    found = []
    for effect in fit.effects:
        pairs = _pairs(search, fit, effect)
        if pairs:
            said = ", or ".join(f"{a} and {b}" for a, b in pairs[:3])
            found.append(
                f"{effect}: in these flights {said} together do the same with no more "
                "coefficients: they may be the cause instead"
            )
    return found


def used_coefficients(fit: FittedEffects, effect: str) -> list[str]:
    """Return which of an effect's coefficients differ from zero beyond their uncertainty."""
    return [
        name
        for name, value in fit.setting[effect].items()
        if name != CENTRAL
        and abs(value) > EQUIVALENCE.most_std_apart * fit.std.get((effect, name), 0.0)
        and value != 0.0
    ]


def _pairs(search: Search, fit: FittedEffects, effect: str) -> list[tuple[str, str]]:
    """Return the pairs of effects that explain what an effect explains, given all others."""
    used = len(used_coefficients(fit, effect))
    others = [
        e
        for e in search.library
        if e not in fit.effects and not is_nonlinear(e) and coefficient_count(e) < used
    ]
    if search.is_fixed(effect) or len(others) < 2:
        return []
    flights, less = search.flights, fit.without(effect)
    regression = search.linearise(less)
    part = flights.residual(less.setting) - flights.residual(fit.setting)
    g = gram(flights, less.setting, search.whiten, regression.columns, part)
    total, limit = g.blocks.sum(axis=0), limit_of(search, part)

    def explains(*together: str) -> bool:
        wanted = search.model_columns(less.effects, list(together))
        if not regression.columns.keys() >= set(wanted):
            return False
        index = g.index(wanted)
        if g.error(index) >= limit:
            return False
        change = g.solve(total, index)
        sizes = [search.size(wanted, change, e) for e in together]
        return max(sizes) <= EQUIVALENCE.largest_size

    alone = {e for e in others if explains(e)}  # one of these suffices, and is said as that
    return [
        (a, b)
        for a, b in combinations([e for e in others if e not in alone], 2)
        if coefficient_count(a) + coefficient_count(b) <= used and explains(a, b)
    ]
