"""The residual of flights before and after effects are named: what of it is noise, and what comes
and goes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from ..findings import CHANNELS, Disturbance, TransientDisturbance
from ..motion.smoothing import CUTOFFS, low_pass
from .discrepancy import weight_and_torque
from .regression import Flights, Setting

Array = NDArray[np.float64]


# times the noise floor; a residual up to that is the sensors' noise
MOST_FLOOR_RATIO = 1.2
# of ``weight_and_torque``: a weaker disturbance, below the cut-off ``CUTOFFS.calm_hz``, is none
CALM = 0.006
# standard deviations; 378 flights that a model explains had up to 6.6, in strong turbulence up
# to 4.6
LEAST_SIGNIFICANCE = 10.0
LEAST_TRANSIENT = 0.01  # of the weight, or of the weight times the arm
# s at either end of a piece, where the transients' filters lack half of what they need
MARGIN = 1.0


@dataclass(frozen=True, eq=False)
class Balance:
    """The residual of flights (rows, 6), by the declared vehicle and by the amended one."""

    before: Array
    after: Array
    floor: tuple[float, float]  # RMS of what sensors alone leave, N and Nm
    error_before: tuple[float, float]  # RMS on held-out rows, N and Nm
    error_after: tuple[float, float]
    noisy: bool  # whether more is left than the sensors' noise
    # by how much the mean square of force and torque grows on held-out blocks, as a share, and the
    # standard error of that over the blocks
    growth: tuple[float, float]

    @property
    def better(self) -> bool:
        """Whether the amended vehicle's held-out error is smaller."""
        return self.growth[0] < 0.0


def balance(flights: Flights, setting: Setting) -> Balance:
    """Return the residual with a setting of effects. What of it is a sensor's bias is no error of
    the model, and counts before as well.
    """
    sensors = {k: x for k, x in setting.get("", {}).items() if ("", k) in flights.biases}
    before = flights.residual({"": sensors} if sensors else {})
    after = flights.residual(setting)
    held_out = ~flights.fit_rows
    floor = _rms(flights.visible_noise)
    error = _rms(after[held_out])
    # an IMU's own noise, and what a filter left of a pose's, is below what counts for none
    quiet = CALM * weight_and_torque(flights.vehicle)[[0, 3]]
    least = np.hypot(floor, quiet) if flights.inertial or flights.filtered else np.array(floor)
    noisy = bool(np.any(np.array(error) > MOST_FLOOR_RATIO * least))
    old, new = np.square(before[held_out]), np.square(after[held_out])
    change = np.mean((new - old) / (old.mean(axis=0) + 1e-30), axis=1)
    block = flights.block[held_out]
    blocks = np.array([change[block == b].mean() for b in np.unique(block)])
    return Balance(
        before,
        after,
        floor,
        _rms(before[held_out]),
        error,
        noisy,
        (float(blocks.mean()), float(blocks.std() / math.sqrt(max(len(blocks) - 1, 1)))),
    )


def beyond_calm(disturbances: Sequence[Disturbance], vehicle: Vehicle) -> float:
    """Return the logarithm of the largest unanswered disturbance of the six channels over what
    counts for none; ``-inf`` where none was fitted.
    """
    slow = [x.unanswered_below(CUTOFFS.calm_hz) for x in disturbances]
    calm = CALM * weight_and_torque(vehicle)
    return float(np.log(np.max(slow / calm))) if slow else -np.inf


def transient_disturbances(flights: Flights, setting: Setting) -> list[TransientDisturbance]:
    """Return the largest transient disturbance of each channel in the residual of a model with
    these effects, the most significant first.

    A disturbance model of one strength hides a seldom transient: spread over a minute it is weak.
    But noise of one strength, however fast, has peaks of about four standard deviations in a
    minute, and a transient disturbance has more, in terms of the median.
    """
    residual, edge = flights.residual(setting), round(MARGIN / flights.period)
    inner = np.concatenate([rows[edge : len(rows) - edge] for rows in flights.runs])
    if not inner.size:
        return []
    weight = flights.vehicle.weight
    least = LEAST_TRANSIENT * weight * np.repeat([1.0, flights.vehicle.arm_l], 3)
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
            before, _ = found.get(channel, (LEAST_SIGNIFICANCE, None))
            if above > before and abs(peak) > least[i]:
                log, t = flights.logs[flights.log[row]].name, float(flights.t[row])
                found[channel] = above, TransientDisturbance(channel, log, t, peak)
    return [transient for _, transient in sorted(found.values(), key=lambda x: -x[0])]


def _rms(wrench: Array) -> tuple[float, float]:
    """Return the RMS of force (N) and torque (Nm) over rows and axes."""
    force, torque = np.sqrt(np.square(wrench).reshape(-1, 2, 3).mean(axis=(0, 2))).tolist()
    return force, torque
