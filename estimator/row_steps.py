"""From one row of measurements to the next: in which steps a filter is carried over the time
between them, offline and on the vehicle alike.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class RowSteps:
    """How the time between two rows is divided."""

    # s without a row after which the filter holds its pose: from there on steps of any length do
    forgets: float = 20.0
    rest: int = 1000  # steps of what lies beyond, at most
    slack: float = 0.1  # of a period: a step so little too long is still one step


ROW_STEPS = RowSteps()


def steps_between(dt: float, period: float, settings: RowSteps = ROW_STEPS) -> list[float]:
    """Return the steps, s, in which a filter of a ``period``, s, is carried over ``dt`` s: equal
    ones of at most one period, but for a time so long that the filter has forgotten by then.
    """
    near = min(dt, settings.forgets)
    count = max(1, math.ceil(near / period - settings.slack))
    steps = [near / count] * count
    if dt > settings.forgets:
        count = min(math.ceil((dt - near) / period), settings.rest)
        steps += [(dt - near) / count] * count
    return steps
