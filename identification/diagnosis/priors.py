"""Priors and bounds of a posterior's columns: a standard deviation for each, and the variants of an
effect.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Role
from ..logs.table import Array, Pair, Values
from .coefficients import (
    CENTRAL,
    Effects,
    Setting,
    coefficient,
    moves_time,
    typical_size,
    unit_of_change,
)
from .column import Column, Part
from .evidence import Index, Marginal, SetEvidence
from .regression import RegressedFlights

# columns of whole effects, with the coefficients of each
Starts = Mapping[Column, Values]


EXPECTED = 1.0  # number of effects missing in a model, before a flight is seen
# typical sizes: every effect acts a little, and none up to this size is worth a name. The standard
# deviation of any coefficient of an unnamed effect
NEGLIGIBLE = 0.03
ANY_SIZE = 3.0  # typical sizes, of effects of any size; of others one
MOST_MISSING_MASS = 0.9  # share of the declared mass a vehicle may lack
# times a column's own lag or delay: range in which the column stands for it
NEAR_START = (0.5, 1.5)
# error of any model as a share of an axis' force or torque: of thrust along its axis and across it,
# and of the torques. Propellers and bearings are not stable to less
MODEL_ERROR = 0.003
# standard deviations of the gains of pose, rate and disturbance on the rotors' innovations, in
# units of one period of such an acceleration. They leave the gains free: a loop that shows the tilt
# it sees has gains of some 3,000, 100 and 1
GAINS = (1e4, 1e3, 1e2)
# second differences of the rotor speeds: standard deviation of their path between samples from a
# straight line
BETWEEN_SAMPLES = 0.5
# columns of one variant of an effect: all coefficients, or one of its starting points
Variant = tuple[Column, ...]
Variants = tuple[Variant, ...]  # of a set, one of each effect


@dataclass(frozen=True, eq=False)
class Base:
    """The likelihood near one setting, in prior standard deviations."""

    names: Sequence[Column]  # (c,)
    size: Array  # (c,) prior standard deviations
    low: Array
    high: Array
    total: Array  # (c + 1, c + 1) sums of products, true to rounding
    blocks: Array  # (blocks, k + 1, k + 1), the same of each block, of the columns ``single``
    flight: Index  # (blocks,) index of the log
    single: Index  # (k,) columns without the dictionary, nine tenths of all
    penalty: float
    effects: Effects  # of the setting
    plain: Index  # nuisances of any flight
    typical: Array  # (c,) typical sizes in prior standard deviations
    dictionary: Sequence[Column]  # columns of the discrepancy
    starts: Starts
    # the evidence of sets, by the likelihood's power and their columns; None for an impossible set
    tried: dict[float, dict[Variants, SetEvidence | None]] = field(default_factory=dict)

    @cached_property
    def columns(self) -> dict[Column, int]:
        """The index of each column."""
        return {c: i for i, c in enumerate(self.names)}

    def at(self, columns: Iterable[Column]) -> Index:
        """Return the indices of some columns."""
        return np.array([self.columns[c] for c in columns], dtype=np.intp)

    @property
    def asked(self) -> list[Column]:
        """The columns of effects."""
        return [c for c in self.columns if c.effect]

    def marginal(
        self,
        asked: Sequence[Column],
        others: Index,
        power: float = 1.0,
        size: Array | float = 1.0,
    ) -> Marginal:
        """Return the likelihood, to a power, of the columns asked about, with others integrated
        out; ``size``: standard deviations of their prior, if not their own.
        """
        products = power * self.total
        products[-1, -1] += power * self.penalty
        at = self.at(asked)
        return Marginal.of(asked, (self.low[at], self.high[at]), products, at, others, size)

    def mode(self, chosen: Index, power: float = 1.0, draw: bool = False) -> dict[Column, Pair]:
        """Return the coefficients of some columns at the mode without all others, or a draw about
        it, and their standard deviations.

        A noise beside a mode would be too small: beside a draw it is true (G. Celeux and J.
        Diebolt, Computational Statistics Quarterly 2 (1985), 73-82).
        """
        total = power * self.total
        normal = total[np.ix_(chosen, chosen)] + np.eye(len(chosen))
        right = total[chosen, -1]
        if draw:
            off = np.random.default_rng(0).standard_normal(len(chosen))
            right += np.linalg.cholesky(normal) @ off
        mode = np.linalg.solve(normal, right) * self.size[chosen]
        std = np.sqrt(np.diag(np.linalg.inv(normal))) * self.size[chosen]
        modes = zip(chosen, mode.tolist(), std.tolist(), strict=True)
        return {self.names[i]: (x, s) for i, x, s in modes}

    def scatter(self, columns: Iterable[Column], mode: Array, power: float) -> Array:
        """Return the deviations of coefficients (c,) by their scatter over blocks and over flights,
        in those of the likelihood; at least one.

        The likelihood takes all samples as independent, but an error of the model lasts for
        seconds, and differs from flight to flight. The covariance of the sums over blocks, or over
        flights, is true for any such error (K.-Y. Liang and S. L. Zeger, Biometrika 73 (1986),
        13-22). Few sums estimate a small variance badly, so the largest of the three counts (J. D.
        Angrist and J.-S. Pischke, Mostly Harmless Econometrics, 2009, section 8.2).

        Args:
            columns: the columns of a set.
            mode: (c,) their coefficients. One at its bound keeps its deviation.
            power: of the likelihood.
        """
        own = self.at(columns)
        inside = (mode > self.low[own]) & (mode < self.high[own])
        free = np.append(self.plain, own[inside])
        there = np.zeros(len(self.total))
        there[own] = -mode
        there[free] = 0.0
        there[-1] = 1.0
        inverse = np.linalg.inv(power * self.total[np.ix_(free, free)] + np.eye(len(free)))
        there[free] = -power * inverse @ (self.total[free] @ there)
        kept = np.append(self.single, len(self.names))
        each = power * self.blocks[:, np.searchsorted(self.single, free)] @ there[kept] @ inverse
        largest = stated = np.diagonal(inverse)
        by_prior = np.square(inverse).sum(axis=0)
        by_flight = [each[self.flight == i].sum(axis=0) for i in np.unique(self.flight)]
        for sums in (each, by_flight):
            if (count := len(sums)) > 1:
                spread = np.square(sums).sum(axis=0) * count / (count - 1)
                largest = np.maximum(largest, spread + by_prior)
        out = np.ones(len(own))
        out[inside] = np.sqrt(largest / stated)[len(self.plain) :]
        return out


def variants_of(
    flights: RegressedFlights, effect: str, setting: Collection[str], starts: Starts
) -> list[Variant]:
    """Return the variants of an effect beside the effects of a setting, without coefficients fixed
    by the vehicle's file.
    """
    own = tuple(flights.columns_of([effect]))
    wholes = [(c,) for c in starts if c.effect == effect]
    if moves_time(effect) and effect not in setting:
        return [own, *wholes]
    if flights.is_nonlinear(effect) and effect not in setting:
        return list(wholes)
    if all(c.name != CENTRAL for c in get(effect).coefficients):
        return [own]
    if effect in setting:
        return [(*own, Column(effect, CENTRAL))]
    return [own, tuple(c._replace(part=Part.AT_CENTRE) for c in own)]


def prior_size(column: Column, flights: RegressedFlights) -> float:
    """Return the standard deviation of a column's coefficient before a flight is seen."""
    match column.part:
        case Part.BETWEEN_SAMPLES:
            return BETWEEN_SAMPLES
        case Part.GAIN:
            return GAINS[column.number]
        case Part.MODEL_ERROR:
            return MODEL_ERROR
    size = typical_size(column, flights.vehicle)
    if not column.effect or column.part == Part.START or column.coefficient == CENTRAL:
        return size
    effect = get(column.effect)
    size *= ANY_SIZE if effect.any_size else 1.0
    return math.hypot(size, flights.thrust_std) if effect.role == Role.THRUST else size


def _bounds(column: Column, flights: RegressedFlights) -> Pair:
    if not column.effect:
        return -math.inf, math.inf
    if column.part == Part.START:
        return NEAR_START if moves_time(column.effect) else (0.0, math.inf)
    c = coefficient(column)
    low = c.minimum
    high = min(c.maximum, c.plausible)
    if get(column.effect).role == Role.MASS:
        low = max(low, -MOST_MISSING_MASS * unit_of_change(column, flights.vehicle))
    own = flights.value({}, column)
    return min(low - own, 0.0), max(high - own, 0.0)


def from_declared(columns: Iterable[Column], flights: RegressedFlights, setting: Setting) -> Array:
    """Return the coefficients (c,) of a setting, in standard deviations of their priors."""
    return np.array(
        [
            (flights.value(setting, c) - flights.value({}, c)) / prior_size(c, flights)
            for c in columns
        ]
    )


def changed(column: Column, change: float, flights: RegressedFlights) -> float:
    """Return a column's coefficient by the vehicle's file, changed as far as its limits allow."""
    limits = coefficient(column)
    return min(max(flights.value({}, column) + change, limits.minimum), limits.maximum)


def in_prior_units(
    flights: RegressedFlights,
    names: Sequence[Column],
    blocks: Iterable[tuple[int, Array]],
    penalty: float,
    setting: Setting,
    starts: Starts,
) -> Base:
    """Return a likelihood in standard deviations of the priors, about zero instead of the setting
    of its columns.

    Args:
        flights: the vehicle's flights.
        names: (c,) columns.
        blocks: of each block of flight the index of its log, and (c + 1, c + 1) sums of products,
            of columns and of the residual at the setting (last), whitened.
        penalty: twice the sum over samples of the logarithm of the standard deviations.
        setting: the setting of effects.
        starts: columns of whole effects.
    """
    size = np.array([prior_size(c, flights) for c in names])
    scale = np.append(size, 1.0)
    # about zero: the residual without all effects of the setting
    back = np.append([flights.value(setting, c) - flights.value({}, c) for c in names], 1.0)
    single = np.flatnonzero([not c.is_unknown for c in names])
    held = np.append(single, len(names))
    total = np.zeros((len(scale), len(scale)))
    kept, flight = [], []
    for log, products in blocks:
        products[:, -1] = products[-1] = products @ back
        products[-1, -1] = products[-1] @ back
        products *= scale[:, None]
        products *= scale
        total += products
        kept.append(products[np.ix_(held, held)])
        flight.append(log)
    low, high = np.array([_bounds(c, flights) for c in names]).T / size
    typical = np.array([typical_size(c, flights.vehicle) for c in names])
    return Base(
        names,
        size,
        low,
        high,
        total + np.diag(1e-12 * np.diagonal(total)),
        np.array(kept),
        np.array(flight),
        single,
        penalty,
        frozenset(k for k in setting if k),
        single[[not names[i].effect for i in single.tolist()]],
        typical / size,
        [c for c in names if c.is_unknown],
        starts,
    )
