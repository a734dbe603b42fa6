"""How measured rotor speeds follow logged commands: the steady speed as a polynomial of the command
behind a first-order lag.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import stdtrit

from ...runtime.arrays import Array
from ..logs.table import ArrayPair
from ..motion.smoothing import lagged
from .channels import Pieces
from .geometry import Interval

_LAGS = (1e-3, 0.5)  # s, the shortest and the longest
_SEGMENT = 5.0  # s: errors further apart are taken as independent
_POWERS = 3  # speed against u^0, u^1, u^2


class MotorResponse(NamedTuple):
    """Rotor speed in rad/s against command, and its lag."""

    speed: Array  # (3,) coefficients of u^0, u^1, u^2
    known: Interval  # s, lag and ends of the 95 % interval
    left: float  # unexplained share of the speeds' standard deviation


def motor_response(pieces: Pieces) -> MotorResponse | None:
    """Return how speeds follow commands; None if a piece lacks these, or commands do not move."""
    known = [(p.command, p.period) for p in pieces if p.command is not None]
    if len(known) < len(pieces):
        return None

    def columns(lag: float) -> Array:
        u = [lagged(command, lag, period).ravel() for command, period in known]
        return np.vander(np.concatenate(u), _POWERS, increasing=True)

    target = np.concatenate([p.rotors.ravel() for p in pieces])
    if columns(0.0)[:, 1].std() < 1e-3 or target.std() == 0.0:
        return None

    def fitted(lag: float) -> ArrayPair:
        x = columns(lag)
        best = np.linalg.lstsq(x, target, rcond=None)[0]
        return best, target - x @ best

    likeliest = minimize_scalar(
        lambda log_lag: (fitted(math.exp(log_lag))[1] ** 2).sum(),
        bounds=np.log(_LAGS),
        method="bounded",
        options={"xatol": 1e-3},
    )
    lag = math.exp(likeliest.x)
    best, residual = fitted(lag)
    step = 0.01 * lag
    slope = (columns(lag + step) - columns(lag - step)) @ best / (2.0 * step)
    moves = np.column_stack([columns(lag), slope])
    inverse = np.linalg.inv(moves.T @ moves)
    block = (pieces[0].period / _SEGMENT * (np.arange(residual.size) // 4)).astype(int)
    # errors go on within a segment: a sandwich over segments, of the lag alone
    scores = np.bincount(block, residual * (moves @ inverse[-1]))
    least = max(len(scores) - 1, 1)
    size = math.sqrt(scores @ scores * len(scores) / least)
    width = stdtrit(max(least, 3), 0.975) * size
    interval = (lag, max(lag - width, 0.0), lag + width)
    return MotorResponse(best, interval, residual.std() / target.std())
