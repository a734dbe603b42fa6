"""What the errors of an IMU hide of effects, and add to the uncertainty of those that are found, in
logs whose motion is read from it.

Two things remain unknown there: a bias of the accelerometer, three numbers a flight, and how the
fused attitude, velocity and position drift. The first is fitted beside the effects, so an effect
that looks like it shows only by what a bias within its standard deviation cannot explain. The
second turns and stretches what the model says acts: errors drawn anew from the fusion's standard
deviations move the coefficients, and by how much is part of their own.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ...runtime.errors import InputError
from .gram_matrix import Gram, gram
from .regression import (
    CENTRAL,
    START_PREFIX,
    Column,
    Flights,
    is_nonlinear,
    typical_size,
)
from .search import SEARCH, FittedEffects, Search, unexplained_deviance
from .sensor_bias import is_bias

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ImuLimitsSettings:
    """How the errors of a fused motion are drawn."""

    draws: int = 8  # a standard deviation of them is then known to a quarter
    # typical sizes, up to which an effect that such a log does not show may be there all the same
    hidden_size: float = 2.0
    least_in_std: float = 3.0  # standard deviations from zero, from which a coefficient is used


IMU_LIMITS = ImuLimitsSettings()


def hidden_by_bias(search: Search, fit: FittedEffects) -> frozenset[str]:
    """Return the effects of which a typical size is too little to be named beside the biases of the
    accelerometer, and would be named if those were known.

    It is computed and not tried: with the noise that a search settled on, from what an effect of
    typical size would add to the residual at its fit.
    """
    flights = search.flights
    if not flights.inertial:
        return frozenset()
    base = flights.residual(fit.setting)
    biases = [c for c in flights.biases if is_bias(c)]
    columns = flights.columns(fit.setting, biases)
    whole: dict[str, Column] = {}
    for effect in search.library:
        if effect in fit.effects or is_nonlinear(effect):
            continue
        try:
            added = base - flights.residual({**fit.setting, effect: _typical(flights, effect)})
        except InputError:  # no vehicle is like that
            continue
        whole[effect] = (effect, START_PREFIX)
        columns[whole[effect]] = added
    g = gram(flights, fit.setting, search.whiten, columns, base)
    total = g.blocks.sum(axis=0)

    def shows(column: Column, beside: list[Column]) -> bool:
        left = unexplained_deviance(g, total, [column], np.ones(1), beside)
        return left >= SEARCH.least_deviance_reduction

    return frozenset(e for e, c in whole.items() if shows(c, []) and not shows(c, biases))


def _used_coefficients(fit: FittedEffects, effect: str) -> list[str]:
    """Return which of an effect's coefficients differ from zero beyond their uncertainty."""
    return [
        name
        for name, value in fit.setting[effect].items()
        if name != CENTRAL
        and abs(value) > IMU_LIMITS.least_in_std * fit.std.get((effect, name), 0.0)
        and value != 0.0
    ]


def hidden_causes(search: Search, fit: FittedEffects) -> list[str]:
    """Return, as sentences, which named effects an effect that these logs do not show may stand
    behind: at twice its typical size or less it would be taken for the named one, as large as that.

    What it would be taken for is the least-squares fit of its part of the residual on the named
    effects, with the velocity and attitude of the fusion.
    """
    flights = search.flights
    wanted = search.model_columns(fit.effects) if flights.inertial and fit.effects else []
    if not wanted:
        return []
    base = flights.residual(fit.setting)
    columns = flights.columns(fit.setting, wanted, 0.1)
    behind: dict[str, list[str]] = {}
    for hidden in sorted(flights.needs_pose - flights.without_trace - set(fit.effects)):
        if is_nonlinear(hidden):
            continue
        try:
            part = base - flights.residual({**fit.setting, hidden: _typical(flights, hidden)})
        except InputError:  # no vehicle is like that
            continue
        g = gram(flights, fit.setting, search.whiten, columns, part)
        total, at = g.blocks.sum(axis=0), g.index(wanted)
        induced = np.linalg.lstsq(total[np.ix_(at, at)], total[at, -1], rcond=None)[0]
        taken_for = dict(zip(wanted, IMU_LIMITS.hidden_size * np.abs(induced), strict=True))
        for effect in fit.effects:
            used = _used_coefficients(fit, effect)
            if used and all(
                taken_for.get((effect, name), 0.0) >= abs(fit.setting[effect][name])
                for name in used
            ):
                behind.setdefault(effect, []).append(hidden)
    return [
        f"{effect}: {' or '.join(hidden)}, which these logs do not show, would look like it. Log "
        "the pose to tell them apart"
        for effect, hidden in behind.items()
    ]


def with_errors_of_fusion(search: Search, fit: FittedEffects) -> FittedEffects:
    """Return the fit with standard deviations that contain what other errors of the fusion, as
    large as it states them, would make of its coefficients.
    """
    flights = search.flights
    wanted = search.model_columns(fit.effects)
    if not (flights.inertial and fit.effects and wanted):
        return fit

    def change(of: Flights) -> Array:
        columns = of.columns(fit.setting, wanted, 0.1)
        own: Gram = gram(of, fit.setting, search.whiten, columns, of.residual(fit.setting))
        return own.solve(own.blocks.sum(axis=0), own.index(wanted))

    here = change(flights)
    moved = [
        change(flights.with_drift(np.random.default_rng((2, draw)))) - here
        for draw in range(IMU_LIMITS.draws)
    ]
    spread = np.sqrt(np.mean(np.square(moved), axis=0))
    std = {
        column: float(np.hypot(fit.std[column], more))
        for column, more in zip(wanted, spread, strict=True)
        if column in fit.std
    }
    return FittedEffects(fit.setting, {**fit.std, **std})


def _typical(flights: Flights, effect: str) -> dict[str, float]:
    """Return an effect at the typical sizes of its coefficients."""
    return {
        c.name: float(np.copysign(typical_size((effect, c.name), flights.vehicle), c.typical[0]))
        for c in get(effect).coefficients
        if c.name != CENTRAL
    }
