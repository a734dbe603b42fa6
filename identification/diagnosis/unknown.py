"""The probability of a cause outside the library.

Three signs speak for one: a column of the dictionary with much of the likeliest set's residual; a
push; and, without a named effect, a disturbance too large to be none. The first is a Bayes factor.
The weights of the others are fitted to flights with known truth.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

# nats, beyond which a sign counts no more
MOST_STRUCTURE, MOST_DISTURBANCE = 15.0, 3.0


@dataclass(frozen=True)
class UnknownSettings:
    """The weights, in nats. ``tests/evidence/test_numbers.py`` fits them anew."""

    nothing: float = -2.3  # log odds without any sign
    disturbance: float = 1.89  # for a nat of a disturbance over a negligible one
    push: float = 0.17


UNKNOWN = UnknownSettings()


def signs(structure: float, disturbance: float, push: bool, named: bool) -> tuple[float, ...]:
    """Return the factors of the weights.

    Args:
        structure: logarithm of the Bayes factor of one more column beside the likeliest set.
        disturbance: logarithm of the largest disturbance over a negligible one. It counts without a
            named effect only: a turbulence named with a wind is no sign of more.
        push: whether there is a transient disturbance.
        named: whether an effect is named.
    """
    strength = 0.0 if named else min(max(disturbance, 0.0), MOST_DISTURBANCE)
    return 1.0, min(max(structure, 0.0), MOST_STRUCTURE), strength, float(push)


def unknown(factors: Sequence[float]) -> float:
    """Return the probability, by the ``signs``, of a cause outside the likeliest set."""
    weights = (UNKNOWN.nothing, 1.0, UNKNOWN.disturbance, UNKNOWN.push)
    odds = sum(a * x for a, x in zip(weights, factors, strict=True))
    return 1.0 / (1.0 + math.exp(-odds))
