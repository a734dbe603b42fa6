"""How probable each name is: the posterior of the flight's poses and the verdict of the search,
pooled.

The posterior knows what the likelihood says of each set of effects, and takes for granted that
nothing acts but effects of the library. The search knows whether a name withstood its checks, and
whether the residual has structure left. Each is an expert, and a weighted sum of logarithms (a
logarithmic opinion pool: C. Genest and J. V. Zidek, Statistical Science 1 (1986), 114-135) makes
one probability of both. The weights are fitted to flights of which the truth is known: so the
probability of a name is the frequency with which such names are right on such flights.

An explanation is a set of effects. Its score is the logarithm of its evidence, tempered, and a
weight for each of its effects: one that the search is sure of, one that it calls tentative, one
that it does not name. Beside them stands the explanation that something acts which no effect of the
library is; then no name counts as right, because what is named imitates it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..findings import Alternative, Probabilities

Array = NDArray[np.float64]
Explanations = dict[frozenset[str], float]


@dataclass(frozen=True)
class PoolingSettings:
    """The weights, in nats. ``python -m studies.probabilities`` fits them."""

    # below the likeliest set: no likelihood is so right that its tails further out count
    most_worse: float = 10.0
    evidence: float = 0.41  # a nat of the posterior, between sets
    sure: float = 1.91  # an effect that the search names
    tentative: float = -0.02  # one that it names with a doubt
    other: float = -5.22  # one that it does not name
    # log odds that something unknown acts where no sign speaks, and what each sign adds
    unknown: float = -6.4
    tests: float = 2.71  # the first of ``Signs.tests``
    further: float = 1.06  # each further one
    doubts: float = 5.49  # any of ``Signs.doubts``
    nothing: float = 2.95  # nothing is named
    disturbance: float = 4.15  # and then a nat of ``Signs.disturbance``
    unsure: float = 2.94  # a name is tentative
    structure: float = 0.07  # a nat of ``Signs.structure``
    disturbance_range: tuple[float, float] = (-1.0, 4.0)  # nats
    structure_range: tuple[float, float] = (-2.0, 15.0)  # nats
    least: float = 0.001  # probability of an alternative that is reported


POOLING = PoolingSettings()
# the weights of ``Signs.numbers``, in their order
SIGNS = (
    "unknown",
    "tests",
    "further",
    "doubts",
    "nothing",
    "disturbance",
    "unsure",
    "structure",
)
# Where there is no posterior, by what the motion is read from: a pose of a vehicle that declares
# effects, an IMU, or a pose that was filtered before it was logged. An explanation is then what the
# search names, or a part of it
SEARCH_ALONE: Mapping[str, PoolingSettings] = {
    "pose": PoolingSettings(
        evidence=0.0,
        sure=4.33,
        tentative=0.86,
        other=0.0,
        unknown=-6.41,
        tests=2.86,
        further=1.26,
        doubts=5.3,
        nothing=2.97,
        disturbance=4.14,
        unsure=3.14,
        structure=0.0,
    ),
    "imu": PoolingSettings(
        evidence=0.0,
        sure=3.21,
        tentative=1.39,
        other=0.0,
        unknown=-1.86,
        tests=1.37,
        further=3.72,
        doubts=1.63,
        nothing=1.33,
        disturbance=1.38,
        unsure=0.12,
        structure=0.0,
    ),
    "filtered": PoolingSettings(
        evidence=0.0,
        sure=2.0,
        tentative=1.13,
        other=0.0,
        unknown=-1.45,
        tests=2.01,
        further=1.65,
        doubts=-0.31,
        nothing=0.31,
        disturbance=-0.31,
        unsure=-0.31,
        structure=0.0,
    ),
}


class Named(Protocol):
    """A name of the search."""

    @property
    def name(self) -> str:
        """Of the effect."""

    @property
    def tentative(self) -> bool:
        """Whether it may stand for something else."""

    @property
    def indistinguishable_from(self) -> Sequence[str]:
        """Effects that it may stand for."""


def explanations(
    named: Sequence[Named], sets: Sequence[tuple[Sequence[str], float]]
) -> Explanations:
    """Return how likely each explanation is by the posterior, in nats below the likeliest.

    An effect that the flights cannot tell from a named one counts as that one. Whatever the search
    names is an explanation, and so are its parts, though the posterior may never have tried them.

    Args:
        named: by the search.
        sets: effects and probability of the posterior's sets.
    """
    own = {e.name for e in named}
    same = {x: e.name for e in reversed(named) for x in e.indistinguishable_from if x not in own}
    shares: dict[frozenset[str], float] = {}
    for effects, probability in sets:
        key = frozenset(same.get(e, e) for e in effects)
        shares[key] = shares.get(key, 0.0) + probability
    most = max(shares.values(), default=1.0)
    every = [frozenset(own), frozenset[str](), *(frozenset([e]) for e in own)]
    every += [frozenset(own - {e}) for e in own]
    for key in every:
        shares.setdefault(key, 0.0)
    least = np.exp(-POOLING.most_worse)
    return {key: float(np.log(max(x / most, least))) for key, x in shares.items()}


def features(named: Sequence[Named], found: Explanations) -> Array:
    """Return of each explanation (s, 4) its evidence and how many of its effects are sure,
    tentative, and not named.
    """
    sure = {e.name for e in named if not e.tentative}
    doubted = {e.name for e in named if e.tentative}
    return np.array(
        [
            [x, len(key & sure), len(key & doubted), len(key - sure - doubted)]
            for key, x in found.items()
        ],
        dtype=np.float64,
    )


@dataclass(frozen=True)
class Signs:
    """What speaks for something unknown.

    Attributes:
        tests: how many kinds of tests show structure in the residual. One may be chance; where the
            library lacks the effect, several speak.
        doubts: how many checks of names say that another effect may be the cause.
        disturbance: logarithm of the largest disturbance over what counts for none. It counts
            where nothing is named: a name that stands for an unknown cause takes its disturbance.
        structure: of the posterior, ``Ranking.structure``.
    """

    tests: int
    doubts: int
    disturbance: float
    structure: float

    def numbers(self, named: Sequence[Named]) -> Array:
        """Return them as numbers (8,); the first is one."""
        return np.array(
            [
                1.0,
                self.tests > 0,
                max(self.tests - 1, 0),
                self.doubts > 0,
                not named,
                0.0 if named else np.clip(self.disturbance, *POOLING.disturbance_range),
                any(e.tentative for e in named),
                np.clip(self.structure, *POOLING.structure_range),
            ],
            dtype=np.float64,
        )


def pooled(
    named: Sequence[Named],
    sets: Sequence[tuple[Sequence[str], float]],
    signs: Signs,
    weights: PoolingSettings = POOLING,
) -> Probabilities:
    """Return how probable names, explanations and something unknown are.

    Args:
        named: by the search.
        sets: effects and probability of the posterior's sets.
        signs: of something unknown.
        weights: of the pool.
    """
    w = weights
    found = explanations(named, sets)
    score = features(named, found) @ np.array([w.evidence, w.sure, w.tentative, w.other])
    share = np.exp(score - score.max())
    share /= share.sum()
    by_sign = np.array([getattr(w, sign) for sign in SIGNS])
    odds = signs.numbers(named) @ by_sign
    unknown = float(1.0 / (1.0 + np.exp(-odds)))
    share *= 1.0 - unknown
    names = {e.name: 0.0 for e in named}
    for key, p in zip(found, share.tolist(), strict=True):
        for effect in key:
            names[effect] = names.get(effect, 0.0) + p
    order = np.argsort(-share, kind="stable")
    keys = list(found)
    alternatives = tuple(
        Alternative(tuple(sorted(keys[i])), float(share[i])) for i in order if share[i] >= w.least
    )
    return Probabilities(names, alternatives, unknown)
