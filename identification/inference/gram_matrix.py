"""The regression as Gram matrices of blocks, with priors and bounds of coefficients.

At one setting of coefficients everything is linear: each column is whitened, and selection, removal
and comparison of effects need the Gram matrices of the blocks alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Role, get
from .regression import (
    CENTRAL,
    MOMENT_PREFIX,
    START_PREFIX,
    Column,
    Flights,
    Setting,
    coefficient,
    range_of,
    typical_size,
    unit_of_change,
)
from .sensor_bias import BIAS, flight_and_axis, is_bias
from .time_offsets import timing_of
from .whitening import Whitener

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GramSettings:
    """Priors and bounds of coefficients, and the limits of the bounded least squares."""

    most_missing_mass: float = 0.9  # share of the declared mass
    iterations_per_column: int = 4  # of the search for the bounds that hold
    least_gradient: float = 1e-6  # in standard deviations; a smaller one is none
    prior_std: float = 5.0  # typical sizes, of a coefficient before anything is seen


GRAM = GramSettings()


def columns_of(effect: str, fitted: bool) -> list[Column]:
    """Return the columns of an effect.

    Whether an effect that acts rotor by rotor makes a moment is a question to the log: while it is
    only tried, the moment part of each column is free; once it is ``fitted``, the coefficient
    ``central`` is.
    """
    own = [(effect, c.name) for c in get(effect).coefficients]
    if fitted or (effect, CENTRAL) not in own:
        return own
    own.remove((effect, CENTRAL))
    return own + [(effect, MOMENT_PREFIX + name) for _, name in own]


@dataclass(frozen=True, eq=False)
class Gram:
    """The regression at one setting, as sums over blocks of the fit: (blocks, columns + 1, columns
    + 1), residual last.
    """

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

    def solve(self, gram: Array, index: NDArray[np.int64]) -> Array:
        """Return the changes (len(index),) of least squares over these columns
        within their bounds.
        """
        return self._solve(gram, index)[0]

    def _solve(self, gram: Array, index: NDArray[np.int64]) -> tuple[Array, NDArray[np.bool_]]:
        """Return the changes and which of them are free of their bounds.

        An active set, as in Stark and Parker, Bounded-Variable Least-Squares, Computational
        Statistics 10 (1995).
        """
        normal = gram[np.ix_(index, index)] + np.diag(self.precision[index])
        right = gram[index, -1] - self.precision[index] * self.value[index]
        low, high = self.lower[index], self.upper[index]
        change = np.zeros(len(index))  # allowed: bounds lie on either side of the value now
        free = np.ones(len(index), dtype=bool)
        scale = 1.0 / np.sqrt(np.diagonal(normal))
        for _ in range(GRAM.iterations_per_column * len(index)):
            if free.any():
                step = np.linalg.solve(normal[np.ix_(free, free)], (right - normal @ change)[free])
                room = np.where(step > 0, high[free] - change[free], change[free] - low[free])
                share = np.where(
                    np.abs(step) > GRAM.least_gradient * scale[free],
                    room / np.maximum(np.abs(step), 1e-300),
                    np.inf,
                )
                first = float(share.min())
                change[free] += min(first, 1.0) * step
                if first < 1.0:  # the first to reach its bound stays there for now
                    i = int(np.argmin(share))
                    at = np.flatnonzero(free)[i]
                    change[at], free[at] = high[at] if step[i] > 0 else low[at], False
                    continue
            # a coefficient at its bound that would come back is freed
            pull = (right - normal @ change) * scale
            inwards = np.where(change >= high, -pull, pull)
            inwards[free | (low >= high)] = 0.0
            if inwards.max(initial=0.0) < GRAM.least_gradient:
                break
            free[int(np.argmax(inwards))] = True
        return change, free

    def error(self, index: NDArray[np.int64]) -> float:
        """Return the deviance on each block of the fit when it is predicted from all others.

        A coefficient that the whole fit holds at a bound is held there for every block.
        """
        total = self.blocks.sum(axis=0)
        if not len(index):
            return float(total[-1, -1])
        bounded, free = self._solve(total, index)
        change = np.tile(bounded, (len(self.blocks), 1))
        if free.any():
            at, fixed = index[free], index[~free]
            rest = total - self.blocks
            normal = rest[:, at[:, None], at] + np.diag(self.precision[at])
            right = rest[:, at, -1] - self.precision[at] * self.value[at]
            if len(fixed):
                right = right - rest[:, at[:, None], fixed] @ bounded[~free]
            change[:, free] = np.linalg.solve(normal, right[..., None])[..., 0]
        square = np.einsum("bi,bij,bj->", change, self.blocks[:, index[:, None], index], change)
        return float(total[-1, -1] - 2.0 * np.sum(change * self.blocks[:, index, -1]) + square)


def gram(
    flights: Flights,
    setting: Setting,
    whiten: Whitener,
    columns: dict[Column, Array],
    residual: Array,
) -> Gram:
    """Return the regression of the residual (rows, 6) at a setting on these
    columns (rows, 6) each.
    """
    names = tuple(columns)
    x = np.stack([*columns.values(), residual], axis=2)
    x = np.ascontiguousarray(whiten(x)[flights.fit_rows])
    begins = np.flatnonzero(np.diff(flights.block[flights.fit_rows], prepend=-1))
    parts = (part.reshape(-1, len(names) + 1) for part in np.split(x, begins[1:]))
    blocks = np.array([part.T @ part for part in parts])
    return Gram(names, x, begins, blocks, *priors_and_ranges(flights, setting, names))


def priors_and_ranges(
    flights: Flights, setting: Setting, columns: Sequence[Column]
) -> tuple[Array, Array, Array, Array]:
    """Return for each column (columns,) its prior's precision, its value, and by how much it may
    fall and rise.
    """
    size = np.array(
        [
            timing.size
            if (timing := timing_of(c, flights.filtered))
            else typical_size(c, flights.vehicle)
            for c in columns
        ]
    )
    for i, column in enumerate(columns):
        if is_bias(column):
            flight, axis = flight_and_axis(column[1])
            size[i] = flights.bias_std(flight)[axis] / GRAM.prior_std
    value = np.array(
        [flights.coefficients(setting, effect).get(name, 0.0) for effect, name in columns]
    )
    low, high = np.empty(len(columns)), np.empty(len(columns))
    for i, c in enumerate(columns):
        if is_bias(c):
            high[i] = BIAS.most_in_std * GRAM.prior_std * size[i]
            low[i] = -high[i]
        elif not c[0]:
            low[i], high[i] = range_of(c, flights.filtered)
        elif c[1].startswith(MOMENT_PREFIX):
            low[i], high[i] = -np.inf, np.inf
        elif c[1].startswith(START_PREFIX):
            low[i], high[i] = 0.0, GRAM.prior_std
        else:
            low[i], high[i] = (
                coefficient(c).minimum,
                min(coefficient(c).maximum, coefficient(c).plausible),
            )
            if get(c[0]).role == Role.MASS:
                declared = unit_of_change(c, flights.vehicle)
                low[i] = max(low[i], -GRAM.most_missing_mass * declared)
    prior = 1.0 / np.square(GRAM.prior_std * np.maximum(size, 1e-300))
    prior[size == 0] = 1e30
    return prior, value, low - value, high - value
