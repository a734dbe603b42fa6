"""Coefficients that least squares of the residual gets wrong, measured by innovations instead.

The noise of the pose goes through the flight loop into the rotors. So the residual's noise follows the turn rates, and what
differs little from their delay, or scales the attitude with its noise, comes out wrong: a motor_lag of 13 ms as 4 to 11 ms with
turn rates that act 2 to 6 ms late, a gain of the attitude by up to a fifth too large. What no past pose foretells has no such
noise. (Of measuring below 5 Hz it has none of the robustness: rotors whose turn rates are rounded look like quick gusts.)
"""

import numpy as np

from .innovations import Innovations
from .search import LEAST_GAIN, Fit, Search, started

BENT = frozenset({"attitude_gain", "motor_lag"})  # effects of which that is known
_TURNS = 3  # of Gauss-Newton; the second changes little
_WORSE = 1.05  # of the residual's energy: what is worse for the residual than that is not measured


def measured(search: Search, fit: Fit) -> Fit:
    """Return the fit with its coefficients at the maximum likelihood of the innovations, if it has an effect that needs it.

    Standard deviations are no smaller than those of the residual.
    """
    if search.flights.commanded or not BENT & set(fit.effects):
        return fit
    columns = search.base(fit.effects)
    every = np.arange(len(columns))
    found = fit
    for _ in range(_TURNS):
        gram = Innovations(search.flights, found.setting).gram(columns)
        total = gram.blocks.sum(axis=0)
        found = started(found, columns, gram.solve(total, every))
    covariance = np.linalg.inv(total[:-1, :-1] + np.diag(gram.precision))
    std = dict(zip(columns, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    found.std = {column: max(value, fit.std.get(column, 0.0)) for column, value in std.items()}
    close = search.energy(found.setting) < _WORSE * search.energy(fit.setting) + LEAST_GAIN
    return found if close else fit
