"""Which effects a residual needs: forward selection of whole effects, judged on blocks that are left out in turn.

At one setting of coefficients everything is linear: each column is whitened, and all that selection, removal and comparison ask
is in the Gram matrices of the blocks.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..dynamics.effects import get
from .regression import CENTRAL, MOMENT, NUISANCES, SHIFT_RANGE, START, Column, Flights, Setting, coefficient, typical
from .whitening import Whitener

Array = NDArray[np.float64]

PRIOR = 5.0  # typical sizes: standard deviation of a coefficient before anything is seen


def columns_of(effect: str, fitted: bool) -> list[Column]:
    """Return the columns of an effect.

    Whether the law of one that acts rotor by rotor makes a moment is the log's to say: while it is only tried, the moment
    part of each column is free; once it is ``fitted``, the coefficient ``central`` is.
    """
    own = [(effect, c.name) for c in get(effect).coefficients]
    if fitted or (effect, CENTRAL) not in own:
        return own
    own.remove((effect, CENTRAL))
    return own + [(effect, MOMENT + name) for _, name in own]


@dataclass(frozen=True, eq=False)
class Gram:
    """The regression at one setting, as sums over blocks of the fit: (blocks, columns + 1, columns + 1), residual last."""

    columns: tuple[Column, ...]
    design: Array  # (rows of the fit, 6, columns + 1), whitened
    begins: NDArray[np.intp]  # (blocks,) first row of each block
    blocks: Array
    precision: Array  # (columns,) of the prior
    value: Array  # (columns,) coefficients now, of which the prior's mean is zero
    lower: Array  # (columns,) by how much a coefficient may change
    upper: Array

    def index(self, wanted: Sequence[Column]) -> NDArray[np.int64]:
        """Return where these columns are."""
        at = {c: i for i, c in enumerate(self.columns)}
        return np.array([at[c] for c in wanted if c in at], dtype=np.int64)

    def solve(self, gram: Array, index: NDArray[np.int64], bounded: bool = True) -> Array:
        """Return the changes (len(index),) of least squares over these columns within their bounds."""
        change = np.zeros(len(index))
        free = np.arange(len(index))
        for _ in range(len(index) + 1):
            if not len(free):
                break
            at = index[free]
            normal = gram[np.ix_(at, at)] + np.diag(self.precision[at])
            held = np.setdiff1d(np.arange(len(index)), free)
            right = gram[at, -1] - self.precision[at] * self.value[at] - gram[np.ix_(at, index[held])] @ change[held]
            change[free] = np.linalg.solve(normal, right)
            if not bounded:
                break
            low, high = self.lower[index], self.upper[index]
            out = free[(change[free] < low[free]) | (change[free] > high[free])]
            if not len(out):
                break
            change = np.clip(change, low, high)
            free = np.setdiff1d(free, out)
        return change

    def error(self, index: NDArray[np.int64]) -> float:
        """Return the whitened energy on each block of the fit when it is predicted from all others."""
        total = self.blocks.sum(axis=0)
        if not len(index):
            return float(total[-1, -1])
        out = 0.0
        for block in self.blocks:
            change = self.solve(total - block, index)
            out += float(block[-1, -1] - 2 * change @ block[index, -1] + change @ block[np.ix_(index, index)] @ change)
        return out


def gram(flights: Flights, setting: Setting, whiten: Whitener, columns: dict[Column, Array], residual: Array) -> Gram:
    """Return the regression of the residual (rows, 6) at a setting on these columns (rows, 6) each."""
    names = tuple(columns)
    x = np.stack([*columns.values(), residual], axis=2)
    x = np.ascontiguousarray(whiten(x)[flights.fit])
    begins = np.flatnonzero(np.diff(flights.block[flights.fit], prepend=-1))
    parts = (part.reshape(-1, len(names) + 1) for part in np.split(x, begins[1:]))
    blocks = np.array([part.T @ part for part in parts])
    size = np.array([typical(c, flights.vehicle) for c in names])
    value = np.array([setting.get(c[0], {}).get(c[1], 0.0) for c in names])
    low, high = np.empty(len(names)), np.empty(len(names))
    for i, c in enumerate(names):
        if c in NUISANCES:
            low[i], high[i] = SHIFT_RANGE
        elif c[1].startswith(MOMENT):
            low[i], high[i] = -np.inf, np.inf
        elif c[1].startswith(START):
            low[i], high[i] = 0.0, PRIOR
        else:
            low[i], high[i] = coefficient(c).minimum, coefficient(c).maximum
    prior = 1.0 / np.square(PRIOR * np.maximum(size, 1e-300))
    prior[size == 0] = 1e30
    return Gram(names, x, begins, blocks, prior, value, low - value, high - value)
