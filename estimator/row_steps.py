"""In which steps a filter is carried from one row of measurements to the next, offline and live."""

import math

_FORGETS = 20.0  # s without a row after which the filter holds its pose: steps of any length do
_REST = 1000  # steps, at most, of the time beyond
_SLACK = 0.1  # share of a period: a step so little too long is still one step


def steps_between(dt: float, period: float) -> list[float]:
    """Return the steps, s, in which a filter of a ``period``, s, is carried over ``dt`` s: equal
    ones of at most one period, but for a time so long that the filter has forgotten by then.
    """
    near = min(dt, _FORGETS)
    count = max(1, math.ceil(near / period - _SLACK))
    steps = [near / count] * count
    if dt > _FORGETS:
        count = min(math.ceil((dt - near) / period), _REST)
        steps += [(dt - near) / count] * count
    return steps
