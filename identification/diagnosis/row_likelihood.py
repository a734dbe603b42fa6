"""The likelihood of a flight's force balance near a setting of effects, with one noise for all
settings.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from ...dynamics.effects import Role, playing
from ...runtime.errors import InputError
from ..motion.smoothing import low_pass
from .climbing import linear_mode, mode
from .discrepancy import State, changing_columns, discrepancy_columns, variables
from .evidence import Index, marginal, tempering
from .likelihood import NUISANCE, UNKNOWN, Sums, declared
from .priors import Base, Setting, in_prior_units, prior_size
from .regression import START_PREFIX, Column, Flights
from .row_noise import RowNoise, fitted_noise, white_noise
from .row_nuisances import answered, followers, row_nuisances
from .rows import Rows
from .sensor_bias import flight_and_axis
from .time_offsets import LAG_ASYMMETRY, timing_of

Array = NDArray[np.float64]
Starts = Mapping[Column, Mapping[str, float]]


@dataclass(frozen=True)
class RowLikelihoodSettings:
    """When fits stop."""

    noise_rounds: int = 3
    idle: float = 1e-6  # of the largest residual, up to which an effect does nothing


ROW_LIKELIHOOD = RowLikelihoodSettings()


class RowLikelihood:
    """The likelihood of flights.

    ``library`` is what of the given one leaves a trace in them.

    Args:
        flights: of the vehicle.
        library: effects that may act, those that any set has among them.
        first: the setting of those that any set has.
        fixed: effects that are known from elsewhere, with their coefficients.
    """

    def __init__(
        self, flights: Flights, library: Sequence[str], first: Setting, fixed: Setting
    ) -> None:
        self.flights, self.library = flights, list(library)
        self.rows = Rows(flights, fixed)
        self.nuisances = _named(row_nuisances(self.rows))
        self.power = 1.0
        self.noise: RowNoise = self._noise(first)
        self._use = self.rows.fit & self.noise.known
        N = self._white(np.stack(list(self.nuisances.values()), axis=2))
        self._given = N.reshape(-1, N.shape[2])
        self._inner = self._given.T @ self._given

    def _noise(self, first: Setting) -> RowNoise:
        rows = self.rows
        y = rows.residual(first)
        linear = [e for e in self.library if not self.flights.is_nonlinear(e)]
        found = rows.columns(first, self.flights.columns_of(linear))
        traced = {c[0] for c, x in found.items() if x.any()}
        self.library = [e for e in self.library if e in traced or e not in linear]
        wanted = self.flights.columns_of(e for e in linear if e in traced)
        own = [found[c] * prior_size(c, self.flights) for c in wanted]
        if self.flights.commanded:
            return self._noise_beside(y, own, {})[0]
        # first as if all of a signal could be disturbances that it follows
        signals = followers(rows)
        _, explained = self._noise_beside(y, own, _named(answered(rows, signals, y)))
        answers = _named(answered(rows, signals, y - explained))
        noise, _ = self._noise_beside(y, own, answers)
        self.nuisances |= answers
        return noise

    def _noise_beside(
        self, y: Array, own: Sequence[Array], answers: Mapping[Column, Array]
    ) -> tuple[RowNoise, Array]:
        """Return the noise of the residual ``y`` (n, channels) and what effects explain of it.

        What follows disturbances explains them, and does not make them less: they are noise.

        Args:
            y: of what every set has.
            own: columns of effects, in standard deviations of their priors.
            answers: columns of what follows disturbances.
        """
        rows = self.rows
        X = np.stack([*own, *self.nuisances.values(), *answers.values()], axis=2)
        known = X.shape[2] - len(answers)
        noise = white_noise(y, rows.begins, rows.fit)
        for _ in range(ROW_LIKELIHOOD.noise_rounds):
            use = rows.fit & noise.known
            x = noise.white(X)[use].reshape(-1, X.shape[2])
            z = noise.white(y)[use].ravel()
            mode = np.linalg.solve(x.T @ x + np.eye(x.shape[1]), x.T @ z)
            noise = fitted_noise(y - X[:, :, :known] @ mode[:known], rows.begins, rows.fit)
        return noise, X[:, :, : len(own)] @ mode[: len(own)]

    def _white(self, x: Array) -> Array:
        return self.noise.white(x)[self._use]

    # Sums

    def sums(
        self, setting: Setting, wanted: Iterable[Column], starts: Starts, unknown: bool = False
    ) -> Sums:
        """Return the sums of products about a setting, of these columns, of the nuisances and of
        the residual.

        Args:
            setting: of effects.
            wanted: coefficients of effects.
            starts: columns of whole effects, with the coefficients of each.
            unknown: whether the dictionary's columns are among them.
        """
        rows, residual = self.rows, self.rows.residual(setting)
        columns = dict(self.nuisances) | self._uneven_lag(setting)
        columns |= rows.columns(setting, [c for c in wanted if not c[1].startswith(START_PREFIX)])
        for c, start in starts.items():
            columns[c] = residual - rows.residual({**setting, c[0]: dict(start)})
        if unknown:
            columns |= self._dictionary() | self._changing(setting)
        names = tuple(columns)
        x = self._white(np.stack([*columns.values(), residual], axis=2))
        block = self.rows.block[self._use]
        ends = np.flatnonzero(np.diff(block)) + 1
        parts = [p.reshape(-1, p.shape[2]) for p in np.split(x, ends)]
        value = [
            0.0
            if not effect or name.startswith(START_PREFIX)
            else self.flights.coefficients(setting, effect).get(name, 0.0)
            - declared((effect, name), self.flights)
            for effect, name in names
        ]
        return Sums(names, np.array([p.T @ p for p in parts]), np.array(value), 0.0)

    def base(self, setting: Setting, starts: Starts, unknown: bool = False) -> Base:
        """Return the likelihood about a setting, with all effects of the library."""
        linear = [e for e in self.library if not self.flights.is_nonlinear(e) or e in setting]
        sums = self.sums(setting, self.flights.columns_of(linear), starts, unknown)
        return in_prior_units(self.flights, sums, setting, starts)

    def _dictionary(self) -> dict[Column, Array]:
        flights, vehicle = self.rows.flights, self.flights.vehicle
        pieces = flights.pieces({})
        seen = self._states()
        inertias = np.array([vehicle.mass] * 3 + np.diagonal(vehicle.inertia).tolist())
        found = discrepancy_columns(
            seen, [p.signals.t for p in pieces], vehicle.weight, vehicle.arm_l, inertias
        )
        out: dict[Column, Array] = {}
        for (group, name), parts in found.items():
            if not self.rows.with_torques and not any(x[:, :3].any() for x in parts):
                continue
            sampled = np.concatenate(
                [
                    low_pass(x, flights.residual_hz, p.signals.period)[p.rows]
                    for x, p in zip(parts, pieces, strict=True)
                ]
            )
            out["", f"{UNKNOWN}{group}: {name}"] = self.rows.from_world(
                sampled[:, :3], torque=sampled[:, 3:]
            )
        return out

    def _states(self) -> list[State]:
        """Return the flight; the acceleration is the rotors', which knows no disturbance."""
        vehicle, out = self.flights.vehicle, []
        for s in (p.signals for p in self.rows.flights.pieces({})):
            rotors = vehicle.rotor_wrench(s.rotor_speeds)
            push = rotors[:, :1] / vehicle.mass * s.rotation[:, :, 2]
            out.append(State(s.position, s.rotation, s.velocity, s.angular_velocity, rotors, push))
        return out

    def _changing(self, setting: Setting) -> dict[Column, Array]:
        """Return the dictionary's columns of effects whose coefficients change."""
        rows, pieces = self.rows, self.rows.flights.pieces({})
        here = rows.residual(setting)
        parts = {e: [rows.residual(_without(setting, e)) - here] for e in setting}
        found = variables(self._states(), [p.signals.t for p in pieces])
        at_rows = {
            name: [rows.at_rows([z[p.rows] for z, p in zip(x, pieces, strict=True)])]
            for name, x in found.items()
        }
        return {
            ("", f"{UNKNOWN}{group}: {name}"): column[0]
            for (group, name), column in changing_columns(parts, at_rows).items()
        }

    # Fits

    def deviance(self, setting: Setting) -> float:
        """Return -2 log-likelihood at a setting, with the nuisances integrated out, up to a
        constant.

        Raises:
            InputError: no vehicle is like that.
        """
        w = self._white(self.rows.residual(setting)).ravel()
        factor, b = self._nuisance_sums(w, setting)
        return self.power * float(w @ w) - float(b @ cho_solve(factor, b))

    def _uneven_lag(self, setting: Setting) -> dict[Column, Array]:
        """Return what rotors that speed up sooner than they slow down do beside a lag."""
        if self.flights.commanded or not playing(Role.LAG, among=list(setting)):
            return {}
        return self.rows.columns(setting, [LAG_ASYMMETRY])

    def _nuisance_sums(self, w: Array, setting: Setting) -> tuple[tuple[Array, bool], Array]:
        inner, right = self._inner, self._given.T @ w
        for c, column in self._uneven_lag(setting).items():
            x = self._white(column).ravel() * prior_size(c, self.flights)
            cross = self._given.T @ x
            inner = np.block([[inner, cross[:, None]], [cross, x @ x]])
            right = np.append(right, x @ w)
        return cho_factor(self.power * inner + np.eye(len(inner))), self.power * right

    def objective(self, setting: Setting) -> float:
        """Return minus the logarithm of likelihood and prior at a setting, up to a constant;
        infinite where no vehicle is like that.
        """
        prior = sum(
            ((setting[e].get(name, 0.0) - declared((e, name), self.flights)) / size) ** 2
            for e, name in self.flights.columns_of(setting)
            if (size := prior_size((e, name), self.flights))
        )
        try:
            return 0.5 * (self.deviance(setting) + prior)
        except (InputError, np.linalg.LinAlgError):
            return math.inf

    def sensors(self, setting: Setting) -> dict[str, tuple[float, float]]:
        """Return the likeliest biases of accelerometers from which the motion was read, and the
        time offsets of logs, as ``Flights`` takes them out, with their standard deviations.
        """
        w = self._white(self.rows.residual(setting)).ravel()
        factor, b = self._nuisance_sums(w, setting)
        modes = cho_solve(factor, b)
        std = np.sqrt(np.diag(cho_solve(factor, np.eye(len(b)))))
        at = {name: i for i, (_, name) in enumerate(self.nuisances)}
        out = {}
        for column in (*self.flights.biases, *self.flights.time_offsets):
            timing = timing_of(column, self.flights.filtered)
            if timing is None:
                flight, axis = flight_and_axis(column[1])
                size, limits = float(self.flights.bias_std(flight)[axis]), (-math.inf, math.inf)
            else:
                size, limits = timing.size, timing.range
            if (i := at.get(NUISANCE + column[1])) is not None:
                value = float(np.clip(size * modes[i], *limits))
                out[column[1]] = value, size * float(std[i])
        return out

    def idle(self, setting: Setting) -> set[str]:
        """Return the effects of a setting that do nothing there."""
        here = self.rows.residual(setting)
        least = ROW_LIKELIHOOD.idle * float(np.abs(here).max())
        return {
            effect
            for effect in setting
            if np.abs(self.rows.residual(_without(setting, effect)) - here).max() <= least
        }

    def fitted(self, setting: Setting) -> Setting:
        """Return the mode of the posterior of a setting's effects."""
        wanted = self.flights.columns_of(setting)
        return mode(setting, lambda x: (self.objective(x), lambda: self._linear_mode(x, wanted)))

    def _linear_mode(self, setting: Setting, wanted: Sequence[Column]) -> Setting:
        base = in_prior_units(self.flights, self.sums(setting, wanted, {}), setting, {})
        asked = np.array([base.columns[c] for c in wanted], dtype=np.intp)
        total = self.power * base.blocks.sum(axis=0)
        ones = np.ones(len(base.plain))
        m = marginal(total[:-1, :-1], total[:-1, -1], 0.0, asked, base.plain, ones)
        return linear_mode(self.flights, base, m, asked, wanted, setting)

    def tempered(self, setting: Setting) -> float:
        """Return the power of the likelihood that its scatter beside a setting allows."""
        wanted = self.flights.columns_of(setting)
        base = in_prior_units(self.flights, self.sums(setting, wanted, {}), setting, {})
        chosen: Index = np.arange(len(base.columns))
        return tempering(base.blocks, chosen)


def _named(columns: Mapping[str, Array]) -> dict[Column, Array]:
    return {("", f"{NUISANCE}{name}"): x for name, x in columns.items()}


def _without(setting: Setting, effect: str) -> Setting:
    return {e: x for e, x in setting.items() if e != effect}
