"""How much an effect does, beside what a model with it leaves unexplained."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ...dynamics.effects import get
from .priors import prior_size
from .regression import Flights, Setting, without
from .row_nuisances import row_nuisances
from .rows import Rows

Array = NDArray[np.float64]


NOISE_KNOWN = 0.2  # share of the sensors' noise, to which it is known
# standard deviations that chance makes: of a prior, by which others may differ in an effect's
# place, and of a nuisance that is worth a note
BY_CHANCE = 3.0


def worth(
    flights: Flights, fixed: Setting, first: Collection[str], setting: Setting
) -> dict[str, float]:
    """Return of each effect the RMS of what nuisances, effects that any set has and effects of
    other families cannot do in its place, within three standard deviations of their priors, over
    the RMS of what is left beyond the sensors' noise: in the channel where that is most.

    Args:
        flights: of the vehicle.
        fixed: effects that are known from elsewhere.
        first: effects that any set has.
        setting: coefficients of the effects that are asked about.
    """
    if not setting:
        return {}
    rows = Rows(flights, fixed)
    fit, left = rows.fit, rows.residual(setting)
    power, noise = (np.mean(np.square(x[fit]), axis=0) for x in (left, rows.noise()))
    size = np.sqrt(np.maximum(power - noise, NOISE_KNOWN**2 * noise)) + 1e-12
    nuisances = list(row_nuisances(rows).values())
    columns = rows.columns(setting, flights.columns_of(setting))
    out = {}
    for effect in setting:
        less = without(setting, effect)
        part = rows.residual(less) - left
        # in still air a drag cannot do what it does in a wind
        still = get(effect).sets_wind
        others = rows.columns(less, flights.columns_of(less)) if still else columns
        # what any set has, and what is of another family
        own = [
            x * prior_size(c, flights)
            for c, x in others.items()
            if c[0] != effect and (c[0] in first or get(c[0]).family != get(effect).family)
        ]
        X = np.stack([*nuisances, *own], axis=2)[fit] / size[:, None]
        y = part[fit] / size
        done = lsq_linear(X.reshape(-1, X.shape[2]), y.ravel(), (-BY_CHANCE, BY_CHANCE)).x
        out[effect] = float(np.sqrt(np.mean(np.square(y - X @ done), axis=0)).max())
    return out
