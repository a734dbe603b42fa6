"""The likelihood of a flight's force balance near a setting of effects, with one noise for all
settings.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ...dynamics.effects import Role, get, playing
from ..findings import LEAST_RIVAL
from ..logs.table import Array, ArrayMap, Data, Names, Pair
from ..motion.smoothing import mean_square
from .climbing import Height, height, linearised, mode
from .coefficients import Effects, Setting, without
from .column import Column, Part
from .discrepancy import changing_columns, discrepancy_columns, variables
from .flight_rows import delivered
from .gusty_wind import gusts
from .log_offsets import LAG_ASYMMETRY
from .priors import (
    Base,
    Starts,
    from_declared,
    in_prior_units,
    prior_size,
)
from .regression import RegressedFlights
from .row_noise import ROUNDS, RowNoise
from .row_nuisances import answered, followers, row_nuisances
from .rows import Rows

# prior standard deviations of a rate loop's answers, beside which the noise is fitted: a column
# shares with disturbances all that any answer can hold
FREE = 30.0
DRAWS = 64  # of the posterior of gusts, for the noise beside them
GUSTY_ROUNDS = 2  # fits of the noise beside gusts, each with a fit of the wind


class RowLikelihood:
    """The likelihood of flights.

    ``library`` is the part of the given one with a trace in them.

    Args:
        flights: the vehicle's flights.
        library: effects, the given ones of every set among them.
        first: the setting of these given effects.
        fixed: effects known from elsewhere, with their coefficients.
    """

    def __init__(
        self, flights: RegressedFlights, library: Sequence[str], first: Setting, fixed: Setting
    ) -> None:
        self.flights = flights
        self.library = list(library)
        self.rows = Rows(flights, fixed)
        self.nuisances = _named(row_nuisances(self.rows))
        self.power = 1.0
        self._gusty: dict[Effects, RowNoise] = {}  # sets with a gusty wind, and their noise
        self.noise = self._noise(first)
        self._use = self.rows.fit & self.noise.known

    def _noise(self, first: Setting) -> RowNoise:
        rows = self.rows
        y = rows.residual(first)
        linear = [e for e in self.library if not self.flights.is_nonlinear(e)]
        columns = rows.columns(first, self.flights.columns_of(linear))
        traced = {c.effect for c, x in columns.items() if x.any()}
        self.library = [e for e in self.library if e in traced or e not in linear]
        own = [x * prior_size(c, self.flights) for c, x in columns.items() if c.effect in traced]
        signals = followers(rows)
        explained = np.zeros_like(y)
        without_memory = np.zeros((0, rows.channels, rows.channels))
        size = mean_square(y[rows.fit]) + np.square(rows.least)
        begun = RowNoise(without_memory, np.diag(size), rows.begins)
        # first as if a signal were all disturbances that it follows
        for _ in range(ROUNDS):
            self._answers = _named(answered(rows, signals, y - explained))
            noise, z = self._noise_beside(y, [*own, *self.nuisances.values()], begun)
            explained = sum(map(np.multiply, own, z), np.zeros_like(y))
        self._own = own
        return noise

    def _gusts(self, setting: Setting) -> dict[Column, Array]:
        """Return the columns of a wind's changes."""
        t = np.concatenate([[0.0], np.cumsum(np.diff(self.rows.t) * ~self.rows.begins[1:])])
        each = gusts(t, {**self.rows.fixed, **setting}, self.flights)
        return _named(
            {
                f"gust {k} of {c.coefficient}": x[:, None] * slope
                for c, slope in self.rows.columns(setting, each).items()
                for k, x in enumerate(each[c].T)
            }
        )

    def _noise_beside(
        self,
        y: Array,
        known: Sequence[Array],
        noise: RowNoise,
        rng: np.random.Generator | None = None,
    ) -> tuple[RowNoise, Array]:
        """Return the noise of the residual ``y`` (n, channels), and the coefficients beside it.

        A signal that follows disturbances explains them without making them less: they stay noise,
        and so does all that a column shares with such signals.

        Args:
            y: with the given effects of every set.
            known: (n, channels) each, columns in standard deviations of their priors.
            noise: at the start.
            rng: of draws from the posterior; none: its mode.
        """
        rows = self.rows
        free = FREE if rows.with_torques else 1.0
        X = np.stack([*known, *(free * x for x in self._answers.values())], axis=2)
        # a single draw moves the noise, and a wind of 6 m/s beside it by 1 m/s
        draws = (
            np.zeros((X.shape[2], 1)) if rng is None else rng.standard_normal((X.shape[2], DRAWS))
        )
        begins, fit = (np.tile(x, draws.shape[1]) for x in (rows.begins, rows.fit))
        for _ in range(ROUNDS):
            use = rows.fit & noise.known
            x = noise.white(X)[use].reshape(-1, X.shape[2])
            factor = np.linalg.cholesky(x.T @ x + np.eye(x.shape[1]))
            right = np.linalg.solve(factor, x.T @ noise.white(y)[use].ravel())
            z = np.linalg.solve(factor.T, right[:, None] + draws)
            left = [y - X[:, :, : len(known)] @ x for x in z[: len(known)].T]
            noise = RowNoise.fitted(np.concatenate(left), begins, fit, rows.least)
            noise = noise._replace(begins=rows.begins)
        return noise, z[:, 0]

    def base(
        self,
        setting: Setting,
        starts: Starts,
        effects: Iterable[str] | None = None,
        unknown: bool = False,
    ) -> Base:
        """Return the likelihood about a setting.

        Args:
            setting: the setting of effects.
            starts: columns of whole effects, with the coefficients of each.
            effects: effects to ask about; default: all of the library.
            unknown: whether the dictionary's columns are among them.
        """
        rows = self.rows
        flights = self.flights
        residual = rows.residual(setting)
        if effects is None:
            effects = [e for e in self.library if not flights.is_nonlinear(e) or e in setting]
        noise = self._gusty.get(frozenset(setting), self.noise)
        columns = self.nuisances | self._answers
        if noise is not self.noise:
            columns |= self._gusts(setting)
        if not flights.commanded and playing(Role.LAG, among=setting):
            # lagging rotors may speed up sooner than they slow down
            columns |= rows.columns(setting, [LAG_ASYMMETRY])
        columns |= rows.columns(setting, flights.columns_of(effects))
        for c, start in starts.items():
            columns[c] = residual - rows.residual({**setting, c.effect: dict(start)})
        if unknown:
            columns |= self._dictionary(setting)
        x = noise.white(np.stack([*columns.values(), residual], axis=2))[self._use]
        sizes = np.linalg.slogdet(noise.covariance)[1] - np.linalg.slogdet(self.noise.covariance)[1]
        ends = np.flatnonzero(np.diff(rows.block[self._use])) + 1
        flight = flights.log[rows.at[self._use]][np.append(0, ends)]
        parts = (p.reshape(-1, x.shape[2]) for p in np.split(x, ends))
        blocks = zip(flight.tolist(), (p.T @ p for p in parts), strict=True)
        return in_prior_units(flights, list(columns), blocks, len(x) * sizes, setting, starts)

    def _dictionary(self, setting: Setting) -> dict[Column, Array]:
        """Return the dictionary's columns, changing coefficients among them."""
        rows = self.rows
        flights = self.flights
        pieces = flights.pieces({})
        names = ("t", "position", "rotation", "velocity", "angular_velocity")
        joined: Data = {x: np.concatenate([getattr(p.signals, x) for p in pieces]) for x in names}
        delivery = [delivered(p.signals, flights.vehicle) for p in pieces]
        rotors = np.concatenate(delivery) / flights.inertias[2:]
        # the acceleration is the rotors' alone, without disturbances
        joined["acceleration"] = rotors[:, :1] * joined["rotation"][:, :, 2]
        whole = replace(pieces[0].signals, **joined)
        ends = np.cumsum([len(x) for x in delivery])[:-1]
        out = {}
        for column, made in discrepancy_columns(whole, rotors, ends, flights).items():
            x = made.whole
            if rows.with_torques or x[:, :3].any():
                parts = zip(np.split(x, ends), pieces, strict=True)
                out[column] = rows.from_world(np.concatenate([p.smooth(part) for part, p in parts]))
        here = rows.residual(setting)
        own = {e: rows.residual(without(setting, e)) - here for e in setting}
        at = np.concatenate([i + p.rows for i, p in zip([0, *ends], pieces, strict=True)])
        followed = {name: rows.at_rows(x[at]) for name, x in variables(whole, rotors).items()}
        changing = changing_columns(own, followed)
        return out | {column: made.x[:, None] * made.y for column, made in changing.items()}

    # Fits

    def _height(self, setting: Setting) -> Height:
        """Return the height of the posterior at a setting, up to a constant, with the nuisances
        integrated out.
        """
        base = self.base(setting, {}, ())
        m = base.marginal((), base.plain, self.power)
        off = from_declared(self.flights.columns_of(setting), self.flights, setting)

        def target() -> Setting:
            base = self.base(setting, {}, setting)
            return linearised(self.flights, base, setting, self.power)[1]()

        return 0.5 * np.square(off).sum() - m.constant, target

    def objective(self, setting: Setting) -> float:
        """Return minus the logarithm of likelihood and prior at a setting, up to a constant;
        infinite for an impossible vehicle.
        """
        return height(setting, self._height)[0]

    def fitted(self, setting: Setting) -> Setting:
        """Return the mode of the posterior of a setting's effects; a wind is steady or gusty, as
        is likelier.
        """
        key = frozenset(setting)
        self._gusty.pop(key, None)
        steady = mode(setting, self._height)
        if not any(get(e).sets_wind for e in (*self.rows.fixed, *setting)):
            return steady
        least = self.objective(steady)
        for _ in range(GUSTY_ROUNDS):
            # by draws of the gusts' posterior: their mode would leave too little noise (G. Celeux
            # and J. Diebolt, Computational Statistics Quarterly 2 (1985), 73-82)
            columns = self.nuisances | self._gusts(setting)
            if not self.rows.with_torques:  # a tilt is an answer to gusts, and no rate loop's
                columns |= self._answers
            known = [*self._own, *columns.values()]
            rng = np.random.default_rng(0)
            y = self.rows.residual(setting)
            self._gusty[key], _ = self._noise_beside(y, known, self.noise, rng)
            setting = mode(setting, self._height)
        if self.objective(setting) <= least:
            return setting
        del self._gusty[key]
        return steady

    def sensors(self, setting: Setting) -> dict[str, Pair]:
        """Return the likeliest biases of accelerometers from which the motion was read, and the
        time offsets of logs, in the units of ``offsets``, with their standard deviations.
        """
        base = self.base(setting, {}, ())
        modes = base.mode(base.plain, self.power)
        out = {}
        for c, offset in self.flights.offsets.items():
            mode, std = modes[c._replace(part=Part.NUISANCE)]
            out[c.coefficient] = (
                float(np.clip(offset.size * mode, *offset.range)),
                offset.size * std,
            )
        return out

    def is_idle(self, setting: Setting, among: Iterable[str]) -> bool:
        """Return whether an effect of a setting, among some, does nothing there."""
        here = self.rows.residual(setting)
        least = 1e-6 * np.abs(here).max()
        parts = (self.rows.residual(without(setting, e)) - here for e in among)
        return any(np.abs(part).max() <= least for part in parts)

    def behind(self, best: Setting) -> dict[str, Names]:
        """Return, for each effect of a set, possible effects hidden in the logs with as much
        explained in its place.
        """
        flights = self.flights
        unseen = sorted(flights.needs_pose - flights.without_trace - set(best))
        hidden = [e for e in unseen if not flights.is_nonlinear(e)]
        if not hidden or not best:
            return {}
        base = self.base(best, {}, [*best, *hidden])
        m = base.marginal(base.asked, base.plain, self.power)

        def explained(effects: set[str]) -> float:
            return m.gain([c for c in m.place if c.effect in effects])

        # up to the deviance of a rival's likelihood
        whole = explained(set(best)) + 2.0 * math.log(LEAST_RIVAL)
        return {e: tuple(h for h in hidden if explained({*best, h} - {e}) > whole) for e in best}


def _named(columns: ArrayMap) -> dict[Column, Array]:
    return {Column("", name, Part.NUISANCE): x for name, x in columns.items()}
