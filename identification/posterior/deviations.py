"""Standard deviations of coefficients, from two estimates of each.

The search takes a coefficient from the residual below 5 Hz, with noise from a zero-phase whitening;
the posterior from the innovations, at all frequencies and with disturbances that last as long as
they do. Each gets something wrong that its own deviation does not know. Where the two errors are
independent and alike, half the square of their difference is the variance of either.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from ..findings import NamedEffect, Ranking


def of_two_estimates(std: float, value: float, other: float) -> float:
    """Return the standard deviation of ``value``, of which another estimate is ``other``, and
    ``std`` the deviation by its own noise.
    """
    return math.hypot(std, (value - other) / math.sqrt(2.0))


def with_both_estimates(
    effects: Sequence[NamedEffect], ranking: Ranking
) -> tuple[NamedEffect, ...]:
    """Return named effects with the standard deviations that both estimates of each coefficient
    allow; an effect that is in no set stays as it is.

    Args:
        effects: of the search.
        ranking: the posterior.
    """
    out = []
    for effect in effects:
        likeliest = ranking.likeliest_with(effect.name)
        other = likeliest.coefficients[effect.name] if likeliest else {}
        std = {
            name: of_two_estimates(value, effect.coefficients[name], other[name])
            if name in other and name in effect.coefficients and value > 0.0
            else value
            for name, value in effect.std.items()
        }
        out.append(replace(effect, std=std))
    return tuple(out)
