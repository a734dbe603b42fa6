"""Numbers that no flight has: they are refused where a log is read, because products of a few of
them overflow.
"""

from dataclasses import dataclass

import numpy as np

from ...runtime.errors import InputError
from .flight_log import ACCELEROMETER, GYRO, POSE, ROTORS, TRUTH, FlightLog


@dataclass(frozen=True)
class Magnitudes:
    """How large and how small the numbers of a log may be.

    Attributes:
        shortest_period: s, of the median step: 100 kHz, far above any pose's rate.
        longest_step: s, of any step; a log in nanoseconds has steps of 1e7, and more than a year
            between two rows is no flight.
        largest: of all other numbers, in SI units; logs in millimetres or rpm stay far below.
    """

    shortest_period: float = 1e-5
    longest_step: float = 1e12
    largest: float = 1e9


def check_magnitudes(log: FlightLog, limits: Magnitudes | None = None) -> None:
    """Check that a log's numbers are in the range of a flight's.

    Raises:
        InputError: one is not; the message says which.
    """
    limits = limits or Magnitudes()
    step = np.diff(log.t)
    if not len(step):
        return
    if not log.period >= limits.shortest_period:
        raise InputError(
            f"{log.source}: column t: the median time step is {log.period:.3g} s; expected at "
            f"least {limits.shortest_period:g} s"
        )
    longest = int(np.argmax(step))
    if not step[longest] <= limits.longest_step:
        raise InputError(
            f"{log.source}: column t, row {longest + 2}: {step[longest]:.3g} s after the row "
            f"before; expected at most {limits.longest_step:g} s"
        )
    groups = (
        (POSE[:3], log.position),
        (ROTORS, log.rotor_speeds),
        (("vbat",), None if log.voltage is None else log.voltage[:, None]),
        (TRUTH[:3], log.force),
        (TRUTH[3:], log.torque),
        (ACCELEROMETER, log.accelerometer),
        (GYRO, log.gyro),
    )
    for names, values in groups:
        if values is None:
            continue
        beyond = np.argwhere(np.abs(values) > limits.largest)  # False where NaN
        if beyond.size:
            row, column = beyond[0]
            raise InputError(
                f"{log.source}: column {names[column]}, row {row + 1}: "
                f"{values[row, column]:.3g}; expected a number within {limits.largest:g}"
            )
