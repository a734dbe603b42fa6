"""Starting points of effects whose coefficients do nothing one by one; each is tried as a column of
fixed shape.

The effects themselves say where to start. Of many starts, those are tried whose wrench, along the
flights, resembles the residual most.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ...dynamics.effects.declaration import Coefficients, Unexplained
from .regression import Flights, Setting, typical_size

Array = NDArray[np.float64]


MOST_TRIED = 12  # all of them, if there are no more
KEPT_OF_MORE = 4  # of more, those that resemble the residual most
SAMPLE_STEP = 20  # every so many samples are enough to see the resemblance


def starting_points(
    effect: str,
    flights: Flights,
    residual: Array,
    stated: Coefficients,
    beside: Iterable[str] = (),
) -> Sequence[Coefficients]:
    """Return the coefficients from which a fit of an effect starts.

    Args:
        effect: that declares starting points.
        flights: where it is looked for.
        residual: that they leave (rows, 6).
        stated: coefficients that the vehicle's file fixes.
        beside: other effects that act.
    """
    declared = get(effect).starting_points
    assert declared is not None, f"{effect} declares no starting points"
    position, seen, vehicle = flights.at_rows("position"), flights.fit_rows, flights.vehicle
    found = declared(
        Unexplained(
            vehicle,
            {c.name: typical_size((effect, c.name), vehicle) for c in get(effect).coefficients},
            stated,
            frozenset(get(e).family for e in beside),
            position.mean(axis=0),
            position[seen],
            flights.at_rows("velocity")[seen],
            residual[seen, :3],
            residual[seen, 3:],
        )
    )
    if len(found) <= MOST_TRIED:
        return found
    # an effect that has no state of its own and goes by no clock does the same as long as nothing
    # else changes, so not every sample need be looked at: one sample, repeated for a minute, in
    # step with no whole Hz
    one = flights.pieces({})[0].signals.at(np.zeros(200, dtype=np.int64))
    acts = flights.acting(replace(one, period=0.317), {effect: found[0]})
    steady, sampled, every = bool(np.all(acts == acts[0])), [], []
    for p in flights.pieces({}):
        chosen = np.arange(len(p.rows)) % max(1, SAMPLE_STEP // int(p.rows[1] - p.rows[0])) == 0
        at = p.rows[chosen]
        sampled.append((p.signals.at(at), slice(None)) if steady else (p.signals, at))
        every.append(chosen)
    chosen = np.concatenate(every)
    target = residual[chosen & seen]
    scale = 1.0 / np.maximum(np.sqrt(np.mean(np.square(target), axis=0)), 1e-12)

    def acting(setting: Setting) -> Array:
        parts = [flights.acting(signals, setting)[x] for signals, x in sampled]
        return np.asarray(np.concatenate(parts)[seen[chosen]] * scale)

    # how much of the residual goes like each start's wrench; of those that are alike the later one,
    # and none that does nothing
    base, likeness = acting({}), []
    for i, start in enumerate(found):
        shape = acting({effect: start}) - base
        size = float(np.sum(shape * shape))
        if size > 0.0:
            likeness.append((float(np.sum(shape * target * scale)) / math.sqrt(size), i))
    return [found[i] for _, i in sorted(likeness, reverse=True)[:KEPT_OF_MORE]]
