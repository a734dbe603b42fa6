"""The residual of flights before and after effects are named: its noise, and its transients."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from ...dynamics.vehicle import Vehicle
from ..findings import CHANNELS, Disturbance, TransientDisturbance
from ..logs.table import Array, Pair
from ..motion.smoothing import CUTOFFS
from .coefficients import Setting, weight_and_torque
from .regression import RegressedFlights

# times the noise floor; a smaller residual is the sensors' noise
MOST_FLOOR_RATIO = 1.2
# of ``weight_and_torque``: a weaker disturbance, below the cut-off ``CUTOFFS.calm_hz``, is none
CALM = 0.006
# standard deviations; 378 flights explained by a model had up to 6.6, in strong turbulence up to
# 4.6
LEAST_SIGNIFICANCE = 10.0
LEAST_TRANSIENT = 0.01  # of the weight, or of the weight times the arm
# s at either end of a piece, where the transients' filters lack half of their input
MARGIN = 1.0


@dataclass(frozen=True, eq=False)
class Balance:
    """The residual of flights (rows, 6), by the declared vehicle and by the amended one."""

    before: Array
    after: Array
    floor: Pair  # RMS of the sensors' noise, N and Nm
    error_before: Pair  # RMS on held-out rows, N and Nm
    error_after: Pair
    noisy: bool  # whether the error is above the sensors' noise
    better: bool  # whether the mean square of force and torque on held-out blocks falls


def balance(flights: RegressedFlights, setting: Setting) -> Balance:
    """Return the residual with a setting of effects. A sensor's bias is no error of the model: the
    residual before is without it, too.
    """
    biases = {c.coefficient for c in flights.biases}
    sensors = {k: x for k, x in setting.get("", {}).items() if k in biases}
    before = flights.residual({"": sensors})
    after = flights.residual(setting)
    held_out = ~flights.fit_rows
    floor = _rms(flights.visible_noise)
    error = _rms(after[held_out])
    # an IMU's own noise, and the rest of a filtered pose's noise, are below a countable disturbance
    calm = CALM if flights.inertial or flights.filtered else 0.0
    least = np.hypot(floor, calm * weight_and_torque(flights.vehicle)[[0, 3]])
    noisy = bool(np.any(error > MOST_FLOOR_RATIO * least))
    old = _rms(before[held_out])
    better = bool(np.square(error / np.maximum(old, 1e-15)).mean() < 1.0)
    return Balance(before, after, floor, old, error, noisy, better)


def is_beyond_calm(disturbances: Sequence[Disturbance], vehicle: Vehicle) -> bool:
    """Return whether an unanswered disturbance of the six channels is above a negligible one."""
    calm = CALM * weight_and_torque(vehicle)
    each = zip(disturbances, calm, strict=False)  # without a fitted disturbance none
    return any(x.unanswered_below(CUTOFFS.calm_hz) > most for x, most in each)


def transient_disturbances(
    flights: RegressedFlights, setting: Setting
) -> list[TransientDisturbance]:
    """Return the largest transient disturbance of each channel in the residual of a model with
    these effects, the most significant first.

    A disturbance model of one strength hides a rare transient: spread over a minute it is weak. But
    noise of one strength, however fast, has peaks of about four standard deviations in a minute. A
    transient has more, in terms of the median.
    """
    residual = flights.residual(setting)
    edge = round(MARGIN / flights.period)
    inner = np.concatenate([rows[edge : len(rows) - edge] for rows in flights.runs])
    if not inner.size:
        return []
    least = LEAST_TRANSIENT * weight_and_torque(flights.vehicle, 1.0)
    found = []
    for cutoff in CUTOFFS.transient_hz:
        slow = flights.low_passed(residual, cutoff)
        size = np.abs(slow[inner])
        std = np.median(size, axis=0) / 0.6745  # of a normal distribution, despite rare peaks
        above = size.max(axis=0) / np.maximum(std, 1e-30)
        rows = inner[size.argmax(axis=0)]
        for i, (row, channel) in enumerate(zip(rows.tolist(), CHANNELS, strict=True)):
            peak = float(slow[row, i])
            if above[i] > LEAST_SIGNIFICANCE and abs(peak) > least[i]:
                log = flights.logs[flights.log[row]].name
                push = TransientDisturbance(channel, log, float(flights.t[row]), peak)
                found.append((above[i], push))
    largest: dict[str, TransientDisturbance] = {}
    for _, push in sorted(found, key=itemgetter(0), reverse=True):
        largest.setdefault(push.channel, push)
    return [*largest.values()]


def _rms(wrench: Array) -> Pair:
    """Return the RMS of force (N) and torque (Nm) over rows and axes."""
    force, torque = np.sqrt(np.square(wrench).reshape(-1, 2, 3).mean(axis=(0, 2))).tolist()
    return force, torque
