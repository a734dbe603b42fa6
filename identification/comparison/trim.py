"""The trim of a flight: the rotors' shares of the work while the vehicle neither climbs nor turns.

On the mean of a flight the rotors' moments balance all constant loads. The mean thrusts therefore
tell the centre of mass, and a rotor with less thrust than requested. No true model is needed: a
thrust is proportional to the square of a rotor's speed, or to a command linear in thrust. A log
without a pose will do: while all rotors together push steadily with about the weight, the vehicle
neither climbs nor lands.

The noise of one flight's mean comes from the means of batches, each longer than the correlation
within a flight (Schmeiser, *Batch size effects in the analysis of simulation
output*, Operations Research 30, 1982).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_erosion, uniform_filter1d

from ...dynamics.vehicle import Vehicle
from ...runtime.arrays import Array, Mask
from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from ..logs.flight_phases import FLIGHT, flight_phases, flying, usual_thrust
from ..logs.table import median_step
from ..motion.smoothing import TOGETHER

LEAST_SECONDS = 3.0  # steady flight: a mean over less follows single manoeuvres
CALM = 1.5  # m/s: faster, the airflow decides how the rotors share the work
# for a log without a pose:
EDGE = 1.5  # s after the rotors start and before they stop: taking off and landing
NEAR = 0.1  # of the median thrust: further off, the vehicle climbs, sinks or pulls
_SMOOTH = 0.25  # s
BATCH = 1.5  # s: the loop's answer to a gust is over
FEATURES = ("left_less_right", "front_less_rear", "diagonals", "log_total")


@dataclass(frozen=True, eq=False)
class Trim:
    """One flight's mean thrusts, in any unit linear in thrust and common to all flights.

    Rotors are in this kit's order: 1 front-left, 2 rear-left, 3 rear-right, 4 front-right.
    """

    log: str  # its name
    seconds: float  # length of the mean
    thrust_share: Array  # (4,)
    total: float
    std: Array  # (4,) of ``features`` as means of one flight; zero: not known
    voltage: float = math.nan  # V, mean over the same time; NaN: not known
    session: str = ""  # common name of a session's flights; empty: not known

    @property
    def features(self) -> Array:
        """The four numbers, see ``features_of``."""
        return features_of(self.thrust_share * self.total)


def features_of(thrust: Array) -> Array:
    """Return the four numbers (..., 4) of thrusts (..., 4).

    These are differences in parts of the total, and log(total). The differences are left less
    right, front less rear, and rotors 1 and 3 less 2 and 4.
    """
    total, differences = np.split(thrust @ (2.0 * TOGETHER), [1], axis=-1)
    return np.concatenate([differences / total, np.log(total)], axis=-1)


def trim_of_log(log: FlightLog, vehicle: Vehicle) -> Trim:
    """Return the trim of a log: thrust in N where rotor speeds are known, or a motor curve; else
    the motor commands, taken as linear in thrust.

    Raises:
        InputError: fewer than 3 s count, or the rotors do not turn.
    """
    name = log.source or log.name
    if log.has_rotor_speeds or log.command is None:
        thrust = log.rotor_speeds**2 * vehicle.k
    elif vehicle.motor_curve is None:
        thrust = log.command
    else:
        thrust = vehicle.commanded_thrust(log.command, log.voltage)
    steady = _steady(log, thrust, vehicle)
    step = np.minimum(np.diff(log.t, append=log.t[-1]), 5.0 * log.period)  # a gap is no flight
    step, thrust = step[steady], thrust[steady]
    if (seconds := step.sum()) < LEAST_SECONDS:
        raise InputError(
            f"{name}: {seconds:.3g} s of calm flight; expected at least {LEAST_SECONDS:g} s off "
            f"the ground and slower than {CALM:g} m/s, to compare how the rotors share the work"
        )
    mean = np.average(thrust, axis=0, weights=step)
    if not np.all((mean > 0.0) & (mean < np.inf)):
        raise InputError(
            f"{name}: mean thrusts of the rotors are {np.round(mean, 4).tolist()}; expected four "
            "positive numbers"
        )
    batch = np.cumsum(step) // BATCH
    batches = [batch == number for number in np.unique(batch)]
    # the last batch may be a short one
    means = [thrust[rows].mean(axis=0) for rows in batches if step[rows].sum() >= 0.5 * BATCH]
    std = np.std(features_of(np.array(means)), axis=0, ddof=1) / math.sqrt(len(means))
    known = np.zeros(0) if log.voltage is None else log.voltage[steady & (log.voltage > 0.0)]
    voltage = known.mean() if known.size else math.nan
    return Trim(name, seconds, mean / mean.sum(), mean.sum(), std, voltage)


def _steady(log: FlightLog, thrust: Array, vehicle: Vehicle) -> Mask:
    """Return the rows (N,) of calm flight by the pose; without one, of thrust about the weight."""
    t, total = log.t, thrust.sum(axis=1)
    if log.valid.sum() < 3:
        smooth = _smooth(total, t)  # a single low sample is no landing
        around = np.ones(1 + 2 * round(EDGE / log.period))
        # a log may begin and end in flight
        steady = binary_erosion(flying(smooth), around, border_value=True)
        level = np.median(total[steady]) if steady.any() else np.inf
        return np.asarray(steady & (np.abs(smooth / level - 1.0) < NEAR))
    at, place = t[log.valid], log.position[log.valid]
    # scaled: usually the rotors carry the weight
    newton = thrust * (vehicle.weight / usual_thrust(total))
    speeds = np.sqrt(np.maximum(newton, 0.0) / vehicle.k)
    phases = flight_phases(t, np.interp(t, at, place[:, 2]), speeds, vehicle)
    flown = [(t >= start) & (t <= end) for phase, start, end in phases if phase == FLIGHT]
    speed = _smooth(np.linalg.norm(np.gradient(place, at, axis=0), axis=1), at)
    return np.asarray(np.any(flown, axis=0) & (np.interp(t, at, speed) < CALM))


def _smooth(values: Array, t: Array) -> Array:
    """Return a running mean: the noise of a pose is no motion."""
    width = max(1, round(_SMOOTH / median_step(t)))
    return np.asarray(uniform_filter1d(values, width, mode="nearest"))
