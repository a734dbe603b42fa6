"""Transient disturbances: forces and torques that a model leaves for a fraction of a second or a
few, and not in between.

A disturbance model of one strength hides a seldom transient: spread over a minute it is weak. But
noise of one strength, however fast, has peaks of about four standard deviations in a minute, and a
transient disturbance has more, in terms of the median.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..findings import CHANNELS, TransientDisturbance
from ..motion.smoothing import CUTOFFS, low_pass
from .regression import Flights, Setting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TransientSettings:
    """What counts as a transient disturbance."""

    # standard deviations; 378 flights that a model explains had up to 6.6, in strong turbulence up
    # to 4.6
    least_significance: float = 10.0
    least_size: float = 0.01  # of the weight, or of the weight times the arm
    margin: float = 1.0  # s at either end of a piece, where the filters lack half of what they need


TRANSIENT = TransientSettings()


def transient_disturbances(flights: Flights, setting: Setting) -> list[TransientDisturbance]:
    """Return the largest transient disturbance of each channel in the residual of a model with
    these effects, the most significant first.
    """
    residual, edge = flights.residual(setting), round(TRANSIENT.margin / flights.period)
    inner = np.concatenate([rows[edge : len(rows) - edge] for rows in flights.runs])
    if not inner.size:
        return []
    weight = flights.vehicle.weight
    least = TRANSIENT.least_size * weight * np.repeat([1.0, flights.vehicle.arm_l], 3)
    found: dict[str, tuple[float, TransientDisturbance]] = {}
    for cutoff in CUTOFFS.transient_hz:
        slow = np.concatenate(
            [low_pass(residual[rows], cutoff, flights.period) for rows in flights.runs]
        )
        size = np.abs(slow[inner])
        std = np.median(size, axis=0) / 0.6745  # of a normal distribution, whatever comes seldom
        for i, channel in enumerate(CHANNELS):
            row = inner[np.argmax(size[:, i])]
            peak = float(slow[row, i])
            above = abs(peak) / max(float(std[i]), 1e-30)
            before, _ = found.get(channel, (TRANSIENT.least_significance, None))
            if above > before and abs(peak) > least[i]:
                log, t = flights.logs[flights.log[row]].name, float(flights.t[row])
                found[channel] = above, TransientDisturbance(channel, log, t, peak)
    return [transient for _, transient in sorted(found.values(), key=lambda x: -x[0])]
