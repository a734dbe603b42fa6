"""Excerpts of long flights: evenly spaced minutes of an hour give the same diagnosis as the whole
hour, in a tenth of the memory.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .flight_log import FlightLog, with_rows

LONGEST = 480.0  # s of flight, all logs together, that are looked at whole
_WINDOW = 60.0  # s, of what is looked at of longer ones


def excerpt(logs: Sequence[FlightLog]) -> list[FlightLog]:
    """Return the logs, or windows of a minute spread evenly over each where they last more than
    ``LONGEST`` together.

    What is left out is a gap in the log, and a note of the log says so.
    """
    seconds = [float(log.t[-1] - log.t[0]) for log in logs]
    share = LONGEST / max(sum(seconds), LONGEST)
    return [
        log
        if share == 1.0 or length <= _WINDOW
        else _windows(log, length, max(1, round(share * length / _WINDOW)))
        for log, length in zip(logs, seconds, strict=True)
    ]


def _windows(log: FlightLog, seconds: float, count: int) -> FlightLog:
    keep = np.zeros(len(log.t), dtype=np.bool_)
    begins = (
        np.linspace(0.0, seconds - _WINDOW, count) if count > 1 else [0.5 * (seconds - _WINDOW)]
    )
    for begin in begins:
        keep |= (log.t >= log.t[0] + begin) & (log.t <= log.t[0] + begin + _WINDOW)
    note = (
        f"of {seconds:.0f} s, {count} windows of {_WINDOW:.0f} s, evenly spaced, were used; the "
        "rest was left out"
    )
    return replace(with_rows(log, keep), notes=(*log.notes, note))
