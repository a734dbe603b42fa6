"""Excerpts of long flights: evenly spaced minutes of an hour give the same diagnosis as the whole
hour, in a tenth of the memory.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .flight_log import FlightLog, with_rows

LONGEST = 480.0  # s of flight, all logs together, used whole
_WINDOW = 60.0  # s, a window of longer flights


def excerpt(logs: Sequence[FlightLog]) -> list[FlightLog]:
    """Return the logs, or windows of a minute spread evenly over each where they last more than
    ``LONGEST`` together.

    The rest becomes a gap in the log, with a note.
    """
    seconds = [log.t[-1] - log.t[0] for log in logs]
    share = LONGEST / max(sum(seconds), LONGEST)
    out = []
    for log, length in zip(logs, seconds, strict=True):
        if share == 1.0 or length <= _WINDOW:
            out.append(log)
            continue
        count, spare = max(1, round(share * length / _WINDOW)), length - _WINDOW
        first = 0.0 if count > 1 else 0.5 * spare
        begins = log.t[0] + np.linspace(first, spare, count)
        keep = np.any([(log.t >= at) & (log.t <= at + _WINDOW) for at in begins], axis=0)
        note = (
            f"of {length:.0f} s, {count} windows of {_WINDOW:.0f} s, evenly spaced, were used; the "
            "rest was left out"
        )
        out.append(replace(with_rows(log, keep), notes=(*log.notes, note)))
    return out
