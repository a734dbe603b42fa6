"""What the search for missing effects asks of flights: fits of sets of effects, and what each other
effect would explain.

Effects are judged on blocks of the fit that are left out in turn; nothing here looks at the
held-out rows.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ...runtime.errors import InputError
from .commanded_rotors import AFTER_SAG, COMMANDED, SECOND_CHOICE_EFFECTS, mates
from .gram_matrix import Gram, columns_of, gram
from .regression import (
    CENTRAL,
    DELAY_EFFECTS,
    LAG,
    LEAN,
    MOMENT,
    SHIFT,
    START,
    Column,
    Flights,
    Setting,
    coefficient,
    range_of,
    typical,
)
from .starting_points import STARTS
from .turning_delay import LATENCY, turning_delay
from .whitening import Whitener

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SearchSettings:
    """What an effect must explain to be named, and when the Gauss-Newton fit stops.

    A deviance is the sum of squares of a whitened residual: twice the negative log-likelihood, up
    to a constant.
    """

    # deviance on left-out blocks that an effect must explain; a spurious effect explains about 10
    least_deviance_reduction: float = 40.0
    # typical sizes; a smaller effect is not worth a name
    least_size: float = 0.1
    # deviance by which an effect with one more coefficient must be better
    deviance_per_coefficient: float = 8.0
    # Hz, of flights known from commands: the band that weighs effects when they are selected, and
    # the one that weighs their coefficients: noise in commands makes a lag too long if fast changes
    # weigh much
    selection_band_hz: tuple[float, float] = (1.0, 2.0)
    estimation_band_hz: tuple[float, float] = (0.2, 0.5)
    most_iterations: int = 6  # of Gauss-Newton
    # deviance; an iteration that lowers it by less is idle, and two idle ones in a row are the last
    least_iteration_reduction: float = 1.0
    # times what the last iteration gained: what all further iterations together may still gain
    most_further_gain: float = 3.0
    # share of sensor noise in what a column adds or explains; true effects have up to 0.02
    most_noise_share: float = 0.3
    # share of an effect's deviance that the other named effects must leave unexplained. In hover a
    # thrust and a steady force leave 0.00001 of each other; on 78 flights on which two effects were
    # found each left at least 0.019 of the other, on one slow flight 0.0007
    least_independent_share: float = 0.0003


SEARCH = SearchSettings()


@dataclass(eq=False)
class Fit:
    """A set of effects with fitted coefficients."""

    setting: dict[str, dict[str, float]]
    std: dict[Column, float] = field(default_factory=dict)

    @property
    def effects(self) -> list[str]:
        """Names of the effects, in the order in which they were found."""
        return [name for name in self.setting if name]

    def without(self, *effects: str) -> "Fit":
        """Return this fit less some effects."""
        return Fit({k: v for k, v in self.setting.items() if k not in effects})


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
        # a law with a place or a swing of its own imitates too much where thrust itself is a guess:
        # it must be declared
        self.library = tuple(
            e
            for e in library
            if e not in flights.drowned
            and (e not in STARTS or e in declared or not flights.commanded)
        )
        # what these flights hardly excite is not asked for, and may all the same be behind what is
        self.hidden = (
            ()
            if flights.commanded
            else tuple(e for e in library if e in flights.drowned - flights.rounded)
        )
        self.report = report
        # what the vehicle's file states is known, unless it states all of an effect: then that is
        # what may have changed
        self._stated = {
            e.name: e.coefficients
            for e in flights.vehicle.effects
            if {c.name for c in get(e.name).coefficients} - {CENTRAL} - set(e.coefficients)
        }
        # effects that are looked for from several starts; what is declared is one
        self.begun = frozenset(STARTS) - (declared - self._stated.keys())
        # how late commands come true shows in how the vehicle turns; the search takes it as it is
        delay = turning_delay(
            [p.signals for p in flights.pieces({}) if p.log < flights.own], flights.vehicle
        )
        self.delay = delay if flights.commanded and LATENCY in self.library else None
        self.noise: Array = np.zeros((0, 6))
        self.whiten: Whitener

    # ---- columns
    # ------------------------------------------------------------

    def columns_of(self, effect: str, fitted: bool) -> list[Column]:
        """Return the columns of an effect, less the coefficients that the vehicle's file states for
        it.
        """
        if self.held(effect):
            return []
        stated = self._stated.get(effect, {})
        return [c for c in columns_of(effect, fitted) if c[1].removeprefix(MOMENT) not in stated]

    def held(self, effect: str) -> bool:
        """Return whether an effect is known from elsewhere than the residual: it is neither fitted
        nor taken away.
        """
        return self.delay is not None and effect == LATENCY

    def base(self, effects: Sequence[str], tried: Sequence[str] = ()) -> list[Column]:
        """Return the columns of a model: its effects', those of effects that are tried, and the
        shift that any log may have.
        """
        shift = [] if self.flights.commanded or DELAY_EFFECTS & {*effects, *tried} else [SHIFT]
        lag = [] if self.flights.commanded else [LAG]
        return [
            *shift,
            LEAN,
            *lag,
            *self.flights.deviations,
            *(c for e in effects for c in self.columns_of(e, True)),
            *(c for e in tried for c in self.columns_of(e, False)),
        ]

    def linearise(self, fit: Fit, near: Fit | None = None) -> "Regression":
        """Return the regression on the whole library at a fit.

        With a fit ``near`` it, the columns that are only tried are those of there, and effects that
        it has are not tried.
        """
        linear = [e for e in self.library if e not in self.begun and e not in (near or fit).effects]
        wanted = self.base(fit.effects, () if near else linear)
        columns = self.flights.columns(fit.setting, wanted if SHIFT in wanted else [SHIFT, *wanted])
        if near:
            columns |= self.flights.columns(
                near.setting, [c for e in linear for c in self.columns_of(e, False)]
            )
        residual = self.flights.residual(fit.setting)
        begun: dict[Column, dict[str, float]] = {}
        for effect in self.library:
            if effect in self.begun and effect not in fit.effects:
                stated = self._stated.get(effect, {})
                for i, start in enumerate(STARTS[effect](self.flights, residual, stated)):
                    column = (effect, f"{START}{i}")
                    begun[column] = {**start, **stated}
                    changed = {**fit.setting, effect: begun[column]}
                    columns[column] = residual - self.flights.residual(changed)
        return Regression(columns, residual, begun)

    def gram(self, fit: Fit, regression: "Regression") -> Gram:
        """Return the whitened sums of a regression."""
        return gram(self.flights, fit.setting, self.whiten, regression.columns, regression.residual)

    def _whitener(
        self, noise: Array, band: tuple[float, float] = SEARCH.selection_band_hz
    ) -> Whitener:
        flights = self.flights
        return Whitener(
            noise,
            flights.sensor_noise,
            flights.start,
            flights.fit,
            flights.period,
            band if flights.commanded else None,
        )

    def set_noise(self, fit: Fit, regression: "Regression") -> None:
        """Take as noise what the whole library, kept to plausible sizes, cannot
        explain at a fit.
        """
        noise = regression.residual
        columns = {c: x for c, x in regression.columns.items() if not c[1].startswith(START)}
        for _ in range(3):
            self.whiten = self._whitener(noise)
            g = gram(self.flights, fit.setting, self.whiten, columns, regression.residual)
            change = g.solve(g.blocks.sum(axis=0), np.arange(len(g.columns)))
            noise = regression.residual - np.tensordot(
                np.stack(list(columns.values()), axis=2), change, axes=(2, 0)
            )
        self.noise = noise
        self.whiten = self._whitener(noise)

    # ---- fitting
    # ------------------------------------------------------------

    def energy(self, setting: Setting) -> float:
        """Return the whitened energy of the fit's rows at a setting; infinite where no vehicle can
        be like that.
        """
        try:
            residual = self.flights.residual(setting)
        except InputError:
            return np.inf
        return self.whitened_energy(residual)

    def whitened_energy(self, residual: Array) -> float:
        """Return the energy of the fit's rows of a residual (rows, 6) once it is whitened."""
        return float(np.sum(np.square(self.whiten(residual)[self.flights.fit])))

    def refit(self, fit: Fit, enough: float = np.inf) -> Fit:
        """Return the fit with all its coefficients at the least squares of the fit's rows
        (Gauss-Newton).

        One that is on no way to come down to an energy of ``enough`` is given up before it has
        arrived.
        """
        if not self.flights.commanded:
            return self._refit(fit, enough)
        finding = self.whiten
        self.weigh_to_measure()
        out = self._refit(fit)
        self.whiten = finding
        return out

    def weigh_to_measure(self) -> None:
        """Weigh frequencies of flights known from commands as their coefficients need it, not as
        finding effects does.
        """
        self.whiten = self._whitener(self.noise, SEARCH.estimation_band_hz)

    def _refit(self, fit: Fit, enough: float = np.inf) -> Fit:
        setting = {k: dict(v) for k, v in fit.setting.items()}
        wanted = self.base(fit.effects)
        if SHIFT not in wanted:
            setting.get(SHIFT[0], {}).pop(SHIFT[1], None)
        out = Fit(setting)
        if not wanted:
            return out
        before = least = self.energy(setting)
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
            for scale in (1.0, 0.5, 0.25, 0.1)[
                risen:
            ]:  # what has gone too far would come back as far
                trial = _moved(self.flights, setting, wanted, scale * change)
                after = self.energy(trial)
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

    # ---- selection
    # ------------------------------------------------------------

    def gains(self, fit: Fit, regression: "Regression", g: Gram) -> "list[Gain]":
        """Return what each other effect of the library explains beyond a fit, the best first."""
        base = self.base(fit.effects)
        error = g.error(g.index(base))
        total = g.blocks.sum(axis=0)
        out = []
        for effect in self.library:
            if effect in fit.effects or (
                self.flights.commanded and not _follows(effect, fit.effects)
            ):
                continue
            if effect in self.begun:
                tries = [[*base, c] for c in regression.begun if c[0] == effect]
            else:
                tries = [self.base(fit.effects, [effect])]
                if not regression.columns.keys() >= set(tries[0]):
                    continue
            best = Gain(effect, -np.inf, 0.0, np.inf, 0.0, fit)
            for wanted in tries:
                index = g.index(wanted)
                gain = error - g.error(index)
                if gain <= best.energy:
                    continue
                change = g.solve(total, index)
                start = started(self.flights, fit, wanted, change, effect)
                last = wanted[-1]
                if last in regression.begun:
                    start.setting[effect] = dict(regression.begun[last])
                elif self.drowned(g, total, wanted, change, effect):
                    continue
                size = self.size(wanted, change, effect)
                best = Gain(effect, gain, gain / error, error - gain, size, start)
            out.append(best)
        found = [x for x in out if np.isfinite(x.energy)]
        return sorted(
            found,
            key=lambda x: (
                SEARCH.deviance_per_coefficient * freedom(x.effect)
                - x.energy
                * (
                    COMMANDED.second_choice_factor
                    if self.flights.commanded and x.effect in SECOND_CHOICE_EFFECTS
                    else 1.0
                )
            ),
        )

    def size(self, wanted: Sequence[Column], change: Array, effect: str) -> float:
        """Return the largest of an effect's coefficients in typical sizes."""
        return max(
            (
                abs(d) / typical(c, self.flights.vehicle)
                for c, d in zip(wanted, change, strict=True)
                if c[0] == effect
                and not c[1].startswith(MOMENT)
                and typical(c, self.flights.vehicle)
            ),
            default=0.0,
        )

    def drowned(
        self, g: Gram, total: Array, wanted: Sequence[Column], change: Array, effect: str
    ) -> bool:
        """Return whether what an effect adds to the other columns is too little of it, or noise of
        the sensors in good part.

        Or whether what it explains is such noise: less thrust makes less of the attitude's, all
        else being at rest.
        """
        own = [c for c in wanted if c[0] == effect]
        shape = change[[wanted.index(c) for c in own]]
        energy = _beyond(g, total, own, shape, [c for c in wanted if c[0] != effect])
        others = [c for c in wanted if c[0] not in (effect, "")]
        if others and _beyond(
            g, total, own, shape, others
        ) < SEARCH.least_independent_share * _beyond(g, total, own, shape, []):
            return True
        return bool(
            max(self._noise(dict(zip(own, shape, strict=True)))) > SEARCH.most_noise_share * energy
        )

    def noise_explained(self, fit: Fit) -> float:
        """Return by how much a fit lowers the whitened energy because it makes the sensors' noise
        smaller.
        """
        columns = (c for effect in fit.effects for c in self.columns_of(effect, True))
        own, with_floor = self._noise({c: fit.setting[c[0]].get(c[1], 0.0) for c in columns})
        return 2.0 * with_floor - own

    def _noise(self, shape: Mapping[Column, float]) -> tuple[float, float]:
        """Return the whitened energy of the noise in a sum of columns, if known, and how much of
        the floor's goes with it.
        """
        known = {c: value for c, value in shape.items() if c in self.flights.column_noise}
        if not known:
            return 0.0, 0.0
        noise = np.tensordot(
            np.stack([self.flights.column_noise[c] for c in known], axis=2),
            [*known.values()],
            axes=(2, 0),
        )
        noise, floor = (
            self.whiten(x)[self.flights.fit] for x in (noise, self.flights.sensor_noise)
        )
        return float(np.sum(noise * noise)), float(np.sum(noise * floor))

    def error_without(self, fit: Fit, effect: str) -> float:
        """Return the whitened energy on blocks left out once an effect is taken away and all others
        are fitted anew.
        """
        g = self.at(fit.without(effect))
        return g.error(np.arange(len(g.columns)))

    def at(self, fit: Fit) -> Gram:
        """Return the regression on a fit's own columns."""
        columns = self.flights.columns(fit.setting, self.base(fit.effects), 0.1)
        return gram(
            self.flights, fit.setting, self.whiten, columns, self.flights.residual(fit.setting)
        )

    def error(self, fit: Fit) -> float:
        """Return the whitened energy of a fit on blocks left out in turn; infinite where the fit
        did not converge.
        """
        g = self.at(fit)
        error = g.error(np.arange(len(g.columns)))
        # a fit to commands is not weighed as it is judged: it need not be at its least
        return (
            error
            if self.flights.commanded
            or self.energy(fit.setting) < 1.05 * error + SEARCH.least_deviance_reduction
            else np.inf
        )


@dataclass(frozen=True, eq=False)
class Regression:
    """Residual and columns at a fit, (rows, 6) each; those of starts are whole effects."""

    columns: dict[Column, Array]
    residual: Array
    begun: Mapping[Column, dict[str, float]]


@dataclass(frozen=True, eq=False)
class Gain:
    """What an effect explains beyond a fit."""

    effect: str
    energy: float  # whitened, on blocks left out
    share: float  # of what the fit leaves
    left: float  # energy that is then still left
    size: float  # of its largest coefficient, in typical sizes
    fit: Fit  # with it added, before it is refitted


def _beyond(
    g: Gram, total: Array, own: Sequence[Column], shape: Array, others: Sequence[Column]
) -> float:
    """Return the whitened energy of columns, each times its ``shape``, that is left beyond what
    others can make of it.
    """
    at, rest = g.index(own), g.index(others)
    energy = shape @ total[np.ix_(at, at)] @ shape
    if len(rest):
        cross = total[np.ix_(rest, at)] @ shape
        energy -= (
            cross
            @ np.linalg.lstsq(
                total[np.ix_(rest, rest)] + np.diag(g.precision[rest]), cross, rcond=None
            )[0]
        )
    return float(energy)


def _follows(effect: str, named: Sequence[str]) -> bool:
    """Return whether an effect may join those that are named of flights known from commands."""
    return not mates(effect) & set(named) and (effect not in AFTER_SAG or "battery_sag" in named)


def _moved(
    flights: Flights, setting: Setting, columns: Sequence[Column], change: Array
) -> dict[str, dict[str, float]]:
    """Return a setting with changes added, kept in range."""
    out = {k: dict(v) for k, v in setting.items()}
    for (effect, name), delta in zip(columns, change, strict=True):
        if name.startswith((MOMENT, START)):
            continue
        own = out.setdefault(effect, dict(flights.coefficients(setting, effect)))
        value = own.get(name, 0.0) + float(delta)
        if not effect:
            value = float(np.clip(value, *range_of((effect, name))))
        else:
            c = coefficient((effect, name))
            value = float(np.clip(value, c.minimum, c.maximum))
        own[name] = value
    return out


def started(
    flights: Flights, fit: Fit, columns: Sequence[Column], change: Array, *effects: str
) -> Fit:
    """Return a fit with changes and these effects added, before it is refitted."""
    start = _moved(flights, fit.setting, columns, change)
    for effect in effects:
        if any(c[0] == effect and c[1].startswith(MOMENT) for c in columns):
            start[effect][CENTRAL] = _central(columns, change, effect)
    return Fit(start)


def freedom(effect: str) -> float:
    """Return how many coefficients an effect brings with it.

    One that sets the timing takes the shift's place. Of exact equivalents a change of the log comes
    last.
    """
    return (
        len(get(effect).coefficients)
        - (effect in DELAY_EFFECTS)
        + 0.1 * (get(effect).kind == "sensing")
    )


def _central(columns: Sequence[Column], change: Array, effect: str) -> float:
    """Return the share of a law's moment that free moment parts take away."""
    found = dict(zip(columns, change, strict=True))
    whole = sum(
        abs(d) for (e, name), d in found.items() if e == effect and not name.startswith(MOMENT)
    )
    taken = -sum(d for (e, name), d in found.items() if e == effect and name.startswith(MOMENT))
    return float(np.clip(taken / whole, 0.0, 1.0)) if whole > 0 else 0.0
