"""Logs with rotor speeds from commands (PWM, thrust): their use in a regression, and its limits.

The rotors' moments are only commanded ones, and the ground carries too. So only the time in the air
counts, and torque is left out. Thrust and the motion capture's vertical differ from flight to
flight: see ``row_nuisances``.
"""

from dataclasses import replace

import numpy as np

from ...dynamics.effects import Role
from ...dynamics.vehicle import Vehicle
from ..logs.flight_log import FlightLog, with_rows
from ..logs.flight_phases import FLIGHT, flight_phases, usual_thrust
from ..motion.signals import Signals
from ..motion.smoothing import CUTOFFS, low_pass

PERIOD = 0.02  # s, of the used samples
# without a height: share of the usual thrust from which rotors carry the vehicle, and s of take-off
# and landing beyond these rows
CARRYING_SHARE = 0.7
TAKE_OFF = 1.0
# relative standard deviation of a command's thrust without a stated motor curve: measured flights
# of three kinds of vehicle had 0.69 to 1.12 of the assumed thrust
UNSTATED_THRUST_STD = 0.3
# the exact effect of an error of the assumed thrust
THRUST_FACTORS = (Role.THRUST, Role.MASS)


def in_flight(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the rows of a log between take-off and landing; the log itself if it shows neither, or
    no flight at all.
    """
    seen = log.valid
    if not seen.any():
        return log
    height = np.interp(log.t, log.t[seen], log.position[seen, 2])
    for phase in flight_phases(log.t, height, log.rotor_speeds, vehicle):
        if phase.name == FLIGHT:
            return with_rows(log, (log.t >= phase.start) & (log.t <= phase.end))
    return log


def in_flight_by_thrust(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the rows of a log without a height between take-off and landing, by the rotors'
    thrust; the log itself if they carry the vehicle all the time.
    """
    thrust = np.square(log.rotor_speeds) @ vehicle.k
    if len(thrust) * log.period > 1.0 / CUTOFFS.flying_hz:
        thrust = low_pass(thrust, CUTOFFS.flying_hz, log.period)
    carried = np.flatnonzero(thrust > CARRYING_SHARE * usual_thrust(thrust))
    if not carried.size:
        return log
    first, last = carried[[0, -1]]
    begin = log.t[first] + TAKE_OFF * (first > 0)
    end = log.t[last] - TAKE_OFF * (last < len(thrust) - 1)
    keep = (log.t >= begin) & (log.t <= end)
    return with_rows(log, keep) if keep.any() else log


def downsampled(signals: Signals) -> Signals:
    """Return signals at 50 Hz or a little more, with the pose's filter on the rotor speeds."""
    step = max(1, int(PERIOD / signals.period + 1e-6))
    if step == 1:
        return signals
    smooth = np.maximum(low_pass(signals.rotor_speeds, CUTOFFS.pose_hz, signals.period), 0.0)
    every = replace(signals, rotor_speeds=smooth).at(slice(None, None, step))
    return replace(every, period=step * signals.period)
