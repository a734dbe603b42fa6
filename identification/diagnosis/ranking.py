"""Which effects act: the posterior over sets of up to five, and what they leave unexplained.

Every effect of the library is as likely as every other before the flight, and one is expected to be
missing. A set's evidence is that of the likelier noise of two: that beside no effect, and that
beside the best set, because what is not explained counts as a disturbance.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ...runtime.errors import InputError
from ..findings import Ranking
from .axis_filter import AxisNoise
from .climbing import Height, linear_mode, mode
from .evidence import marginal
from .likelihood import WHOLE_PREFIX, Likelihood, declared
from .priors import Base, Setting, in_prior_units, variants_of
from .regression import (
    START_PREFIX,
    Column,
    Flights,
    moves_time,
    typical_size,
)
from .sets import Posterior
from .starting_points import starting_points

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RankingSettings:
    """How often sets are tried anew, and where lags are."""

    # typical sizes at which a lag or a delay is tried as a whole: their columns change with them
    time_starts: tuple[float, ...] = (0.3, 0.6, 1.2)
    rounds: int = 6  # of fitting the noise beside the best set


RANKING = RankingSettings()


@dataclass(frozen=True, eq=False)
class Found:
    """The posterior of flights, and what the likeliest set is a fit of."""

    posterior: Posterior
    ranking: Ranking
    setting: Setting  # coefficients of the likeliest set
    # of each channel, where the likelihood has a noise of the motion; none for a force balance
    noise: tuple[AxisNoise, ...] = ()
    # biases and time offsets of the sensors, with their standard deviations
    sensors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # of each effect of the set, those that the logs do not show and that do as well in its place
    behind: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def rank(
    flights: Flights,
    library: Sequence[str],
    report: Callable[[str], None] = lambda text: None,
) -> Found:
    """Return the posterior over sets of effects of a library, of those that flights can show.

    Args:
        flights: whose poses are explained.
        library: names of effects that may act.
        report: called with a line of progress.
    """
    near = Likelihood(flights, {})
    nothing = _Beside(flights, library, {}, near)
    loud = nothing.base()
    quiet = nothing.quieter_base(_whole_library(loud))
    found = Posterior(flights, library, (loud, quiet))
    # the best effect first, alone: another set's columns are those of the model that has it
    setting = found.best_setting(1)
    tried: dict[frozenset[str], Setting] = {frozenset(): {}}
    beside = nothing
    for _ in range(RANKING.rounds):
        # the columns of the same set change with its coefficients, where these have moved far
        if not found.is_elsewhere(setting, tried):
            setting = found.best_setting()
            if not found.is_elsewhere(setting, tried):
                break
        report(f"trying {', '.join(setting)}")
        setting = mode(setting, partial(_height, flights, near=near))
        tried[frozenset(setting)] = setting
        beside = _Beside(flights, library, setting, near)
        near = beside.likelihood
        found = Posterior(flights, library, (loud, beside.base()))
        setting = found.best_setting()
    # once more, with the dictionary's columns, that are dear, beside the likeliest set
    if setting.keys() != beside.setting.keys():
        beside = _Beside(flights, library, setting, near) if setting else nothing
    base = beside.base(unknown=True)
    found = Posterior(flights, library, (loud, base), found.tempering())
    column, size, _ = found.strangest()
    ranking = found.ranking(beside.quieter_base({column: size}))
    late = {
        name: x for (_, name), x in found.nuisances().items() if ("", name) in flights.time_offsets
    }
    return Found(found, ranking, found.best_setting(), beside.likelihood.noise, late)


def _height(flights: Flights, setting: Setting, near: Likelihood) -> Height:
    """Return how high the posterior is at a setting, with the noise as it is."""
    try:
        likelihood = Likelihood(flights, setting, near, same_noise=True)
        wanted = wanted_columns(flights, list(setting), setting, {})
        sums = likelihood.sums(wanted, {}, unknown=False)
        base = in_prior_units(flights, sums, setting, {})
    except (InputError, np.linalg.LinAlgError):
        return math.inf, lambda: setting
    asked = np.array([i for c, i in base.columns.items() if c in wanted], dtype=np.intp)
    total = base.blocks.sum(axis=0)
    ones = np.ones(len(base.plain))
    m = marginal(total[:-1, :-1], total[:-1, -1], float(total[-1, -1]), asked, base.plain, ones)
    columns = [list(base.columns)[i] for i in asked]
    here = np.array([setting[e].get(n, 0.0) - declared((e, n), flights) for e, n in columns])
    z = here / base.size[asked]
    value = -m.constant - float(m.right @ z - 0.5 * z @ m.normal @ z) + 0.5 * float(z @ z)
    return value, lambda: linear_mode(flights, base, m, asked, columns, setting)


class _Beside:
    """The likelihood beside a set of effects, and the starts of all others there."""

    def __init__(
        self, flights: Flights, library: Sequence[str], setting: Setting, near: Likelihood
    ) -> None:
        self.flights, self.library, self.setting = flights, library, setting
        self.likelihood = Likelihood(flights, setting, near)
        self.starts = starts_of(flights, library, setting)

    def base(self, unknown: bool = False) -> Base:
        """Return its sums; ``unknown``: with the dictionary's columns."""
        wanted = wanted_columns(self.flights, self.library, self.setting, self.starts)
        sums = self.likelihood.sums(wanted, self.starts, unknown)
        return in_prior_units(self.flights, sums, self.setting, self.starts)

    def quieter_base(self, coefficients: Mapping[Column, float]) -> Base:
        """Return its sums with the noise that is likeliest beside these coefficients."""
        sums = self.likelihood.quieter(coefficients)
        return in_prior_units(self.flights, sums, self.setting, self.starts)


def wanted_columns(
    flights: Flights,
    library: Sequence[str],
    setting: Setting,
    starts: Mapping[Column, Mapping[str, float]],
) -> dict[Column, None]:
    """Return the columns of all effects, in order, but those that the vehicle's file fixes."""
    return dict.fromkeys(
        c
        for e in library
        for v in variants_of(flights, e, setting, starts)
        for c in v[1]
        if c[1].removeprefix(WHOLE_PREFIX) not in flights.stated(e)
    )


def _whole_library(base: Base) -> dict[Column, float]:
    """Return the coefficients of all columns of effects together, at the mode."""
    chosen = np.concatenate([base.plain, [i for c, i in base.columns.items() if c[0]]]).astype(int)
    total = base.blocks.sum(axis=0)
    mode = np.linalg.solve(total[np.ix_(chosen, chosen)] + np.eye(len(chosen)), total[chosen, -1])
    names = list(base.columns)
    return {names[i]: float(x * base.size[i]) for i, x in zip(chosen, mode, strict=True)}


def starts_of(
    flights: Flights, library: Sequence[str], setting: Setting
) -> dict[Column, Mapping[str, float]]:
    """Return columns of whole effects, with the coefficients of each: lags and delays, and effects
    whose coefficients do nothing one by one.
    """
    out: dict[Column, Mapping[str, float]] = {}
    residual: Array | None = None
    for effect in library:
        if effect in setting:
            continue
        if moves_time(effect) and get(effect).kind == "rotor input":
            name = get(effect).coefficients[0].name
            typical = typical_size((effect, name), flights.vehicle)
            for i, share in enumerate(RANKING.time_starts):
                out[effect, f"{START_PREFIX}{i}"] = {name: share * typical}
            continue
        if not flights.is_nonlinear(effect):
            continue
        if residual is None:
            residual = flights.residual({k: v for k, v in setting.items() if k})
        stated = flights.stated(effect)
        for i, start in enumerate(starting_points(effect, flights, residual, stated)):
            out[effect, f"{START_PREFIX}{i}"] = {**start, **stated}
    return out
