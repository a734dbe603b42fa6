"""The size of an effect, beside the residual of a model with it."""

from collections.abc import Collection

import numpy as np

from ...dynamics.effects import get
from ..motion.smoothing import mean_square
from .coefficients import Setting, without
from .evidence import bounded_mode
from .priors import prior_size
from .regression import RegressedFlights
from .row_nuisances import row_nuisances
from .rows import Rows

NOISE_KNOWN = 0.2  # relative accuracy of the sensors' noise
# standard deviations made by chance: of other priors in an effect's place, and of a nuisance worth
# a note
BY_CHANCE = 3.0
LEAST_KNOWN = 1e-6  # of columns without a trace


def worth(
    flights: RegressedFlights, fixed: Setting, first: Collection[str], setting: Setting
) -> dict[str, float]:
    """Return the size of each effect over the residual beyond the sensors' noise, in the channel
    with most. The size is the RMS of its irreplaceable part: nuisances, effects of every set and
    effects of other families take the rest, within three standard deviations of their priors.

    Args:
        flights: the vehicle's flights.
        fixed: effects known from elsewhere.
        first: effects of every set.
        setting: coefficients of the effects asked about.
    """
    if not setting:
        return {}
    rows = Rows(flights, fixed)
    fit = rows.fit
    left = rows.residual(setting)
    power, noise = (mean_square(x[fit]) for x in (left, rows.noise()))
    size = np.sqrt(np.maximum(power - noise, NOISE_KNOWN**2 * noise)) + 1e-12
    nuisances = list(row_nuisances(rows).values())
    columns = rows.columns(setting, flights.columns_of(setting))
    out = {}
    for effect in setting:
        less = without(setting, effect)
        part = rows.residual(less) - left
        # a drag acts otherwise in still air than in a wind
        others = rows.columns(less, flights.columns_of(less)) if get(effect).sets_wind else columns
        # of every set, or of another family
        own = [
            x * prior_size(c, flights)
            for c, x in others.items()
            if c.effect != effect
            and (c.effect in first or get(c.effect).family != get(effect).family)
        ]
        X = np.stack([*nuisances, *own], axis=2)[fit] / size[:, None]
        y = part[fit] / size
        x = X.reshape(-1, X.shape[2])
        far = np.full(x.shape[1], BY_CHANCE)
        normal = x.T @ x + LEAST_KNOWN * np.eye(len(far))
        done = bounded_mode(normal, x.T @ y.ravel(), -far, far)
        out[effect] = float(np.sqrt(mean_square(y - X @ done)).max())
    return out
