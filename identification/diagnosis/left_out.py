"""Whether an effect helps where it was not fitted: leave-one-out cross-validation of the log
predictive density (A. Vehtari, A. Gelman and J. Gabry, Statistics and Computing 27 (2017),
1413-1432).

Each flight is left out in turn, or each block of a single flight. The rest fits the coefficients of
a set with an effect, and without. The gain of a block left out is the difference of both
log-likelihoods, with the nuisances integrated out over their priors, as for a new flight.

Blocks show an effect more or less. So a block's gain is expected to be half the deviance of the
effect's own change in this block, and gains scatter about the expected ones. Blocks with other
coefficients than the rest scatter by as much as they gain. Blocks are few: the bound is one of
Student's distribution.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import stdtrit

from ..logs.table import Array, Pair
from .column import Column
from .evidence import Marginal
from .priors import Base

CONFIDENCE = 0.95  # that a gain is above its bound


class LeftOut:
    """The likelihood of flights with parts left out.

    Args:
        base: the likelihood.
        columns: (c,) of the effects asked about.
        power: the likelihood's power.

    Attributes:
        least: standard errors of a gain beyond chance; minus infinity for a single block, with no
            rest for a fit.
    """

    def __init__(self, base: Base, columns: Sequence[Column], power: float) -> None:
        at = base.at(columns)
        bounds = base.low[at], base.high[at]
        asked, others = (np.searchsorted(base.single, x) for x in (at, base.plain))

        def likelihood(products: Array) -> Marginal:
            return Marginal.of(columns, bounds, power * products, asked, others)

        count = len(base.blocks)
        self.least = float(stdtrit(count, CONFIDENCE)) if count > 1 else -math.inf
        part = base.flight if np.ptp(base.flight) else np.arange(count)
        total = base.blocks.sum(axis=0)
        # the likelihood of the rest of each part, and those of its blocks
        self._parts = [
            (likelihood(total - own.sum(axis=0)), [*map(likelihood, own)])
            for own in (base.blocks[part == i] for i in np.unique(part))
        ]

    def gain(self, less: Sequence[Column]) -> Pair:
        """Return the gain in log predictive density of all blocks, nats, and its standard error, of
        all columns over some.
        """
        gained = square = 0.0
        for rest, blocks in self._parts:
            fitted = rest.evidence(rest.place).mode
            change = fitted.copy()
            change[[rest.place[c] for c in less]] -= rest.evidence(less).mode
            for block in blocks:
                off = float(change @ (block.right - block.normal @ fitted))
                gained += off + 0.5 * float(change @ block.normal @ change)
                square += off * off
        return gained, math.sqrt(square)
