"""Priors and bounds of what a posterior's likelihood is a function of: a standard deviation for
each column, and the ways in which an effect may act.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Role
from .evidence import Index
from .likelihood import (
    BETWEEN,
    GAIN,
    LIKELIHOOD,
    MODEL_ERROR,
    ROUNDED,
    UNKNOWN,
    WHOLE_PREFIX,
    Sums,
    declared,
)
from .regression import (
    CENTRAL,
    START_PREFIX,
    Column,
    Flights,
    coefficient,
    moves_time,
    typical_size,
    unit_of_change,
)
from .time_offsets import timing_of

Array = NDArray[np.float64]
Setting = dict[str, dict[str, float]]


@dataclass(frozen=True)
class PriorSettings:
    """What is believed before a flight is seen."""

    expected: float = 1.0  # effects that a vehicle lacks
    # typical sizes: every effect acts a little, and one that is no larger is not worth a name. It
    # is the standard deviation of what any coefficient may have without the effect being named
    negligible: float = 0.03
    size: float = 1.0  # typical sizes, the standard deviation of a coefficient
    any_size: float = 3.0  # the same of effects that may be of any size
    most_missing_mass: float = 0.9  # share of the declared mass that a vehicle may lack
    # times a lag or a delay at which a column was made, between which the column stands for it
    near_start: tuple[float, float] = (0.5, 1.5)


PRIORS = PriorSettings()
# one way in which an effect may act: all coefficients, or one of those starting points
Variant = tuple[str, tuple[Column, ...]]


@dataclass(frozen=True, eq=False)
class Base:
    """The likelihood near one setting, in prior standard deviations."""

    columns: dict[Column, int]
    size: Array  # (c,) prior standard deviations
    low: Array
    high: Array
    blocks: Array
    penalty: float
    effects: frozenset[str]  # of the setting
    plain: Index  # columns that any flight may have
    typical: Array  # (c,) typical sizes in prior standard deviations
    dictionary: Index  # columns of the discrepancy
    starts: Mapping[Column, Mapping[str, float]]


def variants_of(
    flights: Flights,
    effect: str,
    setting: Setting,
    starts: Mapping[Column, Mapping[str, float]],
) -> list[Variant]:
    """Return the ways in which an effect may act."""
    names = [c.name for c in get(effect).coefficients]
    if moves_time(effect) and effect not in setting:
        derivative: Variant = (effect, tuple((effect, name) for name in names))
        return [derivative, *((effect, (c,)) for c in starts if c[0] == effect)]
    if get(effect).starting_points is not None:
        if effect in setting or not flights.is_nonlinear(effect):
            return [(effect, tuple((effect, name) for name in names))]
        return [(effect, (c,)) for c in starts if c[0] == effect]
    if CENTRAL not in names:
        return [(effect, tuple((effect, name) for name in names))]
    names.remove(CENTRAL)
    plain: Variant = (effect, tuple((effect, name) for name in names))
    if effect in setting:
        return [(effect, (*plain[1], (effect, CENTRAL)))]
    return [plain, (effect, tuple((effect, WHOLE_PREFIX + name) for name in names))]


def prior_size(column: Column, flights: Flights) -> float:
    """Return the standard deviation of a column's coefficient before a flight is seen."""
    effect, name = column
    if (timing := timing_of(column)) is not None:
        return timing.size
    if not effect:
        if name == BETWEEN:
            return LIKELIHOOD.between_samples
        if name.startswith(GAIN):
            return LIKELIHOOD.gains[int(name[-1])]
        return LIKELIHOOD.model_error if name.startswith(MODEL_ERROR) else 1.0
    if name.startswith(START_PREFIX) or name == CENTRAL:
        return 1.0
    column = (effect, name.removeprefix(WHOLE_PREFIX))
    factor = PRIORS.any_size if get(effect).any_size else PRIORS.size
    size = factor * typical_size(column, flights.vehicle)
    return math.hypot(size, flights.thrust_std) if get(effect).role == Role.THRUST else size


def _typical(column: Column, flights: Flights) -> float:
    effect, name = column
    if not effect or name.startswith(START_PREFIX) or name == CENTRAL:
        return 1.0
    return typical_size((effect, name.removeprefix(WHOLE_PREFIX)), flights.vehicle)


def _bounds(column: Column, flights: Flights) -> tuple[float, float]:
    effect, name = column
    if not effect:
        return -math.inf, math.inf
    if name.startswith(START_PREFIX):
        return PRIORS.near_start if moves_time(effect) else (0.0, math.inf)
    c = coefficient((effect, name.removeprefix(WHOLE_PREFIX)))
    low, high = c.minimum, min(c.maximum, c.plausible)
    if get(effect).role == Role.MASS:
        low = max(low, -PRIORS.most_missing_mass * unit_of_change(column, flights.vehicle))
    own = declared(column, flights)
    return min(low - own, 0.0), max(high - own, 0.0)


def _errors_of_torques(total: Array, columns: Mapping[Column, int], size: Array) -> Array:
    """Return by what factor (c,) the model's error of each torque is larger than that of a model of
    exact rotor speeds.

    A torque's gain is biased low by the share of its column that is the rounding of rotor speeds
    (errors in variables). What counts is the share of what nuisances leave of the column: a hover
    holds little torque, and the rotors' innovations stand for most of it. Another rounding shows
    it: by how much it would add to what the column says.
    """
    factor = np.ones(len(size))
    torque, expected = f"{MODEL_ERROR} of torque ", f"{MODEL_ERROR} of expected torque "
    others = np.array(
        [
            i
            for (e, name), i in columns.items()
            if not e and not name.startswith((torque, expected, ROUNDED, UNKNOWN))
        ]
    )
    inner = total[np.ix_(others, others)] + np.eye(len(others))

    def left(i: int) -> float:
        cross = total[others, i]
        return float(total[i, i] - cross @ np.linalg.solve(inner, cross))

    for axis in "xyz":
        if (rounded := columns.get(("", ROUNDED + axis))) is not None:
            own = columns["", torque + axis]
            share = left(rounded) / max(left(own) / size[own] ** 2, 1e-30)
            for i in (own, columns["", expected + axis]):
                factor[i] = math.hypot(1.0, share / size[i])
    return factor


def in_prior_units(
    flights: Flights,
    sums: Sums,
    setting: Setting,
    starts: Mapping[Column, Mapping[str, float]],
) -> Base:
    """Return sums of products in standard deviations of the priors, about zero and not about the
    setting beside which they were made.
    """
    size = np.array([prior_size(c, flights) for c in sums.columns])
    bounds = np.array([_bounds(c, flights) for c in sums.columns])
    scale = np.append(size, 1.0)
    blocks = sums.blocks * scale[:, None] * scale
    # about zero, not about the setting: the residual with all its effects taken away
    back = np.append(sums.value / size, 1.0)
    whole = blocks @ back
    blocks[:, :, -1] = whole
    blocks[:, -1, :] = whole
    blocks[:, -1, -1] = np.einsum("c,bc->b", back, whole)
    columns = {c: i for i, c in enumerate(sums.columns)}
    factor = _errors_of_torques(blocks.sum(axis=0), columns, size)
    size *= factor
    scale = np.append(factor, 1.0)
    blocks *= scale[:, None] * scale
    kept = np.array([i for c, i in columns.items() if not c[1].startswith(ROUNDED)])
    size, bounds = size[kept], bounds[kept]
    blocks = blocks[:, np.append(kept, -1)][:, :, np.append(kept, -1)]
    columns = {list(columns)[i]: k for k, i in enumerate(kept)}
    plain = [i for c, i in columns.items() if not c[0] and not c[1].startswith(UNKNOWN)]
    dictionary = [i for c, i in columns.items() if not c[0] and c[1].startswith(UNKNOWN)]
    return Base(
        columns,
        size,
        bounds[:, 0] / size,
        bounds[:, 1] / size,
        blocks,
        sums.penalty,
        frozenset(k for k in setting if k),
        np.array(plain, dtype=np.intp),
        np.array([_typical(c, flights) for c in columns]) / size,
        np.array(dictionary, dtype=np.intp),
        starts,
    )
