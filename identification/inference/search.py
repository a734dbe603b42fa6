"""Fits of sets of effects to flights, and what each other effect would explain: the questions that
the search asks.

Effects are judged on blocks of the fit that are left out in turn; held-out rows are never used.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .gram_matrix import Gram, columns_of, gram
from .regression import (
    CENTRAL,
    MOMENT_PREFIX,
    START_PREFIX,
    Column,
    Flights,
    Setting,
    coefficient,
    is_delay,
    is_nonlinear,
    range_of,
    typical_size,
)
from .starting_points import starting_points
from .time_offsets import LAG_ASYMMETRY, ROTOR_TIME_OFFSET
from .whitening import Whitener

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SearchSettings:
    """What an effect must be to be named, and when the Gauss-Newton fit stops.

    A deviance is the sum of squares of a whitened residual: twice the negative log-likelihood, up
    to a constant.
    """

    # deviance on left-out blocks that an effect must explain; a spurious effect explains about 10
    least_deviance_reduction: float = 40.0
    # share of the deviance that is left unexplained, which an effect must explain as well
    least_share_of_deviance: float = 0.01
    # typical sizes; a smaller effect is not worth a name
    least_size: float = 0.1
    # deviance by which an effect with one more coefficient must be better
    deviance_per_coefficient: float = 8.0
    most_iterations: int = 6  # of Gauss-Newton
    # deviance; an iteration that lowers it by less is idle, and two idle ones in a row are the last
    least_iteration_reduction: float = 1.0
    # times what the last iteration gained: what all further iterations together may still gain
    most_further_gain: float = 3.0
    # share of an effect's deviance that the other named effects must leave unexplained. In hover a
    # thrust and a steady force leave 0.00001 of each other; on 78 flights on which two effects were
    # found each left at least 0.019 of the other, on one slow flight 0.0007
    least_independent_share: float = 0.0003


SEARCH = SearchSettings()


@dataclass(eq=False)
class FittedEffects:
    """A set of effects with fitted coefficients."""

    setting: dict[str, dict[str, float]]
    std: dict[Column, float] = field(default_factory=dict)

    @property
    def effects(self) -> list[str]:
        """Names of the effects, in the order in which they were found."""
        return [name for name in self.setting if name]

    def without(self, *effects: str) -> "FittedEffects":
        """Return this fit less some effects."""
        return FittedEffects({k: v for k, v in self.setting.items() if k not in effects})


class Search:
    """The search on some flights, with a library of effects.

    Args:
        flights: whose residual is to be explained.
        library: names of effects that may be named.
        report: called with a line of progress.
    """

    def __init__(
        self,
        flights: Flights,
        library: Sequence[str],
        report: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.flights = flights
        declared = {e.name for e in flights.vehicle.effects}
        self.library = tuple(e for e in library if e not in flights.not_identifiable)
        # effects that are not identifiable are not searched for, but may be the cause of another
        self.dominated_by_noise = tuple(
            e
            for e in library
            if e in flights.not_identifiable - flights.explained_by_rounding - flights.without_trace
            and not (flights.inertial and is_nonlinear(e))
        )
        self.report = report
        # effects that are searched for from several starting points; a declared one is such a point
        self.nonlinear_effects = frozenset(
            e for e in (*library, *declared) if flights.is_nonlinear(e)
        )
        self.noise: Array = np.zeros((0, 6))
        self.whiten: Whitener

    # Columns

    def columns_of(self, effect: str, fitted: bool) -> list[Column]:
        """Return the columns of an effect, without the coefficients that the vehicle file fixes."""
        stated = self.flights.stated(effect)
        return [
            c for c in columns_of(effect, fitted) if c[1].removeprefix(MOMENT_PREFIX) not in stated
        ]

    def model_columns(self, effects: Sequence[str], tried: Sequence[str] = ()) -> list[Column]:
        """Return the columns of a model: of its effects, of effects that are tried, and the time
        offsets that any log may have.
        """
        late = any(map(is_delay, (*effects, *tried)))
        return [
            *(c for c in self.flights.time_offsets if not (late and c == ROTOR_TIME_OFFSET)),
            *([LAG_ASYMMETRY] if playing(Role.LAG, among=effects) else []),
            *self.flights.biases,
            *(c for e in effects for c in self.columns_of(e, True)),
            *(c for e in tried for c in self.columns_of(e, False)),
        ]

    def linearise(self, fit: FittedEffects, near: FittedEffects | None = None) -> "Regression":
        """Return the regression on the whole library at a fit.

        With a fit ``near`` it, the columns of effects that are only tried are those of that fit,
        and its effects are not tried.
        """
        linear = [
            e
            for e in self.library
            if e not in self.nonlinear_effects and e not in (near or fit).effects
        ]
        wanted = self.model_columns(fit.effects, () if near else linear)
        columns = self.flights.columns(
            fit.setting, wanted if ROTOR_TIME_OFFSET in wanted else [ROTOR_TIME_OFFSET, *wanted]
        )
        if near:
            columns |= self.flights.columns(
                near.setting, [c for e in linear for c in self.columns_of(e, False)]
            )
        residual = self.flights.residual(fit.setting)
        starts: dict[Column, dict[str, float]] = {}
        for effect in self.library:
            if effect in self.nonlinear_effects and effect not in fit.effects:
                stated = self.flights.stated(effect)
                starting = starting_points(effect, self.flights, residual, stated)
                for i, start in enumerate(starting):
                    column = (effect, f"{START_PREFIX}{i}")
                    starts[column] = {**start, **stated}
                    changed = {**fit.setting, effect: starts[column]}
                    columns[column] = residual - self.flights.residual(changed)
        return Regression(columns, residual, starts)

    def gram(self, fit: FittedEffects, regression: "Regression") -> Gram:
        """Return the whitened sums of a regression."""
        return gram(self.flights, fit.setting, self.whiten, regression.columns, regression.residual)

    def _whitener(self, noise: Array, band: tuple[float, float] | None) -> Whitener:
        flights = self.flights
        return Whitener(
            noise,
            flights.sensor_noise,
            flights.start,
            flights.fit_rows,
            flights.period,
            band,
        )

    def set_noise(self, fit: FittedEffects, regression: "Regression") -> None:
        """Take for noise what the whole library, with plausible coefficients, leaves of the
        residual at a fit.
        """
        noise = regression.residual
        columns = {c: x for c, x in regression.columns.items() if not c[1].startswith(START_PREFIX)}
        for _ in range(3):
            self.whiten = self._whitener(noise, self.flights.selection_band_hz)
            g = gram(self.flights, fit.setting, self.whiten, columns, regression.residual)
            change = g.solve(g.blocks.sum(axis=0), np.arange(len(g.columns)))
            noise = regression.residual - np.tensordot(
                np.stack(list(columns.values()), axis=2), change, axes=(2, 0)
            )
        self.noise = noise
        self.whiten = self._whitener(noise, self.flights.selection_band_hz)

    # Fitting

    def deviance(self, setting: Setting) -> float:
        """Return the deviance of the fitted rows at a setting; infinite where no vehicle can be
        like that.
        """
        try:
            residual = self.flights.residual(setting)
        except InputError:
            return np.inf
        return self.deviance_of(residual)

    def deviance_of(self, residual: Array) -> float:
        """Return the deviance of the fit's rows of a residual (rows, 6) once it is whitened."""
        return float(np.sum(np.square(self.whiten(residual)[self.flights.fit_rows])))

    def refit(self, fit: FittedEffects, enough: float = np.inf) -> FittedEffects:
        """Return the fit with all coefficients at the least squares of the fitted rows (Gauss-
        Newton).

        A fit that is not going to reach a deviance of ``enough`` is given up early.
        """
        setting = {k: dict(v) for k, v in fit.setting.items()}
        wanted = self.model_columns(fit.effects)
        for free in (ROTOR_TIME_OFFSET, LAG_ASYMMETRY):
            if free not in wanted:
                setting.get(free[0], {}).pop(free[1], None)
        out = FittedEffects(setting)
        if not wanted:
            return out
        before = least = self.deviance(setting)
        risen, idle = False, 0
        for _ in range(SEARCH.most_iterations):
            columns = self.flights.columns(setting, wanted, 0.1)
            g = gram(self.flights, setting, self.whiten, columns, self.flights.residual(setting))
            index = g.index(wanted)
            total = g.blocks.sum(axis=0)
            change = g.solve(total, index)
            covariance = np.linalg.inv(total[np.ix_(index, index)] + np.diag(g.precision[index]))
            std = dict(zip(wanted, np.sqrt(np.diag(covariance)).tolist(), strict=True))
            out.std = out.std or std
            for scale in (1.0, 0.5, 0.25, 0.1)[risen:]:  # after an overshoot, no full step
                trial = _changed_setting(self.flights, setting, wanted, scale * change)
                after = self.deviance(trial)
                if after < 1.02 * before + 5.0:
                    break
            else:
                break
            moved = max(abs(d) / s for d, s in zip(change, std.values(), strict=True))
            idle = 0 if least - after > SEARCH.least_iteration_reduction else idle + 1
            gained, risen, setting, before = before - after, after > before, trial, after
            if after <= least:
                out.setting, out.std, least = setting, std, after
            if (
                moved < 0.05
                or idle == 2
                or before - enough > SEARCH.most_further_gain * max(gained, 0.0)
            ):
                break
        return out

    # Selection

    def gains(self, fit: FittedEffects, regression: "Regression", g: Gram) -> "list[Gain]":
        """Return what each other effect of the library explains beyond a fit, the best first."""
        base = self.model_columns(fit.effects)
        error = g.error(g.index(base))
        total = g.blocks.sum(axis=0)
        out = []
        for effect in self.library:
            if effect in fit.effects:
                continue
            if effect in self.nonlinear_effects:
                tries = [[*base, c] for c in regression.starts if c[0] == effect]
            else:
                tries = [self.model_columns(fit.effects, [effect])]
                if not regression.columns.keys() >= set(tries[0]):
                    continue
            best = Gain(effect, -np.inf, 0.0, np.inf, 0.0, fit)
            for wanted in tries:
                index = g.index(wanted)
                gain = error - g.error(index)
                if gain <= best.deviance_reduction:
                    continue
                change = g.solve(total, index)
                start = with_changes(self.flights, fit, wanted, change, effect)
                last = wanted[-1]
                if last in regression.starts:
                    start.setting[effect] = dict(regression.starts[last])
                elif self.not_identifiable(g, total, wanted, change, effect):
                    continue
                size = self.size(wanted, change, effect)
                best = Gain(effect, gain, gain / error, error - gain, size, start)
            out.append(best)
        found = [x for x in out if np.isfinite(x.deviance_reduction)]
        return sorted(
            found,
            key=lambda x: (
                SEARCH.deviance_per_coefficient * coefficient_count(x.effect) - x.deviance_reduction
            ),
        )

    def size(self, wanted: Sequence[Column], change: Array, effect: str) -> float:
        """Return the largest of an effect's coefficients in typical sizes."""
        return max(
            (
                abs(d) / typical_size(c, self.flights.vehicle)
                for c, d in zip(wanted, change, strict=True)
                if c[0] == effect
                and not c[1].startswith(MOMENT_PREFIX)
                and typical_size(c, self.flights.vehicle)
            ),
            default=0.0,
        )

    def not_identifiable(
        self, g: Gram, total: Array, wanted: Sequence[Column], change: Array, effect: str
    ) -> bool:
        """Return whether an effect is not identifiable beside the other named ones, because these
        explain nearly all of it.
        """
        own = [c for c in wanted if c[0] == effect]
        shape = change[[wanted.index(c) for c in own]]
        others = [c for c in wanted if c[0] not in (effect, "")]
        return bool(others) and unexplained_deviance(
            g, total, own, shape, others
        ) < SEARCH.least_independent_share * unexplained_deviance(g, total, own, shape, [])

    def error_without(self, fit: FittedEffects, effect: str) -> float:
        """Return the deviance on left-out blocks when one effect is removed and the others are
        refitted.
        """
        g = self.gram_at(fit.without(effect))
        return g.error(np.arange(len(g.columns)))

    def gram_at(self, fit: FittedEffects) -> Gram:
        """Return the regression on a fit's own columns."""
        columns = self.flights.columns(fit.setting, self.model_columns(fit.effects), 0.1)
        return gram(
            self.flights, fit.setting, self.whiten, columns, self.flights.residual(fit.setting)
        )

    def error(self, fit: FittedEffects) -> float:
        """Return the deviance of a fit on left-out blocks; infinite where the fit did not
        converge.
        """
        g = self.gram_at(fit)
        error = g.error(np.arange(len(g.columns)))
        converged = self.deviance(fit.setting) < 1.05 * error + SEARCH.least_deviance_reduction
        return error if converged else np.inf


@dataclass(frozen=True, eq=False)
class Regression:
    """Residual and columns at a fit, (rows, 6) each; a column of a starting point is a whole
    effect.
    """

    columns: dict[Column, Array]
    residual: Array
    starts: Mapping[Column, dict[str, float]]


@dataclass(frozen=True, eq=False)
class Gain:
    """What an effect explains beyond a fit."""

    effect: str
    deviance_reduction: float  # on left-out blocks
    share: float  # of the deviance that the fit leaves
    deviance_left: float  # that remains with it
    size: float  # of its largest coefficient, in typical sizes
    fit: FittedEffects  # with it added, before it is refitted


def unexplained_deviance(
    g: Gram, total: Array, own: Sequence[Column], shape: Array, others: Sequence[Column]
) -> float:
    """Return the deviance of columns, each multiplied by its ``shape``, that the other columns
    cannot explain.
    """
    at, rest = g.index(own), g.index(others)
    deviance = shape @ total[np.ix_(at, at)] @ shape
    if len(rest):
        cross = total[np.ix_(rest, at)] @ shape
        deviance -= (
            cross
            @ np.linalg.lstsq(
                total[np.ix_(rest, rest)] + np.diag(g.precision[rest]), cross, rcond=None
            )[0]
        )
    return float(deviance)


def is_possible(fit: FittedEffects, vehicle: Vehicle) -> bool:
    """Return whether a vehicle can have the coefficients of each effect of a fit together."""
    return all(
        (possible := get(effect).possible) is None or possible(fit.setting[effect], vehicle)
        for effect in fit.effects
    )


def _changed_setting(
    flights: Flights, setting: Setting, columns: Sequence[Column], change: Array
) -> dict[str, dict[str, float]]:
    """Return a setting with changes added, kept in range."""
    out = {k: dict(v) for k, v in setting.items()}
    for (effect, name), delta in zip(columns, change, strict=True):
        if name.startswith((MOMENT_PREFIX, START_PREFIX)):
            continue
        own = out.setdefault(effect, dict(flights.coefficients(setting, effect)))
        value = own.get(name, 0.0) + float(delta)
        if not effect:
            value = float(np.clip(value, *range_of((effect, name), flights.filtered)))
        else:
            c = coefficient((effect, name))
            value = float(np.clip(value, c.minimum, c.maximum))
        own[name] = value
    return out


def with_changes(
    flights: Flights, fit: FittedEffects, columns: Sequence[Column], change: Array, *effects: str
) -> FittedEffects:
    """Return a fit with changes and these effects added, before it is refitted."""
    start = _changed_setting(flights, fit.setting, columns, change)
    for effect in effects:
        if any(c[0] == effect and c[1].startswith(MOMENT_PREFIX) for c in columns):
            start[effect][CENTRAL] = _central(columns, change, effect)
    return FittedEffects(start)


def coefficient_count(effect: str) -> float:
    """Return how many coefficients an effect adds to the model.

    A delay replaces the rotor time offset. Of exact equivalents a change of the log comes last.
    """
    return len(get(effect).coefficients) - is_delay(effect) + 0.1 * (get(effect).kind == "sensing")


def _central(columns: Sequence[Column], change: Array, effect: str) -> float:
    """Return the share of a rotor effect's moment that the free moment parts remove."""
    found = dict(zip(columns, change, strict=True))
    whole = sum(
        abs(d)
        for (e, name), d in found.items()
        if e == effect and not name.startswith(MOMENT_PREFIX)
    )
    taken = -sum(
        d for (e, name), d in found.items() if e == effect and name.startswith(MOMENT_PREFIX)
    )
    return float(np.clip(taken / whole, 0.0, 1.0)) if whole > 0 else 0.0
