"""Fitting the parameters: Gauss-Newton on Whittle's likelihood, the noise's spectrum taken from the
residual in turn, and the covariance of the result.

Measured rotor speeds are noisy (rounded). Their noise adds to the columns' own power and would
shrink the coefficients, so the addition is taken off before the normal equations are solved.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import stdtrit

from ...runtime.arrays import Array, Complex, Floats, Index, Mask
from ...runtime.errors import InputError
from ..logs.table import ArrayPair, NamedNumbers, Names, Values
from .channels import Pieces
from .columns import ANSWERED_HZ, BalanceSpectra, balance
from .geometry import Interval
from .model import LOGARITHMIC, Model, slopes
from .spectra import LOSS, TAPERS, Segment, Spectra, residual_spectra

Function = Callable[[Values], float]

_ROUNDS = 12  # each with a new spectrum and a new linearisation
_STEPS = 2  # Gauss-Newton steps in each round
_CLOSE = 0.02  # standard deviations: a smaller change ends the rounds
_RANGES = {"lag": (0.0, 0.5), "delay": (-0.1, 0.1), "gamma": (-4.0, 4.0)}  # s, s, 1
_MOST_CHANGE = 0.05  # for each of these in a round
# one frequency's leverage: noise is hidden where the parameters explain nearly all power
_MOST_LEVERAGE = 0.8
_UNKNOWN = 0.1  # least share of the residual: the noise is known to some per cent only
# largest moment of inertia over the sum of the others: 1 of a flat body, and a file rounds
_FLATTEST = 0.995


@dataclass(frozen=True, eq=False)
class VehicleFit:
    """The best parameters."""

    theta: Array  # (p,)
    information: Array  # (p, p), with priors
    scores: Array  # (s, p): each segment's gradient
    loss: float  # twice the negative log-likelihood, up to a constant
    balance: BalanceSpectra
    spectra: Spectra  # (m, 6) a segment
    kept: Names = ()  # visible further effects
    # an invisible moment of velocity: value, deviation, least visible value
    hidden: Interval | None = None
    doubt: str = ""  # reason to believe no estimate of torque

    @cached_property
    def covariance(self) -> Floats:
        """Covariance (p, p): by the noise's spectrum, or by the segments' own scatter (White's
        sandwich), the larger of the two parameter by parameter.
        """
        inverse = np.linalg.inv(self.information)
        count = len(self.scores)
        if count < 4:
            return LOSS * inverse
        scatter = ((self.scores @ inverse) ** 2).sum(axis=0) * (count / (count - 1.0))
        # few segments scatter: their evidence counts by how many there are
        share = count / (count + 30.0)
        ratio = scatter / (LOSS * np.diag(inverse))
        grow = np.sqrt(1.0 + share * np.maximum(ratio - 1.0, 0.0))
        return LOSS * inverse * np.outer(grow, grow)

    @property
    def model(self) -> Model:
        """The model of the balance."""
        return self.balance.model

    @property
    def values(self) -> NamedNumbers:
        """All parameters in SI units."""
        return self.model.values(self.theta)

    @cached_property
    def width(self) -> float:
        """Standard deviations to either end of a 95 % interval: Student's, for the segments."""
        return float(stdtrit(max(len(self.balance.segments) - 1, 3), 0.975))

    def again(self, theta: Array | None = None, **changes: Any) -> "VehicleFit":
        """Return the fit of a changed model, from these parameters or others."""
        theta = self.theta if theta is None else theta
        return solve(self.balance.pieces, replace(self.model, **changes), theta)

    def interval(self, what: str | Function, logarithm: bool = True) -> Interval:
        """Return value, low and high of a parameter, or of a function of the parameters, in SI
        units; of a positive quantity as a ratio.
        """

        def at(theta: Array) -> float:
            values = self.model.values(theta)
            return values[what] if isinstance(what, str) else what(values)

        here, slope = slopes(at, self.theta)
        size = self.width * math.sqrt(max(float(slope @ self.covariance @ slope), 0.0))
        if logarithm and here > 0.0:
            factor = math.exp(min(size / here, 50.0))
            return here, here / factor, here * factor
        return here, here - size, here + size


def solve(pieces: Pieces, model: Model, theta: Array) -> VehicleFit:
    """Return the fit of Gauss-Newton from ``theta`` (p,)."""
    made = balance(pieces, model, theta)
    spectra = residual_spectra(made.segments, [s.columns[:, :, :6] for s in made.segments])
    for number in range(_ROUNDS):
        grams = _grams(made, spectra).sum(axis=0)
        theta, information, moved = _moved(made, grams, theta, _STEPS)
        made = balance(pieces, model, theta)
        if number >= 2 and moved < _CLOSE:
            break
        residuals = _residuals(made, spectra, theta, information)
        spectra = residual_spectra(made.segments, residuals)
    grams = _grams(made, spectra)
    _, information = _newton(made, grams.sum(axis=0), theta)
    left, rows = slopes(made.combined, theta)
    scores = np.array([np.einsum("iac,acd,ad->i", rows, g, left, optimize=True) for g in grams])
    return VehicleFit(theta, information, scores, _loss(made, spectra, theta), made, spectra)


def refitted(fit: VehicleFit, fold: Index) -> Iterator[tuple[Mask, VehicleFit]]:
    """Yield, without each number of ``fold`` (s,) in turn, the segments (s,) kept, and the
    coefficients by these alone, at the same spectrum of the noise.

    Raises:
        InputError: no segment is kept.
    """
    grams = _grams(fit.balance, fit.spectra)
    for held in np.unique(fold):
        keep = fold != held
        if not keep.any():
            raise InputError("the flight is too short; expected 7.5 s in flight without a break")
        total = grams[keep].sum(axis=0)
        theta, information, _ = _moved(fit.balance, total, fit.theta, _ROUNDS)
        scores = fit.scores[keep]
        yield keep, replace(fit, theta=theta, information=information, scores=scores)


def nearest_body(fit: VehicleFit) -> tuple[VehicleFit, float]:
    """Return a fit whose inertia a body can have, and the standard deviations to it.

    No moment of inertia exceeds ``_FLATTEST`` of the sum of the other two. Where one does, all
    parameters move to the likeliest ones that obey: along the constraint's slope in the metric of
    the covariance.
    """
    size, at = 0.0, [fit.model.free.index(name) for name in LOGARITHMIC]
    for signs in np.where(np.eye(3), 1.0, -_FLATTEST):
        for _ in range(_ROUNDS):
            share = signs * [fit.values[name] for name in LOGARITHMIC]
            over = share.sum()
            if over <= 1e-9 * share.max():
                break
            move = fit.covariance[:, at] @ share  # the slope by logarithms
            variance = share @ move[at]
            size = max(size, over / math.sqrt(variance))
            fit = replace(fit, theta=fit.theta - move * (over / variance))
    return fit, size


def score_tests(
    fit: VehicleFit, groups: Mapping[str, Sequence[str]]
) -> dict[str, tuple[Any, Array, Array]]:
    """Return, for each group of further parameters alone, the fall of twice the negative
    log-likelihood, the parameters after one step from 0, and their standard deviations.
    """
    model, start = fit.model.with_more(fit.theta, *(p for group in groups.values() for p in group))
    made = fit.balance._replace(model=model)
    step, information = _newton(made, _grams(made, fit.spectra).sum(axis=0), start)
    slope, own, tests = information @ step, range(len(fit.theta)), {}
    for name, group in groups.items():
        at = [*own, *(model.free.index(p) for p in group)]  # the fit's own parameters follow
        inverse = np.linalg.inv(information[np.ix_(at, at)])
        moved, known = (inverse @ slope[at])[len(own) :], inverse[len(own) :, len(own) :]
        fall = moved @ np.linalg.solve(known, moved)
        tests[name] = fall, moved, np.sqrt(LOSS * np.diag(known))
    return tests


def _moved(
    made: BalanceSpectra, grams: Array, theta: Array, steps: int
) -> tuple[Array, Array, float]:
    """Return the parameters (p,) after some steps, the information (p, p) before the last, and the
    longest step in standard deviations. Nonlinear parameters stay in their range and near the
    centre.
    """
    moved = 0.0
    for _ in range(steps):
        step, information = _newton(made, grams, theta)
        theta = theta + np.clip(step, -1.0, 1.0)
        for name, x in made.centre.items():
            i = made.model.free.index(name)
            near = np.clip(theta[i], x - _MOST_CHANGE, x + _MOST_CHANGE)
            theta[i] = np.clip(near, *_RANGES[name])
        moved = max(moved, (np.abs(step) * np.sqrt(np.diag(information))).max())
    return theta, information, moved


def _grams(made: BalanceSpectra, spectra: Spectra) -> Array:
    """Return each segment's weighted Gram matrices (s, 6, 1 + ..., ...), axis by axis: the axis'
    measurement with all columns, less the rotors' noise.
    """
    noise, own = made.noise.T @ made.noise, slice(1, 1 + len(made.names))
    grams = []
    for s, spectrum in zip(made.segments, spectra, strict=True):
        gains, gram = _gains(made, s), []
        for axis, weight in enumerate(s.weight / spectrum.T):
            both = s.columns[:, :, [axis, *range(6, s.columns.shape[2])]]
            scaled = (both * np.sqrt(weight)[:, None]).reshape(-1, both.shape[2])
            parts = np.concatenate([scaled.real, scaled.imag])
            gram.append(parts.T @ parts)
            gram[axis][own, own] -= noise * (gains.T * weight @ gains * TAPERS)
        grams.append(gram)
    return np.array(grams)


def _loss(made: BalanceSpectra, spectra: Spectra, theta: Array) -> float:
    """Return twice the negative log-likelihood of noise with the residual's spectrum (m, 6) in each
    segment, without the part known from the measured speeds.

    Their noise is a part of both: of noise n in the power P of a column, Wiener's filter knows
    n^2 / P. Else a lag, by smoothing the noise of measured speeds, would be likelier than none.
    """
    noise, total = (made.noise**2).sum(axis=0), 0.0  # (c,), per Hz
    at = np.flatnonzero(noise * ~made.slow)
    powers = residual_spectra(made.segments, [s.columns[:, :, 6 + at] for s in made.segments])
    combined = made.combined(theta)[:, 1 : 1 + len(noise)]  # (6, c)
    # a slow part stands behind its column, and has the same noise
    whole = (np.eye(len(noise)) + np.eye(len(noise), k=-1) * made.slow[:, None])[:, at]
    for s, spectrum, power in zip(made.segments, spectra, powers, strict=True):
        gains = _gains(made, s)[:, None]  # (m, 1, c)
        known = (combined * gains) @ whole * gains[..., at] * noise[at]  # (m, 6, ...)
        known = (known**2 / power[:, None]).sum(axis=2)
        unknown = np.maximum(spectrum - known, _UNKNOWN * spectrum)
        logs = np.log(np.where(np.isinf(unknown), 1.0, unknown))
        total += TAPERS * (s.weight @ logs).sum()
    return total


def _gains(made: BalanceSpectra, s: Segment) -> Floats:
    """Return the shares (m, c) of amplitudes behind the columns' low-passes."""
    slow = 1.0 / (1.0 + (s.frequency[:, None] / ANSWERED_HZ) ** 4)
    return s.passed[:, None] * np.where(made.slow, slow, 1.0)


def _newton(made: BalanceSpectra, grams: Array, theta: Array) -> ArrayPair:
    """Return a Gauss-Newton step (p,), and the information (p, p)."""
    # the residual's combination (6, 1 + ...) of measurement and columns, and slopes (p, ...)
    (left, rows), model = slopes(made.combined, theta), made.model
    weighted = np.einsum("iac,acd->iad", rows, grams)
    strength = np.square(
        [model.scale.get(n, 1.0) / model.prior.get(n, math.inf) for n in model.free]
    )
    # the rotors' noise, taken off, can exceed a combination's power: such data tell nothing
    told, axes = np.linalg.eigh(np.einsum("iad,jad->ij", weighted, rows))
    # parameters without excitation stay
    information = (axes * np.maximum(told, 0.0)) @ axes.T + np.diag(strength + 1e-8)
    gradient = np.einsum("iad,ad->i", weighted, left) + theta * strength
    return np.linalg.solve(information, -gradient), information


def _residuals(
    made: BalanceSpectra, spectra: Spectra, theta: Array, information: Array
) -> Iterator[Complex]:
    """Yield the residual's transforms (K, m, 6) in each segment, as large as before the parameters
    took their share: parameters told by few frequencies follow the noise most.
    """
    left, rows = (x[..., 1:] for x in slopes(made.combined, theta))
    inverse = np.linalg.inv(information)
    for s, spectrum in zip(made.segments, spectra, strict=True):
        columns = s.columns[:, :, 6:]
        moves = np.tensordot(columns, rows, (2, 2))  # (tapers, m, p, 6)
        share = np.einsum("kmia,ij,kmja->kma", moves.conj(), inverse, moves, optimize=True).real
        leverage = np.minimum(share.mean(axis=0) / spectrum, _MOST_LEVERAGE)
        yield (s.columns[:, :, :6] + columns @ left.T) / np.sqrt(1.0 - leverage)
