"""From messages with parts of a row to rows of the flight.

A whole message is a row. Otherwise each pose and each inertial measurement makes a row, with the
rotor speeds at its time: interpolated linearly between two messages, and held after the
last. Without poses rotor speeds alone make rows, and the estimate goes on.
"""

from bisect import bisect_right
from operator import itemgetter

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array
from ..runtime.errors import InputError
from .messages import Measurement, Row
from .tallies import Tallies

_KEPT = 1.0  # s of rotor speeds kept; poses come much sooner
_SILENT = 0.15  # s without a row until rotor speeds make rows: several poses at 30 Hz
# s of commands alone until they count: an ESC reports measured rotor speeds at 10 Hz or more
_MEASURED = 1.0
_time = itemgetter(0)


class Joiner:
    """Makes rows of messages.

    Args:
        vehicle: its motor curve turns commands into rotor speeds if none are measured.
        tallies: counts poses before any rotor speeds.
    """

    def __init__(self, vehicle: Vehicle, tallies: Tallies) -> None:
        self._vehicle = vehicle
        self._tallies = tallies
        self._speeds: list[tuple[float, Array]] = []  # by time
        self._command: Array | None = None
        self._voltage: float | None = None
        self._measured = False  # rotor speeds come; commands give none
        self._first_command: float | None = None  # s
        self._last_row = -np.inf

    def take(self, sample: Measurement, t: float) -> Row | None:
        """Return the row of a message at time ``t``, s, or None.

        Raises:
            InputError: commands come, no measured rotor speeds, and the vehicle states no motor
                curve.
        """
        if sample.voltage is not None:
            self._voltage = sample.voltage
        if sample.command is not None:
            self._command = sample.command
        commanded = self._take_motors(sample, t)
        moving = sample.has_pose or sample.has_imu
        alone = not self._speeds or (
            not moving and not (sample.whole or t - self._last_row > _SILENT)
        )
        if alone:
            if sample.has_pose:
                self._tallies.counts["waiting"] += 1
            return None
        if not moving and not sample.has_motors:
            return None
        self._last_row = max(self._last_row, t)
        fields = sample.measured | {"command": self._command, "voltage": self._voltage}
        fields["rotor_speeds"] = self._at(t)
        if not sample.has_pose:
            fields |= {"position": None, "quaternion": None}
        return Row(t, sample.arrival, commanded=commanded, stamp=sample.stamp, **fields)

    def _take_motors(self, sample: Measurement, t: float) -> bool:
        """Keep rotor speeds; return whether commands gave them."""
        if sample.rotor_speeds is not None:
            if not self._measured:
                self._measured = True
                self._speeds.clear()
            self._keep(t, sample.rotor_speeds)
        elif sample.command is not None and not self._measured:
            if self._first_command is None:
                self._first_command = t
            wait = 0.0 if sample.whole else _MEASURED
            if t - self._first_command >= wait:
                if self._vehicle.motor_curve is None:
                    raise InputError(
                        f"vehicle {self._vehicle.name}: the stream has motor commands and no "
                        "measured rotor speeds, and the vehicle states no motor_curve; expected "
                        "one in its file, to turn commands into thrust"
                    )
                voltage = None if self._voltage is None else np.array([self._voltage])
                speeds = self._vehicle.commanded_speeds(sample.command[None, :], voltage)[0]
                self._keep(t, speeds)
        return not self._measured

    def _keep(self, t: float, speeds: Array) -> None:
        history = self._speeds
        at = bisect_right(history, t, key=_time)
        if not (at and history[at - 1][0] == t):
            history.insert(at, (t, speeds))
        while len(history) > 2 and history[0][0] < history[-1][0] - _KEPT:
            del history[0]

    def _at(self, t: float) -> Array:
        """Return the rotor speeds at a time, s."""
        history = self._speeds
        after = bisect_right(history, t, key=_time)
        if after in (0, len(history)):
            return history[max(after - 1, 0)][1]
        t0, a = history[after - 1]
        t1, b = history[after]
        return a + (b - a) * ((t - t0) / (t1 - t0))
