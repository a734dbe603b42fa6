"""The evidence of a set of effects, from sums of products: a coefficient's prior, its bounds, and
Laplace's integral.

Everything is in prior standard deviations. What any flight may have beside effects is integrated
out first, so a set costs a small Cholesky factor.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from ...runtime.compiled import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Marginal:
    """A quadratic log-likelihood of the coefficients that are asked about, with all others
    integrated out: ``constant + right @ z - z @ normal @ z / 2``.
    """

    normal: Array  # (c, c)
    right: Array  # (c,)
    deviance: float  # where those asked about are zero, and the others at their mode
    log_volume: float  # of what was integrated out: minus its logarithm

    @property
    def constant(self) -> float:
        """The log-likelihood where those asked about are zero."""
        return -0.5 * self.deviance - self.log_volume

    @property
    def own(self) -> Array:
        """The columns' products with themselves (c,), less what the others have already."""
        return np.maximum(np.diagonal(self.normal), 1e-9)

    def explained(self, index: Sequence[int], z: Array) -> float:
        """Return the deviance that some columns explain at coefficients ``z``."""
        right, normal = self.right[index], self.normal[np.ix_(index, index)]
        return float(2.0 * right @ z - z @ normal @ z)


def marginal(products: Array, asked: Index, others: Index, size: Array) -> Marginal:
    """Return the log-likelihood with ``others`` integrated out over their standard normal prior.

    Args:
        products: (c + 1, c + 1) of all columns, in prior standard deviations, and of the residual:
            the last is -2 log-likelihood where all coefficients are zero.
        asked: columns that stay.
        others: columns that go; they may be among those that stay as well.
        size: (len(others),) standard deviations of their prior.
    """
    kept = np.append(asked, len(products) - 1)
    inner = products[np.ix_(others, others)] * size[:, None] * size + np.eye(len(others))
    factor = np.linalg.cholesky(inner)
    cross = products[np.ix_(others, kept)] * size[:, None]
    known = solve_triangular(factor, cross, lower=True)
    left = products[np.ix_(kept, kept)] - known.T @ known
    volume = float(np.log(np.diagonal(factor)).sum())
    return Marginal(left[:-1, :-1], left[:-1, -1], float(left[-1, -1]), volume)


@dataclass(frozen=True, eq=False)
class SetEvidence:
    """The evidence of one set of effects, and where its posterior has its mode."""

    log_evidence: float
    mode: Array  # (len(index),) in prior standard deviations
    std: Array  # (len(index),)


def set_evidence(m: Marginal, index: Sequence[int], low: Array, high: Array) -> SetEvidence:
    """Return the evidence of a set.

    The prior of a coefficient is normal with mean zero and standard deviation one, cut off at its
    bounds. Where the mode is at a bound, the integral is that of a normal density cut off there.

    Args:
        m: the likelihood.
        index: the set's columns.
        low: (c,) bounds of all columns, at most zero.
        high: (c,) at least zero.

    Raises:
        numpy.linalg.LinAlgError: columns of the set that no prior tells apart.
    """
    value, mode, std = _evidence(m.normal, m.right, np.array(index, dtype=np.intp), low, high)
    return SetEvidence(m.constant + value, mode, std)


@compiled
def _evidence(
    every: Array, slopes: Array, at: np.ndarray, low: Array, high: Array
) -> tuple[float, Array, Array]:
    """Return the logarithm of the evidence of the columns ``at`` (n,), their mode and standard
    deviations.
    """
    right, lo, hi, value = slopes[at], low[at], high[at], 0.0
    if len(at) == 0:
        return value, right, lo
    normal = every[at][:, at] + np.eye(len(at))
    factor = np.linalg.cholesky(normal)
    mode = bounded_mode(normal, right, lo, hi)
    slope = right - normal @ mode
    for i in range(len(at)):
        value += 0.5 * mode[i] * (right[i] + slope[i]) - math.log(factor[i, i])
        if mode[i] <= lo[i] or mode[i] >= hi[i]:
            # int_0^inf exp(-s t - h t^2 / 2) dt over the whole normal integral of curvature h
            value += _log_tail(abs(slope[i]) / math.sqrt(normal[i, i]))
        value -= math.log(max(_normal(hi[i]) - _normal(lo[i]), 1e-12))
    return value, mode, np.sqrt(np.diag(np.linalg.inv(normal)))


@compiled
def _normal(x: float) -> float:
    """Return how much of a standard normal density lies below ``x``."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


@compiled
def _log_tail(z: float) -> float:
    """Return ``z**2 / 2`` plus the logarithm of how much of a standard normal density lies beyond
    ``z``, at least zero.
    """
    if z < 10.0:
        return 0.5 * z * z + math.log(_normal(-z))
    w = 1.0 / (z * z)  # M. Abramowitz and I. Stegun, Handbook (1964), 26.2.12
    return -math.log(z * math.sqrt(2.0 * math.pi)) + math.log1p(-w * (1.0 - w * (3.0 - 15.0 * w)))


@compiled
def bounded_mode(normal: Array, right: Array, low: Array, high: Array) -> Array:
    """Return the maximum (n,) of ``right @ x - x @ normal @ x / 2`` within bounds: what leaves them
    is held there, the farthest first, and what is pulled back is free again.
    """
    n = len(right)
    mode = np.empty(n)
    mode[:] = np.linalg.solve(normal, right)
    size, held = np.sqrt(np.diag(normal)), np.zeros(n, dtype=np.bool_)
    for _ in range(3 * n):
        beyond = np.maximum(low - mode, mode - high)
        pull = right - normal @ mode
        inwards = np.where(mode >= high, -pull, pull)
        outside, back = ~held & (beyond > 1e-12), held & (inwards > 1e-9)
        if outside.any():
            worst = np.argmax(np.where(outside, beyond * size, 0.0))
            held[worst] = True
            mode[worst] = min(max(mode[worst], low[worst]), high[worst])
        elif back.any():
            held[np.argmax(np.where(back, inwards, 0.0))] = False
        else:
            break
        free = np.flatnonzero(~held)
        left = right - normal @ np.where(held, mode, 0.0)
        mode[free] = np.linalg.solve(normal[free][:, free], left[free])
    mode[:] = np.minimum(np.maximum(mode, low), high)
    return mode


def tempering(blocks: Array, chosen: Index) -> float:
    """Return the power of the likelihood that its own scatter over blocks allows, at most one.

    Blocks are summed as if they were independent. Where what the model lacks lasts longer than a
    sample, as the rounding of rotor speeds does that hardly leave their steps, the scores of the
    blocks scatter by more than the sums of squares say, and by as much the likelihood is too sure.
    (The magnitude adjustment of composite likelihoods: F. Pauli, W. Racugno and L. Ventura,
    Statistica Sinica 21 (2011), 149-164.)

    Args:
        blocks: (blocks, c + 1, c + 1) products of columns and residual, in prior standard
            deviations.
        chosen: columns that are fitted.
    """
    total = blocks.sum(axis=0)
    normal = total[np.ix_(chosen, chosen)] + np.eye(len(chosen))
    mode = np.linalg.solve(normal, total[chosen, -1])
    scores = blocks[:, chosen, -1] - blocks[:, chosen[:, None], chosen] @ mode
    known = np.diagonal(total)[chosen] > 1.0  # columns of which the flight says more than the prior
    if not known.any():
        return 1.0
    # the scores as independent ones: in the eigenvectors of what they should be
    size, axes = np.linalg.eigh(total[np.ix_(chosen, chosen)][np.ix_(known, known)])
    keep = size > 1e-6 * size[-1]
    ratio = np.square(scores[:, known] @ axes[:, keep]).sum(axis=0) / size[keep]
    # their sum over all blocks is zero where they are fitted: that costs one block of all
    spread = float(np.mean(ratio)) * len(blocks) / max(len(blocks) - 1, 1)
    return 1.0 / max(1.0, spread)


def evidence_of_one_more(m: Marginal, tried: Sequence[int], sizes: Sequence[float]) -> float:
    """Return the logarithm of the Bayes factor of one further column, no one knows which, against
    none.

    Each of the columns is as likely as each other, of each size. An effect that is in no library
    follows few of the many things that a dictionary holds: a variance for all of them at once would
    pay for each.

    Args:
        m: the likelihood of further columns beside a model.
        tried: those of them that it may be.
        sizes: standard deviations that their coefficients may have.
    """
    square, left = np.square(np.asarray(sizes))[:, None], m.own[tried]
    gained = 0.5 * square * np.square(m.right[tried]) / (1.0 + square * left)
    factors = gained - 0.5 * np.log1p(square * left)
    return float(logsumexp(factors)) - math.log(factors.size)
