"""The flight loop's reaction, fitted to predictions of half a second.

The loss is the mean distance of prediction and flight in ``QUANTITIES``, each against two distances
where nothing changes, the start's and the flight's mean: a brisk flight counts as much as a calm
one, and a flight's calm starts count beside its brisk ones. Without the start's own, the body rates
of a racer's brisk flight decayed too fast for a calm one (attitude 1.17 times the error of no
change). Gauss-Newton minimises the mean norm, with norms weighted by their inverse in turn.
"""

from collections.abc import Sequence
from dataclasses import astuple, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from ...dynamics.vehicle import LoopReaction, Vehicle
from ...runtime.arrays import Array
from ..prediction import LoggedStarts, offsets
from .parameters import QUANTITIES

_LOOP = QUANTITIES["loop"]  # in the order of the coefficients
UNITS = {name: unit for name, (unit, *_) in _LOOP.items()}
_USUAL, _DAMPED, _SIZES, _LOWEST = np.transpose([numbers for _, *numbers in _LOOP.values()])
_DAMPING = np.array(["damping" in name for name in UNITS])
# share of the loss: the prior's at a size from the start. Coefficients without excitation stay
_PRIOR = 0.003 / 9.0
_STARTS = 500  # predictions of a fit, spread over the flights
_TIMES = 5  # compared in a horizon
_ROUNDS = 15
_AGAIN = 2  # rounds without some starts
_SETTLED = 1e-4  # share of the loss: a smaller fall ends the search
_LEAST = 1e-6  # of the errors where nothing changes: smaller ones count as this
_STEP = 1e-3  # of a coefficient's size, of finite differences


class LoopFit(NamedTuple):
    """The likeliest loop, and the standard deviations (9,) of its coefficients, by the scatter of
    groups of starts (a sandwich); 0 if not fitted.
    """

    loop: LoopReaction
    deviations: Array


def fit_loop(
    starts: Sequence[LoggedStarts],
    vehicle: Vehicle,
    near: LoopReaction | None = None,
    damped: bool = False,
) -> LoopFit:
    """Return the loop of flights with starts, one at least.

    Args:
        starts: of each flight; those of a segment are a group.
        vehicle: with the force, inertia and rotors that stay.
        near: the loop by more starts: two rounds from there; None: from a usual one.
        damped: the body rate decays, and nothing else turns the body.
    """
    every = max(1, sum(len(part.rows) for part in starts) // _STARTS)
    thin = [part.those(slice(None, None, every)) for part in starts if len(part.rows)]
    group = np.concatenate([*(part.segment for part in thin), [-1]])
    # distances (n, 4) of a flight's starts at the horizon's end if nothing changes
    far = [np.linalg.norm(offsets(p.unchanged, p.seen)[:, -1], axis=-1) for p in thin]
    sizes = np.concatenate([d + d.mean(axis=0) + _LEAST for d in far])[:, None, :, None]
    speeds = np.concatenate([part.log.rotor_speeds[part.rows] for part in thin])
    turning = vehicle.rotor_wrench(speeds)[:, 1:3] / np.diag(vehicle.inertia)[:2]  # rad/s2
    begin = np.nan_to_num(_DAMPED if damped else _USUAL, nan=np.sqrt((turning**2).mean()))
    free, shares = _DAMPING | (not damped), np.arange(1, _TIMES + 1) / _TIMES
    unit = np.diag(_SIZES)[free]  # units of the fitted numbers x (p,)

    def loop(x: Array) -> LoopReaction:
        return LoopReaction(*np.maximum(begin + x @ unit, _LOWEST).tolist())

    def off(x: Array) -> Array:
        """Return the differences (n, _TIMES, 4, 3) of predictions from the flight."""
        model, each = replace(vehicle, closed_loop=loop(x)), []
        for part in thin:
            at = np.rint(shares * len(part.ahead)).astype(int) - 1
            each.append(offsets(part.flown(model)[:, at], part.seen[:, at]))
        return np.asarray(np.concatenate(each) / sizes)

    start = begin if near is None else np.array(astuple(near))
    bound, x = (((at - begin) / _SIZES)[free] for at in (_LOWEST, start))
    e, damping = off(x), 1e-3
    for _ in range(_ROUNDS if near is None else _AGAIN):
        norms = np.linalg.norm(e, axis=-1)
        least = np.maximum(0.5 * np.median(norms, axis=(0, 1)), _LEAST)
        root = np.sqrt(np.maximum(norms, least))[..., None]
        residual, one = e / root, np.eye(len(x))
        slopes = np.array([(off(x + move) - e) / root for move in _STEP * one]) / _STEP
        strength = _PRIOR * (residual**2).sum()
        gram = np.einsum("intqc,jntqc->ij", slopes, slopes, optimize=True) + strength * one
        gradients = np.vstack([np.einsum("intqc,ntqc->ni", slopes, residual), strength * x])
        before = _loss(e, x)
        for _ in range(6):
            lower = np.linalg.cholesky(gram + damping * np.diag(np.diag(gram)))
            aim = lower.T @ x - np.linalg.solve(lower, gradients.sum(axis=0))
            tried = lsq_linear(lower.T, aim, (bound, np.inf)).x
            there = off(tried)
            loss = _loss(there, tried)
            if loss < before:
                x, e, damping = tried, there, max(damping / 6.0, 1e-6)
                break
            damping *= 8.0
        if before - loss < _SETTLED * before:
            break
    scores = (group == np.unique(group)[:, None]) @ gradients
    return LoopFit(loop(x), np.linalg.norm(scores @ np.linalg.inv(gram), axis=0) @ unit)


def _loss(e: Array, away: Array) -> float:
    """Return the mean norm of errors (n, _TIMES, 4, 3), and the prior's of a distance (p,)."""
    return float((1.0 + _PRIOR * away @ away) * np.linalg.norm(e, axis=-1).mean())
