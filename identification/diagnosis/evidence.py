"""The evidence of a set of effects, from sums of products: a coefficient's prior, its bounds, and
Laplace's integral.

Everything is in prior standard deviations. The nuisances of any flight are integrated out first: a
set costs a small Cholesky factor.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from ... import _core
from ..logs.table import Array, ArrayPair
from .column import Column

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class SetEvidence:
    """The evidence of one set of effects, and the mode of its posterior."""

    log_evidence: float
    mode: Array  # (n,) of n columns, in prior standard deviations
    std: Array  # (n,)


@dataclass(frozen=True, eq=False)
class Marginal:
    """A quadratic log-likelihood of the coefficients asked about, with all others integrated out:
    ``constant + right @ z - z @ normal @ z / 2``.

    The prior of a coefficient is normal with mean zero and standard deviation one, cut off at its
    bounds.
    """

    place: Mapping[Column, int]  # the index of each of c columns
    low: Array  # (c,) bounds, at most zero
    high: Array  # (c,) at least zero
    normal: Array  # (c, c)
    right: Array  # (c,)
    deviance: float  # with the coefficients at zero, and the others at their mode
    log_volume: float  # minus the logarithm of the integrated volume

    @classmethod
    def of(
        cls,
        columns: Sequence[Column],
        bounds: ArrayPair,
        products: Array,
        asked: Index,
        others: Index,
        size: Array | float = 1.0,
    ) -> "Marginal":
        """Return the log-likelihood with ``others`` integrated out over their normal prior.

        Args:
            columns: (a,) to keep.
            bounds: (a,) least and largest coefficients.
            products: (c + 1, c + 1) of all columns, in prior standard deviations, and of the
                residual: the last is -2 log-likelihood with all coefficients at zero.
            asked: (a,) indices of the kept columns.
            others: columns to integrate out; they may be among the kept ones as well.
            size: (len(others),) standard deviations of this prior, with mean zero.
        """
        size = np.full(len(others), size)
        kept = np.append(asked, len(products) - 1)
        inner = products[np.ix_(others, others)] * size[:, None] * size + np.eye(len(others))
        factor = np.linalg.cholesky(inner)
        known = solve_triangular(factor, products[np.ix_(others, kept)] * size[:, None], lower=True)
        left = products[np.ix_(kept, kept)] - known.T @ known
        volume = float(np.log(np.diagonal(factor)).sum())
        place = {c: i for i, c in enumerate(columns)}
        return cls(place, *bounds, left[:-1, :-1], left[:-1, -1], float(left[-1, -1]), volume)

    @property
    def constant(self) -> float:
        """The log-likelihood with all coefficients at zero."""
        return -0.5 * self.deviance - self.log_volume

    @property
    def own(self) -> Array:
        """The columns' products with themselves (c,), less the others' share."""
        return np.maximum(np.diagonal(self.normal), 1e-9)

    def at(self, columns: Iterable[Column]) -> tuple[Index, Array, Array]:
        """Return the indices of some columns, and their part of ``normal`` and ``right``."""
        at = np.array([self.place[c] for c in columns], dtype=np.intp)
        return at, self.normal[at[:, None], at], self.right[at]

    def explained(self, columns: Iterable[Column], z: Array) -> float:
        """Return the deviance explained by some columns at coefficients ``z``."""
        _, normal, right = self.at(columns)
        return float(2.0 * right @ z - z @ normal @ z)

    def gain(self, columns: Sequence[Column]) -> float:
        """Return the deviance explained by some columns at their mode."""
        return self.explained(columns, self.evidence(columns).mode)

    def evidence(self, columns: Iterable[Column]) -> SetEvidence:
        """Return the evidence of a set's columns. With the mode at a bound, the integral is of a
        normal density cut off there.

        Raises:
            numpy.linalg.LinAlgError: no prior tells columns of the set apart.
        """
        at, normal, right = self.at(columns)
        mode, std = np.empty((2, len(at)))
        value = _core.evidence(normal, right, self.low[at], self.high[at], mode, std)
        if math.isnan(value):
            raise np.linalg.LinAlgError("no prior tells columns of the set apart")
        return SetEvidence(self.constant + value, mode, std)


def bounded_mode(normal: Array, right: Array, low: Array, high: Array) -> Array:
    """Return the maximum (n,) of ``right @ x - x @ normal @ x / 2`` within bounds. Coefficients
    outside are held at their bounds, the farthest first, and are free again if pulled back.

    Raises:
        numpy.linalg.LinAlgError: ``normal`` is singular.
    """
    mode = np.empty(len(right))
    if not _core.bounded_mode(normal, right, low, high, mode):
        raise np.linalg.LinAlgError("the matrix of a bounded mode is singular")
    return mode


def tempering(blocks: Array, chosen: Index) -> float:
    """Return the power of the likelihood by its own scatter over blocks, at most one.

    The sum over blocks assumes their independence. An error of the model may last longer than a
    sample, like the rounding of rotor speeds that hardly leave their steps. Then the scores of the
    blocks scatter more than their sums of squares, and the likelihood is too sure by as much.
    (The magnitude adjustment of composite likelihoods: F. Pauli, W. Racugno and L. Ventura,
    Statistica Sinica 21 (2011), 149-164.)

    Args:
        blocks: (blocks, c + 1, c + 1) products of columns and residual, in prior standard
            deviations.
        chosen: the fitted columns.
    """
    total = blocks.sum(axis=0)
    normal = total[np.ix_(chosen, chosen)]
    mode = np.linalg.solve(normal + np.eye(len(chosen)), total[chosen, -1])
    scores = blocks[:, chosen, -1] - blocks[:, chosen[:, None], chosen] @ mode
    known = np.diagonal(normal) > 1.0  # columns better known by the flight than by the prior
    if not known.any():
        return 1.0
    # the scores as independent ones: in the eigenvectors of their expected products
    size, axes = np.linalg.eigh(normal[np.ix_(known, known)])
    keep = size > 1e-6 * size[-1]
    ratio = np.square(scores[:, known] @ axes[:, keep]).sum(axis=0) / size[keep]
    # a fit brings their sum over all blocks to zero: the cost is one block of all
    return 1.0 / max(1.0, float(np.mean(ratio)) * len(blocks) / max(len(blocks) - 1, 1))


def evidence_of_one_more(m: Marginal, tried: Index, sizes: Sequence[float]) -> float:
    """Return the logarithm of the Bayes factor of one further column, any of those tried, against
    none.

    Each of the columns is equally likely, with each size. An effect outside the library follows few
    of the many variables of a dictionary: a variance for all of them at once would pay for each.

    Args:
        m: the likelihood of further columns beside a model.
        tried: the possible ones of these columns.
        sizes: possible standard deviations of their coefficients.
    """
    square = np.square(sizes)[:, None]
    left = m.own[tried]
    gained = 0.5 * square * np.square(m.right[tried]) / (1.0 + square * left)
    factors = gained - 0.5 * np.log1p(square * left)
    return float(logsumexp(factors, b=1.0 / factors.size))
