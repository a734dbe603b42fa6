"""The step to which logged rotor speeds are rounded, as the numbers themselves show it."""

from collections.abc import Sequence

import numpy as np

from ..logs.flight_log import FlightLog

_FEW = 0.2  # share of different values among all, below which they are rounded


def rounding_step(logs: Sequence[FlightLog]) -> float:
    """Return the step in rad/s; 0 where speeds are not rounded to one that would matter."""
    values = np.concatenate([log.rotor_speeds.ravel() for log in logs])
    kept = np.unique(np.round(values, 6))
    if len(kept) < 3 or len(kept) > _FEW * len(values):
        return 0.0
    return float(np.median(np.diff(kept)))
