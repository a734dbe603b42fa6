"""The probability of a cause outside the library, and of a name beside such a cause.

Two signs speak for a cause outside: columns of the dictionary with much of the likeliest set's
residual, and a transient disturbance. The first is a Bayes factor. The weight of the second is
fitted to flights with known truth. A gust is neither: the likelihood has a disturbance of its own.
"""

import math

MOST_STRUCTURE = 15.0  # nats, beyond which a Bayes factor counts no more
# the weights, in nats: log odds before the flight, one in ten. Stated, not fitted: 29 % of the kept
# flights have such a cause by design
NOTHING = -2.2
PUSH = 2.24  # ``tests/evidence/test_numbers.py`` fits this weight anew
# odds of the share of such a cause explained by effects of the library: 98 % in the mean. Stated,
# not fitted: most kept causes are twins of effects, and their share is larger
ABSORBED = 50.0


def clipped(structure: float) -> float:
    """Return the logarithm of the Bayes factor of a cause outside, as far as a sign counts."""
    return min(max(structure, -MOST_STRUCTURE), MOST_STRUCTURE)


def unknown(structure: float, push: bool) -> float:
    """Return the probability of a cause outside the likeliest set.

    Args:
        structure: logarithm of the Bayes factor of a cause outside beside the likeliest set.
        push: whether there is a transient disturbance.
    """
    return 1.0 / (1.0 + math.exp(-NOTHING - clipped(structure) - PUSH * push))


def beside_unknown(probability: float, factor: float, structure: float, strange: float) -> float:
    """Return the probability of a name.

    Effects of the library explain most of a cause outside, and its rest shows as structure. Let x
    be the explained share, with the density ``absorbed * x**(absorbed - 1)``. A cause whose rest is
    ``structure`` can be all of a name only with a share of at least ``factor / (factor +
    structure)``.

    Args:
        probability: given the library.
        factor: logarithm of the Bayes factor of the set over the set without this name.
        structure: as of ``unknown``.
        strange: probability of a cause outside.
    """
    least = 1.0 / (1.0 + max(structure, 0.0) / max(factor, 1e-9))
    return probability * (1.0 - strange * (1.0 - math.pow(least, ABSORBED)))
