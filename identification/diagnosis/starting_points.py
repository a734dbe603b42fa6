"""Starting points of effects whose coefficients do nothing one by one; each is tried as a column of
fixed shape.

The effects themselves say where to start. Among many starts, the tried ones have the wrench most
like the residual along the flights.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Coefficients, Unexplained
from ..logs.table import Array, Values
from ..motion.smoothing import mean_square
from .coefficients import Setting, moves_time, typical_size, typical_sizes
from .column import Column, Part
from .priors import Starts
from .regression import RegressedFlights

MOST_TRIED = 12  # starts; no more are tried all
KEPT_OF_MORE = 4  # starts of more, the most like the residual
# typical sizes of the trials of a lag or a delay as a whole: their columns change with them
TIME_STARTS = (0.3, 0.6, 1.2)
SAMPLE_STEP = 20  # one of so many samples is enough to compare


def _starting_points(
    effect: str,
    flights: RegressedFlights,
    residual: Array,
    beside: Iterable[str] = (),
) -> Sequence[Coefficients]:
    """Return the coefficients from which a fit of an effect starts.

    Args:
        effect: its name. It declares starting points.
        flights: the searched flights.
        residual: the unexplained residual (rows, 6).
        beside: other effects in action.
    """
    declared = get(effect).starting_points
    assert declared is not None, f"{effect} declares no starting points"
    position = flights.at_rows("position")
    stated = flights.stated(effect)
    seen = flights.fit_rows
    started = declared(
        Unexplained(
            flights.vehicle,
            typical_sizes(effect, flights.vehicle),
            stated,
            frozenset(get(e).family for e in beside),
            position.mean(axis=0),
            position[seen],
            flights.at_rows("velocity")[seen],
            residual[seen, :3],
            residual[seen, 3:],
        )
    )
    starts = [{**start, **stated} for start in started]
    if len(starts) <= MOST_TRIED:
        return starts
    pieces = flights.pieces({})
    step = max(1, SAMPLE_STEP // int(np.diff(pieces[0].rows)[0]))
    chosen = np.concatenate([rows[::step] for rows in flights.runs])
    used = seen[chosen]
    target = residual[chosen[used]]
    scale = 1.0 / np.maximum(np.sqrt(mean_square(target)), 1e-12)

    def acting(setting: Setting) -> Array:
        # the same starts are tried beside several sets
        key = str(setting) + effect
        if key not in flights.started:
            parts = [flights.acting(p.signals, setting)[p.rows[::step]] for p in pieces]
            flights.started[key] = np.concatenate(parts)[used]
        return np.asarray(flights.started[key] * scale)

    # share of the residual along each start's wrench; the later one of equals, and none without a
    # wrench
    base = acting({})
    likeness = []
    for i, start in enumerate(starts):
        shape = acting({effect: start}) - base
        size = np.sum(shape * shape)
        if size > 0.0:
            likeness.append((np.sum(shape * target * scale) / math.sqrt(size), i))
    return [starts[i] for _, i in sorted(likeness, reverse=True)[:KEPT_OF_MORE]]


def starts_of(
    flights: RegressedFlights, library: Sequence[str], setting: Setting, *others: Setting
) -> Starts:
    """Return columns of whole effects outside a setting, with the coefficients of each: lags and
    delays, and effects whose coefficients do nothing one by one. The latter start from the residual
    of the setting, and of ``others``: an effect may act in the place of another.
    """
    out: dict[Column, Values] = {}
    beside = [*setting, *(e.name for e in flights.vehicle.effects)]
    for effect in (e for e in library if e not in setting):
        own: list[Values] = []
        if moves_time(effect) and get(effect).kind == "rotor input":
            name = get(effect).coefficients[0].name
            typical = typical_size(Column(effect, name), flights.vehicle)
            own = [{name: share * typical} for share in TIME_STARTS]
        elif flights.is_nonlinear(effect):
            for x in (setting, *others):
                own += _starting_points(effect, flights, flights.residual(x), beside)
        out |= {Column(effect, "", Part.START, i): start for i, start in enumerate(own)}
    return out
