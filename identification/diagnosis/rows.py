"""The balance of forces and torques of flights as rows of a regression: accelerations in body axes
missing in the model, by the pose and by the accelerometer, from zero to a few hertz.

A steady wind has no power between 1 and 2 Hz, and a tilted frame none above: the whole band down to
zero tells one from the other. Above 3.5 Hz motors, filters and the flight loop decide the effect of
commands, and commands say nothing of torques.
"""

from collections.abc import Iterable

import numpy as np

from ...runtime.arrays import Index
from ..logs.table import Array
from ..motion.signals import in_body
from ..motion.smoothing import CUTOFFS, low_pass
from .coefficients import Setting, weight_and_torque
from .column import Column
from .flight_rows import blocks
from .regression import RegressedFlights

COMMANDED_CUTOFF_HZ = 3.5  # for rotors known by commands
FILTERED_CUTOFF_HZ = 2.0  # for a filtered pose: well below any filter
ROWS_PER_CUTOFF = 25.0 / 10.5  # rows in a period of the cut-off
# of the weight, and of the weight at a quarter of the arm: best accuracy of a log's motion, since a
# simulator's log may have no noise
LEAST = 1e-4
BLOCK = 4.0  # s, of the sums for the likelihood's scatter
BANDS_HZ = (2.5, 1.2, 0.6)  # edges of the bands in which a flight loop has one gain and phase


class Rows:
    """Rows (n, channels) of flights: specific force along body x, y and z, m/s2, by the pose; the
    same by the accelerometer, if each log has one beside the pose; and, with measured rotors,
    angular acceleration about the same axes, rad/s2.

    In logs with a motion read from an IMU the accelerometer is the motion, and force is in three
    channels.

    Args:
        flights: the vehicle's flights.
        fixed: effects known from elsewhere, with their coefficients; they are in every setting.

    Attributes:
        fit: (n,) rows in the fit.
        at: (n,) rows of ``flights``.
        begins: (n,) first row of an unbroken piece.
        block: (n,) number of the block of 4 s.
        t: (n,) s.
        channels: 3, 6 or 9.
        least: (channels,) best accuracy of a motion.
        with_torques: whether torques are among them.
        rotation: (samples, 3, 3) body to world, at the samples of ``flights``.
    """

    def __init__(self, flights: RegressedFlights, fixed: Setting) -> None:
        self.with_torques = not flights.commanded
        slow = FILTERED_CUTOFF_HZ if flights.filtered else np.inf
        self._cutoff = COMMANDED_CUTOFF_HZ if flights.commanded else slow
        cutoff = min(self._cutoff, CUTOFFS.residual_hz)
        step = max(1, round(1.0 / (ROWS_PER_CUTOFF * cutoff * flights.period)))
        self._period = step * flights.period
        self.flights = flights
        self.fixed = fixed
        self.at: Index = np.concatenate([rows[::step] for rows in flights.runs])
        self.begins = flights.start[self.at]
        self.t = flights.t[self.at]
        self.fit = flights.fit_rows[self.at]
        self.block = blocks(self.t, self.begins, BLOCK)
        self.has_accelerometer = flights.felt({}) is not None
        self.channels = 3 * (1 + self.has_accelerometer + self.with_torques)
        force, torque = np.split(LEAST * weight_and_torque(flights.vehicle) / flights.inertias, 2)
        self.least = np.append(
            np.tile(force, 1 + self.has_accelerometer), np.tile(torque, self.with_torques)
        )
        self.rotation = flights.at_rows("rotation")

    def from_world(self, x: Array, felt: bool = True) -> Array:
        """Return rows of accelerations (samples, 6): m/s2 in the world frame, and rad/s2 in body
        axes; ``felt``: whether an accelerometer reads them as well.
        """
        pose = in_body(x[:, :3], self.rotation)
        return self.from_body(pose, felt * pose, x[:, 3:])

    def from_body(
        self, pose: Array, accelerometer: Array | None = None, torque: Array | None = None
    ) -> Array:
        """Return rows (n, channels) of accelerations (samples, 3) m/s2 in body axes at the samples
        of ``flights``.

        Args:
            pose: by the pose.
            accelerometer: by the accelerometer, if there is one; default: as ``pose``.
            torque: the angular acceleration (samples, 3) rad/s2, body axes; default: none.
        """
        channels = [pose]
        if self.has_accelerometer:
            channels.append(pose if accelerometer is None else accelerometer)
        if self.with_torques:
            channels.append(np.zeros_like(pose) if torque is None else torque)
        return self.at_rows(np.concatenate(channels, axis=1))

    def at_rows(self, x: Array) -> Array:
        """Return samples of ``flights`` at the rows (n, ...), low-passed."""
        return self.flights.low_passed(x, self._cutoff)[self.at]

    def pieces(self, x: Array) -> list[Array]:
        """Return the unbroken pieces of rows ``x`` (n, ...)."""
        return np.split(x, np.flatnonzero(self.begins)[1:])

    def bands(self, x: Array) -> list[Array]:
        """Return rows ``x`` (n, ...), and, with torques, their parts in bands of frequency."""
        if not self.with_torques:
            return [x]
        out = [x]
        for edge in BANDS_HZ:
            slow = np.concatenate([low_pass(part, edge, self._period) for part in self.pieces(x)])
            out.append(x - slow)
            x = slow
        return [*out, x]

    def residual(self, setting: Setting) -> Array:
        """Return the residual (n, channels) with these effects.

        Raises:
            InputError: no vehicle is possible.
        """
        setting = {**self.fixed, **setting}
        left = self.flights.residual(setting) / self.flights.inertias
        felt = self.flights.felt(setting)
        rotation = self.flights.at_rows("rotation", setting)
        shown = in_body(left[:, :3], rotation)
        read = None if felt is None else shown + in_body(felt / self.flights.vehicle.mass, rotation)
        return self.from_body(shown, read, left[:, 3:])

    def noise(self) -> Array:
        """Return rows of the sensors' noise, as far as visible in the logs."""
        return self.from_world(self.flights.visible_noise / self.flights.inertias, felt=False)

    def columns(self, setting: Setting, wanted: Iterable[Column]) -> dict[Column, Array]:
        """Return the columns of coefficients (n, channels), by differences."""
        return self.flights.columns({**self.fixed, **setting}, wanted, self.residual)
