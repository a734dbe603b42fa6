"""The trim of a flight: how the rotors share the work while the vehicle neither climbs nor turns.

On the mean of a flight the rotors' moments balance what acts on the vehicle all the time, so the
mean thrusts tell where it weighs and which rotor delivers less than it is asked for. That needs no
true model: only that a thrust is proportional to the square of a rotor's speed, or to a command
that is linear in thrust.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from ..logs.flight_phases import FLIGHT, flight_phases

Array = NDArray[np.float64]

LEAST_SECONDS = 3.0  # of steady flight: a mean over less follows single manoeuvres
CALM = 1.5  # m/s: faster, the airflow decides how the rotors share the work


@dataclass(frozen=True, eq=False)
class Trim:
    """One flight's mean thrusts, in any unit that is linear in thrust and the same in each flight.

    Rotors are in this kit's order: 1 front-left, 2 rear-left, 3 rear-right, 4 front-right.
    """

    name: str
    thrust: Array  # (4,)
    seconds: float  # that it is a mean of

    @property
    def total(self) -> float:
        """Sum of the four."""
        return float(self.thrust.sum())

    @property
    def shares(self) -> Array:
        """Difference of left and right, front and rear, and of the two diagonals (1 and 3 less 2
        and 4), (3,), each in parts of the total.
        """
        a, b, c, d = self.thrust / self.total
        return np.array([a + b - c - d, a + d - b - c, a + c - b - d])


def trim_of(name: str, t: Array, thrust: Array, steady: NDArray[np.bool_]) -> Trim:
    """Return the trim of a flight.

    Args:
        name: of the flight.
        t: (N,) s, increasing.
        thrust: (N, 4), linear in thrust.
        steady: (N,) rows that count.

    Raises:
        InputError: fewer than 3 s count, or the rotors do not turn.
    """
    step = np.diff(t, append=t[-1])
    step = np.minimum(step, 5.0 * np.median(np.diff(t)))  # a gap is no flight
    seconds = float(step[steady].sum())
    if seconds < LEAST_SECONDS:
        raise InputError(
            f"{name}: {seconds:.3g} s of calm flight; expected at least {LEAST_SECONDS:g} s off "
            f"the ground and slower than {CALM:g} m/s, to compare how the rotors share the work"
        )
    mean = np.average(thrust[steady], axis=0, weights=step[steady])
    if not (np.all(np.isfinite(mean)) and mean.min() > 0.0):
        raise InputError(
            f"{name}: mean thrusts of the rotors are {np.round(mean, 4).tolist()}; expected four "
            "positive numbers"
        )
    return Trim(name, mean, seconds)


def trim_of_log(log: FlightLog, vehicle: Vehicle) -> Trim:
    """Return the trim of a log in the kit's format, N.

    Raises:
        InputError: too little calm flight.
    """
    thrust = np.square(log.rotor_speeds) * vehicle.k
    seen = np.flatnonzero(log.valid)
    if len(seen) < 3:
        raise InputError(f"{log.source or log.name}: fewer than three poses; expected a flight")
    height = np.interp(log.t, log.t[seen], log.position[seen, 2])
    steady = np.zeros(len(log.t), dtype=np.bool_)
    for phase in flight_phases(log.t, height, log.rotor_speeds, vehicle):
        if phase.name == FLIGHT:
            steady |= (log.t >= phase.start) & (log.t <= phase.end)
    velocity = np.gradient(log.position[seen], log.t[seen], axis=0)
    speed = _smooth(np.linalg.norm(velocity, axis=1), log.t[seen])
    steady &= np.interp(log.t, log.t[seen], speed) < CALM
    return trim_of(log.source or log.name, log.t, thrust, steady)


def _smooth(values: Array, t: Array, seconds: float = 0.25) -> Array:
    """Return a running mean, so that the noise of a pose is not taken for motion."""
    width = max(1, round(seconds / float(np.median(np.diff(t)))))
    return np.convolve(values, np.full(width, 1.0 / width), mode="same")
