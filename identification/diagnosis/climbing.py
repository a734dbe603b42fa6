"""The mode of the posterior of some effects' coefficients, for any likelihood."""

import math
from collections.abc import Callable

import numpy as np

from ...runtime.errors import InputError
from .coefficients import Setting
from .priors import Base, changed, from_declared
from .regression import RegressedFlights

# minus the logarithm of likelihood and prior at a setting, and a function for the mode of the
# linearised posterior there
Height = tuple[float, Callable[[], Setting]]

ROUNDS = 8
SHARES = (1.0, 0.5, 0.2, 0.05)  # of a step, tried in turn
LEAST_GAIN = 0.3  # nats; a step with less gain is the last


def mode(start: Setting, at: Callable[[Setting], Height]) -> Setting:
    """Return the mode of the posterior from a setting on (damped Gauss-Newton); ``at`` raises an
    error for an impossible vehicle.
    """
    here = start
    value, target = height(start, at)
    for _ in range(ROUNDS):
        there = target()
        for share in SHARES:
            trial = {
                e: {n: own.get(n, 0.0) + share * (x - own.get(n, 0.0)) for n, x in there[e].items()}
                for e, own in here.items()
            }
            after, onwards = height(trial, at)
            if after < value:
                break
        else:
            break
        gained, here, value, target = value - after, trial, after, onwards
        if gained < LEAST_GAIN:
            break
    return here


def height(setting: Setting, at: Callable[[Setting], Height]) -> Height:
    """Return the height of the posterior at a setting; infinite for an impossible vehicle."""
    try:
        return at(setting)
    except (InputError, np.linalg.LinAlgError):
        return math.inf, lambda: setting


def linearised(
    flights: RegressedFlights, base: Base, setting: Setting, power: float = 1.0
) -> Height:
    """Return the height of a quadratic likelihood at the setting of its linearisation, and its mode
    within the limits of the coefficients.
    """
    m = base.marginal(base.asked, base.plain, power)
    size = base.size[base.at(m.place)]
    z = from_declared(base.asked, flights, setting)
    value = 0.5 * (float(z @ z) - m.explained(m.place, z)) - m.constant

    def target() -> Setting:
        out = {e: dict(values) for e, values in setting.items()}
        best = m.evidence(m.place).mode * size
        for c, x in zip(base.asked, best.tolist(), strict=True):
            out[c.effect][c.coefficient] = changed(c, x, flights)
        return out

    return value, target
