"""How probable it is that something acts which no effect of the library is.

Three things speak for it: a column of the dictionary that explains what the likeliest set leaves, a
push, and, where nothing is named, a disturbance that is too large to be none. The first is a Bayes
factor; the weights of the others are fitted to flights of which the truth is known.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

# nats, beyond which more says nothing more
MOST_STRUCTURE, MOST_DISTURBANCE = 15.0, 3.0


@dataclass(frozen=True)
class UnknownSettings:
    """The weights, in nats. ``tests/evidence/test_numbers.py`` fits them anew."""

    nothing: float = -2.3  # log odds where nothing speaks for it
    disturbance: float = 1.89  # a nat of a disturbance over what counts for none
    push: float = 0.17


UNKNOWN = UnknownSettings()


def signs(structure: float, disturbance: float, push: bool, named: bool) -> tuple[float, ...]:
    """Return what each weight is multiplied with.

    Args:
        structure: logarithm of the Bayes factor of one more column beside the likeliest set.
        disturbance: logarithm of the largest disturbance over what counts for none. It counts
            where nothing is named: a turbulence that is named with a wind is no sign of more.
        push: whether a transient disturbance was found.
        named: whether an effect is named.
    """
    strength = 0.0 if named else min(max(disturbance, 0.0), MOST_DISTURBANCE)
    return 1.0, min(max(structure, 0.0), MOST_STRUCTURE), strength, float(push)


def unknown(found: Sequence[float]) -> float:
    """Return the probability, by the ``signs``, that the likeliest set is not all that acts."""
    weights = (UNKNOWN.nothing, 1.0, UNKNOWN.disturbance, UNKNOWN.push)
    odds = sum(a * x for a, x in zip(weights, found, strict=True))
    return 1.0 / (1.0 + math.exp(-odds))
