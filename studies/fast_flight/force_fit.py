"""Coefficients of named effects, by regularised least squares on the force of some flights.

The model is the one that plant, filter and diagnosis run. What is compared passes one low-pass:
the force of these logs was filtered before it was written, by how much is fitted with the
coefficients. A nuisance is fitted with them: a share of thrust of each flight's own, of mean zero
over the flights. A flight that the fit did not see is predicted without one.

Each coefficient has a normal prior: of a given mean and deviation (``blade_element``), else about
zero and of the library's typical size. What a flight hardly shows so stays near it, where free
least squares would take it as far as noise goes. How much data weighs against the prior follows
from the residual itself: its variance over blocks longer than it remembers, which is far more than
that of independent samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from windwrench.dynamics import EffectSetting, Vehicle
from windwrench.dynamics.effects import get
from windwrench.identification.motion.residual import acting_wrench, model_wrench
from windwrench.identification.motion.smoothing import low_pass

from .blade_element import Coefficient, Priors
from .flights import Flight

Array = NDArray[np.float64]
Rows = tuple[Flight, slice]

CUTOFFS_HZ = (5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 15.0)
_ITERATIONS = 3  # of Gauss-Newton: the models are nearly linear in their coefficients
_STEP = 0.1  # of a coefficient's typical size, for the derivative by it
_NOTHING = 1e-9  # typical sizes
_BLOCK = 2.0  # s: longer than the residual remembers
_WEIGHINGS = 5  # of the prior against what the residual shows of its own noise; the fourth settles


@dataclass(frozen=True)
class ForceModel:
    """Effects with fitted coefficients, and the low-pass of the force that was logged."""

    coefficients: Mapping[Coefficient, float]
    cutoff_hz: float | None  # None: none
    own_scales: Mapping[str, float]  # by flight: share of thrust that it alone has
    # (p, p) of the coefficients over their typical sizes, were the model true and without bounds
    covariance: Array

    def vehicle(self, declared: Vehicle) -> Vehicle:
        """Return the vehicle with these effects."""
        return _with(declared, self.coefficients)

    def force(self, flight: Flight, declared: Vehicle) -> Array:
        """Return the force (n, 3) N in body axes that the model says acts at the pose's point."""
        out = _filtered(flight, _force(flight, self.vehicle(declared)), self.cutoff_hz)
        return out + self.own_scales.get(flight.name, 0.0) * self.thrust(flight, declared)

    def thrust(self, flight: Flight, declared: Vehicle) -> Array:
        """Return the part (n, 3) N of it that the rotors' thrust has."""
        return _filtered(flight, _thrust(flight, self.vehicle(declared)), self.cutoff_hz)


def _with(declared: Vehicle, coefficients: Mapping[Coefficient, float]) -> Vehicle:
    effects: dict[str, dict[str, float]] = {}
    for (effect, name), value in coefficients.items():
        effects.setdefault(effect, {})[name] = value
    return declared.with_effects(*(EffectSetting(k, v) for k, v in effects.items()))


def _force(flight: Flight, vehicle: Vehicle) -> Array:
    acting, _ = acting_wrench(flight.signals, vehicle)
    force: Array = np.einsum("nji,nj->ni", flight.signals.rotation, acting[:, :3])
    return force


def _thrust(flight: Flight, vehicle: Vehicle) -> Array:
    out = np.zeros_like(flight.force)
    out[:, 2] = model_wrench(flight.signals, vehicle)[0][:, 0]
    return out


def _filtered(flight: Flight, x: Array, cutoff_hz: float | None) -> Array:
    return x if cutoff_hz is None else low_pass(x, cutoff_hz, flight.signals.period)


def _block_sums(x: Array, period: float) -> Array:
    """Return the sums over blocks of samples, axis by axis, of rows (3 n, c) that hold the three
    axes of one sample after the other; each over the root of the block's samples.
    """
    samples = len(x) // 3
    length = min(max(1, round(_BLOCK / period)), max(1, samples))
    count = samples // length
    blocks = x[: 3 * count * length].reshape(count, length, 3, x.shape[1])
    return np.asarray(blocks.sum(axis=1).reshape(3 * count, x.shape[1]) / np.sqrt(length))


class Regression:
    """Fits of the same coefficients to different rows of the same flights.

    All are solved with the model's derivatives at one point, the least squares of all flights.
    """

    def __init__(
        self,
        flights: Sequence[Flight],
        declared: Vehicle,
        coefficients: Sequence[Coefficient],
        priors: Priors | None = None,
    ) -> None:
        self.declared, self.coefficients = declared, tuple(coefficients)
        known = [
            next(c for c in get(effect).coefficients if c.name == name)
            for effect, name in coefficients
        ]
        self._scale = np.array([c.typical[0] or 1.0 for c in known])
        stated = [(priors or {}).get(key) for key in self.coefficients]
        means = [0.0 if prior is None else prior[0] for prior in stated]
        self._mean = np.array(means) / self._scale
        deviations = [
            size if prior is None else prior[1]
            for prior, size in zip(stated, self._scale, strict=True)
        ]
        self._precision = np.square(self._scale / np.array(deviations))
        self._low = np.array([c.minimum for c in known]) / self._scale
        self._high = np.array([c.maximum for c in known]) / self._scale
        self._low, self._high = (
            np.minimum(self._low, self._high),
            np.maximum(self._low, self._high),
        )
        self._models: dict[str, tuple[Array, Array]] = {}
        self._smoothed: dict[tuple[str, float | None], tuple[Array, Array]] = {}
        self._at = np.clip(np.zeros(len(known)), self._low, self._high)
        for _ in range(_ITERATIONS):
            self._models = {flight.name: self._linear(flight) for flight in flights}
            self._smoothed = {}
            self._at = self._solve([(flight, slice(None)) for flight in flights], None)[0]

    def _force_at(self, flight: Flight, at: Array) -> Array:
        values = (float(x) for x in at * self._scale)
        coefficients = dict(zip(self.coefficients, values, strict=True))
        return _force(flight, _with(self.declared, coefficients))

    def _linear(self, flight: Flight) -> tuple[Array, Array]:
        """Return the force (n, 3) that is left if all coefficients were zero, and its derivative
        (n, 3, p + 1) by each over its typical size and by the share of thrust.
        """
        base = self._force_at(flight, self._at)
        slopes = np.empty((*base.shape, len(self._at) + 1))
        for k in range(len(self._at)):
            moved = self._at.copy()
            moved[k] += _STEP if moved[k] + _STEP <= self._high[k] else -_STEP
            slopes[..., k] = (self._force_at(flight, moved) - base) / (moved[k] - self._at[k])
        slopes[..., -1] = _thrust(flight, self.declared)
        return flight.force - base + slopes[..., :-1] @ self._at, slopes

    def _filtered(self, flight: Flight, cutoff_hz: float | None) -> tuple[Array, Array]:
        key = flight.name, cutoff_hz
        if key not in self._smoothed:
            left, slopes = self._models[flight.name]
            smooth = _filtered(flight, left - flight.force, cutoff_hz) + flight.force
            self._smoothed[key] = smooth, _filtered(flight, slopes, cutoff_hz)
        return self._smoothed[key]

    def _solve(
        self, rows: Sequence[Rows], cutoff_hz: float | None
    ) -> tuple[Array, dict[str, float], Array, float]:
        """Return coefficients over their typical sizes, each flight's own share of thrust, the
        coefficients' covariance, and the mean square of what is left.
        """
        names = list(dict.fromkeys(flight.name for flight, _ in rows))
        p, own = len(self._at), len(names) - 1
        G, h, whole, count = np.zeros((p + own, p + own)), np.zeros(p + own), 0.0, 0
        sums = []  # over each block: of the force that is left, and of its derivatives
        for flight, part in rows:
            left, slopes = self._filtered(flight, cutoff_hz)
            A = slopes[part].reshape(-1, p + 1)
            y = left[part].ravel()
            place = names.index(flight.name)
            # shares of mean zero: the last flight's is minus the sum of the others'
            signs = -np.ones(own) if place == own else np.eye(own)[place]
            A = np.hstack([A[:, :p], A[:, p:] * signs])
            G, h, whole, count = G + A.T @ A, h + A.T @ y, whole + float(y @ y), count + len(y)
            sums.append(_block_sums(np.column_stack([A, y]), flight.signals.period))
        parts = np.concatenate(sums)
        x, noise = np.zeros(p + own), 0.0
        for _ in range(_WEIGHINGS):
            x = self._bounded(G, h, noise, p)
            # of one sample, were its neighbours independent of it
            noise = float(np.mean(np.square(parts[:, -1] - parts[:, :-1] @ x)))
        shares = [*x[p:], -float(np.sum(x[p:]))]
        loss = (whole - 2.0 * float(x @ h) + float(x @ G @ x)) / count
        known = G / noise + np.diag(np.concatenate([self._precision, np.zeros(own)]))
        covariance = np.asarray(np.linalg.inv(known)[:p, :p], dtype=np.float64)
        return x[:p], {n: float(s) for n, s in zip(names, shares, strict=True)}, covariance, loss

    def _bounded(self, G: Array, h: Array, noise: float, p: int) -> Array:
        """Return the likeliest coefficients over their typical sizes and shares of thrust within
        their ranges, at a variance (N2) of the noise.
        """
        own = len(h) - p
        G = G + np.diag(np.concatenate([noise * self._precision, np.zeros(own)]))
        h = h + np.concatenate([noise * self._precision * self._mean, np.zeros(own)])
        size = np.sqrt(np.diag(G)) + 1e-12
        root = np.linalg.cholesky(G / np.outer(size, size) + 1e-10 * np.eye(p + own))
        free = np.full(own, np.inf)
        found = lsq_linear(
            root.T,
            np.linalg.solve(root, h / size),
            (
                np.concatenate([self._low, -free]) * size,
                np.concatenate([self._high, free]) * size,
            ),
        )
        x = np.asarray(found.x) / size
        return np.where(np.abs(x) < _NOTHING, 0.0, x)  # a bound that is nearly reached is reached

    def fit(
        self, rows: Sequence[Rows], cutoffs_hz: Sequence[float | None] = CUTOFFS_HZ
    ) -> ForceModel:
        """Return the model that leaves least of the force at some rows of some flights."""
        solved = [(*self._solve(rows, cutoff), cutoff) for cutoff in cutoffs_hz]
        at, shares, covariance, _, cutoff_hz = min(solved, key=lambda found: found[3])
        values = (float(x) for x in at * self._scale)
        coefficients = dict(zip(self.coefficients, values, strict=True))
        return ForceModel(coefficients, cutoff_hz, shares, covariance)

    def doubt(self, model: ForceModel, flight: Flight) -> float:
        """Return the RMS (N, vector) by which the force on a flight is uncertain since a model's
        coefficients are, were the model true.
        """
        slopes = self._filtered(flight, model.cutoff_hz)[1][..., :-1]
        variance = np.einsum("nai,ij,naj->", slopes, model.covariance, slopes) / len(slopes)
        return float(np.sqrt(variance))
