"""Fitting the parameters: Gauss-Newton on Whittle's likelihood, the noise's spectrum taken from the
residual in turn, and the covariance of what comes out.

Rotor speeds are noisy (rounded) where they are measured: what that adds to the columns' own power
is taken away before the normal equations are solved, so that it does not shrink the coefficients.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .channels import MotionPiece
from .columns import BalanceSpectra, Drive, balance
from .model import LOGARITHMIC, Model, jacobian
from .spectra import SPECTRUM, residual_spectra

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SolveSettings:
    """When a fit is done."""

    rounds: int = 12  # of a new spectrum and a new linearisation
    steps: int = 2  # of Gauss-Newton in each
    close: float = 0.02  # of a standard deviation: a change that ends it
    most_lag: float = 0.5  # s
    most_delay: float = 0.1  # s
    most_gamma: float = 4.0
    # of one frequency: where the parameters explain nearly all of it, its noise is not seen
    most_leverage: float = 0.8


SOLVE = SolveSettings()


@dataclass(frozen=True, eq=False)
class VehicleFit:
    """Parameters that fit best."""

    model: Model
    drive: Drive  # with its lag, delay and exponent fitted
    names: tuple[str, ...]  # of the parameters: the model's free ones, then the nonlinear ones
    theta: Array  # (p,)
    information: Array  # (p, p), of the model's parameters with priors
    scores: Array  # (s, p): each segment's gradient
    loss: float  # twice the negative log-likelihood, up to a constant
    balance: BalanceSpectra
    spectra: list[Array]  # of each segment (m, 6)

    @property
    def covariance(self) -> Array:
        """Covariance (p, p), the larger of what the noise's spectrum says and what the segments'
        own scatter says (White's sandwich), parameter by parameter.
        """
        inverse = np.asarray(np.linalg.inv(self.information), dtype=np.float64)
        count = len(self.scores)
        if count < 4:
            return inverse
        meat = self.scores.T @ self.scores * (count / (count - 1.0))
        sandwich = inverse @ meat @ inverse
        # few segments scatter: their evidence counts by how many there are
        share = count / (count + 30.0)
        ratio = np.diag(sandwich) / np.diag(inverse)
        grow = np.sqrt(np.maximum(1.0, share * ratio + (1.0 - share)))
        return np.asarray(inverse * np.outer(grow, grow))

    @property
    def values(self) -> dict[str, float]:
        """All parameters in SI units."""
        n = len(self.model.free)
        return {
            **self.model.values(self.theta[:n]),
            **{name: getattr(self.drive, name) for name in self.names[n:]},
        }

    def deviation(self, name: str) -> float:
        """Return a parameter's standard deviation in theta's units: SI units for the nonlinear
        ones, a share of the value for those in logarithms.
        """
        i = self.names.index(name)
        size = float(np.sqrt(self.covariance[i, i]))
        free = i < len(self.model.free) and name not in LOGARITHMIC
        return size * self.model.scale[name] if free else size


def solve(
    pieces: list[MotionPiece],
    drive: Drive,
    model: Model,
    start: Array,
    nonlinear: tuple[str, ...],
    rotor_noise: float = 0.0,
    nonlinear_prior: dict[str, float] | None = None,
) -> VehicleFit:
    """Return the fit that Gauss-Newton reaches from ``start`` (p,) and the drive's own lag, delay
    and exponent.
    """
    theta = start.copy()
    prior = nonlinear_prior or {}
    made = balance(pieces, drive, nonlinear, rotor_noise)
    powers = [np.mean(np.abs(s.columns[:, :, :6]) ** 2, axis=0) for s in made.segments]
    spectra = residual_spectra(made.segments, powers)
    zero = np.zeros(len(nonlinear))
    for number in range(SOLVE.rounds):
        total = np.sum(_grams(made, spectra), axis=0)
        shift, moved = zero.copy(), 0.0
        for _ in range(SOLVE.steps):
            step, information, *_ = _newton(made, total, model, theta, shift, drive, prior)
            theta += np.clip(step[: len(theta)], -1.0, 1.0)
            shift = _bounded(shift + step[len(theta) :], drive, nonlinear)
            size = np.abs(step) * np.sqrt(np.maximum(np.diag(information), 0.0))
            moved = max(moved, float(size.max()))
        drive = replace(
            drive,
            **{n: getattr(drive, n) + float(d) for n, d in zip(nonlinear, shift, strict=True)},
        )
        if nonlinear:
            made = balance(pieces, drive, nonlinear, rotor_noise)
        if number >= 2 and moved < SOLVE.close:
            break
        powers = _powers(made, spectra, model, theta, information)
        spectra = residual_spectra(made.segments, powers)
    grams = _grams(made, spectra)
    _, information, slopes, v = _newton(
        made, np.sum(grams, axis=0), model, theta, zero, drive, prior
    )
    scores = np.array([np.einsum("iac,acd,ad->i", slopes, g, v, optimize=True) for g in grams])
    return VehicleFit(
        model,
        drive,
        (*model.free, *nonlinear),
        theta,
        information,
        scores,
        _loss(made, spectra),
        made,
        spectra,
    )


def fall_with(fit: VehicleFit, model: Model, start: Array) -> float:
    """Return by how much twice the negative log-likelihood would fall with a model that has further
    parameters than a fit's, by the score test: one step from where they are nothing.
    """
    made, zero = fit.balance, np.zeros(len(fit.balance.nonlinear))
    total = np.sum(_grams(made, fit.spectra), axis=0)
    step, information, *_ = _newton(made, total, model, start, zero, fit.drive, {})
    current = fit.theta[: len(fit.model.free)]
    own_step, own_information, *_ = _newton(made, total, fit.model, current, zero, fit.drive, {})
    return float(step @ information @ step - own_step @ own_information @ own_step)


def step_with(
    pieces: list[MotionPiece], fit: VehicleFit, nonlinear: tuple[str, ...]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the step that further nonlinear parameters would take from a fit, and its standard
    deviation, by name.
    """
    made = balance(pieces, fit.drive, nonlinear)
    total = np.sum(_grams(made, fit.spectra), axis=0)
    n = len(fit.model.free)
    zero = np.zeros(len(nonlinear))
    step, information, *_ = _newton(made, total, fit.model, fit.theta[:n], zero, fit.drive, {})
    size = np.sqrt(np.diag(np.linalg.inv(information)))[n:]
    return (
        dict(zip(nonlinear, step[n:].tolist(), strict=True)),
        dict(zip(nonlinear, size.tolist(), strict=True)),
    )


def _grams(made: BalanceSpectra, spectra: Sequence[Array]) -> list[Array]:
    """Return each segment's weighted Gram matrices (6, 1 + c + nc, ...), axis by axis: of the axis'
    measurement and all columns, without what the rotors' noise adds.
    """
    noise, c = made.noise.T @ made.noise, len(made.names)
    grams = []
    for s, spectrum in zip(made.segments, spectra, strict=True):
        columns = s.columns[:, :, 6:]
        gram = np.empty((6, 1 + columns.shape[2], 1 + columns.shape[2]))
        gain = 1.0 / (1.0 + (s.frequency / made.band) ** 4) ** 2
        for axis in range(6):
            weight = s.weight / spectrum[:, axis]
            both = np.concatenate([s.columns[:, :, axis : axis + 1], columns], axis=2)
            scaled = (both * np.sqrt(weight)[None, :, None]).reshape(-1, both.shape[2])
            parts = np.concatenate([scaled.real, scaled.imag])
            gram[axis] = parts.T @ parts
            added = noise * float(np.sum(weight * gain)) * SPECTRUM.tapers
            gram[axis, 1 : 1 + c, 1 : 1 + c] -= added
        grams.append(gram)
    return grams


def _newton(
    made: BalanceSpectra,
    grams: Array,
    model: Model,
    theta: Array,
    shift: Array,
    drive: Drive,
    prior: dict[str, float],
) -> tuple[Array, Array, Array, Array]:
    """Return a Gauss-Newton step (p,), the information (p, p), the residual's slopes (p, 6, 1 + c +
    nc) and the residual (6, 1 + c + nc), as combinations of measurement and columns.
    """
    here, slopes = jacobian(model, theta, made.names)
    c, count = len(made.names), len(made.nonlinear)
    width = 1 + c * (1 + count)
    v = np.zeros((6, width))
    v[:, 0] = 1.0
    v[:, 1 : 1 + c] = -here
    rows = np.zeros((len(theta) + count, 6, width))
    rows[: len(theta), :, 1 : 1 + c] = -slopes
    for n in range(count):
        block = slice(1 + c * (1 + n), 1 + c * (2 + n))
        v[:, block] = -here * shift[n]
        rows[: len(theta), :, block] = -slopes * shift[n]
        rows[len(theta) + n, :, block] = -here
    weighted = np.einsum("iac,acd->iad", rows, grams)
    information = np.einsum("iad,jad->ij", weighted, rows)
    gradient = np.einsum("iad,ad->i", weighted, v)
    for i, name in enumerate((*model.free, *made.nonlinear)):
        if name in prior and i >= len(theta):
            current = getattr(drive, name) + shift[i - len(theta)]
            information[i, i] += prior[name] ** -2
            gradient[i] += current * prior[name] ** -2
        elif i < len(theta) and name in model.prior:
            strength = (model.scale[name] / model.prior[name]) ** 2
            information[i, i] += strength
            gradient[i] += theta[i] * strength
    # what the flight does not excite at all stays where it is
    floor = 1e-8 * np.eye(len(information))
    step = np.linalg.solve(information + floor, -gradient)
    return step, information + floor, rows, v


def _bounded(shift: Array, drive: Drive, nonlinear: tuple[str, ...]) -> Array:
    out = shift.copy()
    for i, name in enumerate(nonlinear):
        current = getattr(drive, name)
        low, high = {
            "lag": (0.0, SOLVE.most_lag),
            "delay": (-SOLVE.most_delay, SOLVE.most_delay),
            "gamma": (-SOLVE.most_gamma, SOLVE.most_gamma),
        }[name]
        out[i] = (
            np.clip(current + out[i], max(low, current - 0.05), min(high, current + 0.05)) - current
        )
    return out


def _powers(
    made: BalanceSpectra, spectra: Sequence[Array], model: Model, theta: Array, information: Array
) -> list[Array]:
    """Return the residual's power (m, 6) in each segment, as it was before the parameters took
    their share: they follow the noise most where they are told from few frequencies.
    """
    here, slopes = jacobian(model, theta, made.names)
    c, count = len(made.names), len(made.nonlinear)
    inverse = np.linalg.inv(information)
    out = []
    for s, spectrum in zip(made.segments, spectra, strict=True):
        columns = s.columns[:, :, 6 : 6 + c]
        residual = s.columns[:, :, :6] - columns @ here.T
        moves = np.einsum("kmc,pac->pakm", columns, slopes, optimize=True)
        late = [
            np.moveaxis(s.columns[:, :, 6 + c * (1 + n) : 6 + c * (2 + n)] @ here.T, 2, 0)[None]
            for n in range(count)
        ]
        moves = np.concatenate([moves, *late]).reshape(len(information), -1)
        share = np.einsum("ix,ij,jx->x", moves.conj(), inverse, moves, optimize=True).real
        leverage = np.mean(share.reshape(6, *residual.shape[:2]), axis=1).T / spectrum
        power = np.mean(np.abs(residual) ** 2, axis=0)
        out.append(power / (1.0 - np.minimum(leverage, SOLVE.most_leverage)))
    return out


def _loss(made: BalanceSpectra, spectra: Sequence[Array]) -> float:
    """Return twice the negative log-likelihood of a noise that has the residual's spectrum."""
    logs = (
        np.sum(s.weight[:, None] * np.log(np.where(np.isinf(p), 1.0, p)))
        for s, p in zip(made.segments, spectra, strict=True)
    )
    return float(SPECTRUM.tapers * sum(logs))
