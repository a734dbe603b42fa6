"""The balance of forces and torques of flights as rows of a regression: the accelerations in body
axes that the model leaves, by the pose and by the accelerometer, at all frequencies from zero to a
few hertz.

A steady wind has no power between 1 and 2 Hz, and a tilted frame none above them: what tells one
from the other is the whole band down to zero. Above 3.5 Hz motors, filters and the flight loop
decide what commands do, and they say nothing of torques.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.effects import get
from ..motion.smoothing import CUTOFFS, low_pass
from .discrepancy import weight_and_torque
from .regression import Column, Flights, Setting
from .row_noise import ROW_NOISE

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class RowSettings:
    """The rows."""

    cutoff_hz: float = 3.5  # where rotors are known by commands
    # where the pose was filtered: well below any filter
    filtered_cutoff_hz: float = 2.0
    rows_per_cutoff: float = 25.0 / 10.5  # rows in a period of the cut-off
    block: float = 4.0  # s, of the sums by which the likelihood's scatter is judged


ROWS = RowSettings()


class Rows:
    """Rows (n, channels) of flights: specific force along body x, y and z, m/s2, by the pose; where
    each log has an accelerometer beside it, the same by the accelerometer; and, where rotors are
    measured, angular acceleration about the same axes, rad/s2.

    Of logs whose motion is read from an IMU the accelerometer is the motion, and force is in three
    channels.

    Args:
        flights: of the vehicle.
        fixed: effects that are known from elsewhere, with their coefficients; they are in every
            setting.

    Attributes:
        fit: (n,) rows that the fit may see.
        begins: (n,) first row of an unbroken piece.
        block: (n,) number of the block of 4 s.
        log: (n,) which log.
        t: (n,) s.
        channels: 3, 6 or 9.
        least: (channels,) to which a motion is known at best.
        with_torques: whether torques are among them.
        rotation: (samples, 3, 3) body to world, at the samples of ``flights``.
    """

    def __init__(self, flights: Flights, fixed: Setting) -> None:
        self.with_torques, cutoff, use = not flights.commanded, CUTOFFS.residual_hz, ROWS
        self._cutoff = np.inf
        if flights.commanded or flights.filtered:
            self._cutoff = cutoff = use.cutoff_hz if flights.commanded else use.filtered_cutoff_hz
        step = max(1, round(1.0 / (use.rows_per_cutoff * cutoff * flights.period)))
        self.flights, self.fixed = flights, fixed
        kept = [rows[::step] for rows in flights.runs]
        self._at: Index = np.concatenate(kept)
        self.begins: Mask = np.concatenate([np.arange(len(rows)) == 0 for rows in kept])
        self.t: Array = flights.t[self._at]
        self.log = flights.log[self._at]
        self.fit: Mask = flights.fit_rows[self._at]
        since = self.t - self.t[self.begins][np.cumsum(self.begins) - 1]
        number = (since // ROWS.block).astype(np.int64)
        new = self.begins | (np.diff(number, prepend=-1) != 0)
        self.block = np.cumsum(new) - 1
        self.has_accelerometer = flights.felt({}) is not None
        self.channels = 3 * (1 + self.has_accelerometer + self.with_torques)
        force, torque = np.split(
            ROW_NOISE.least * weight_and_torque(flights.vehicle) / flights.inertias, 2
        )
        forces, torques = [force] * (1 + self.has_accelerometer), [torque] * self.with_torques
        self.least = np.concatenate([*forces, *torques])
        self._inertia = flights.inertias[3:]
        self.rotation = flights.at_rows("rotation")

    def from_world(
        self, pose: Array, accelerometer: Array | None = None, torque: Array | None = None
    ) -> Array:
        """Return rows (n, channels, ...) of accelerations (samples, 3, ...) m/s2 in the world frame
        at the samples of ``flights``.

        Args:
            pose: that the pose shows.
            accelerometer: that the accelerometer shows, where there is one; default: the same.
            torque: the angular acceleration (samples, 3, ...) rad/s2, body axes; default: none.
        """
        both = [pose, pose if accelerometer is None else accelerometer]
        return self._thinned([self._in_body(x, self.rotation) for x in both], torque)

    def from_body(
        self, pose: Array, accelerometer: Array | None = None, torque: Array | None = None
    ) -> Array:
        """Return rows of accelerations in body axes; arguments as of ``from_world``."""
        return self._thinned([pose, pose if accelerometer is None else accelerometer], torque)

    @staticmethod
    def _in_body(x: Array, rotation: Array) -> Array:
        return np.asarray(np.einsum("nji,nj...->ni...", rotation, x))

    def _thinned(self, forces: list[Array], torque: Array | None) -> Array:
        channels = forces[: 1 + self.has_accelerometer]
        if self.with_torques:
            channels = [*channels, np.zeros_like(forces[0]) if torque is None else torque]
        return self.at_rows(np.concatenate(channels, axis=1))

    def at_rows(self, x: Array) -> Array:
        """Return at the rows (n, ...) what is known at the samples of ``flights``, low-passed."""
        period, runs = self.flights.period, self.flights.runs
        smooth = [low_pass(x[rows], self._cutoff, period) for rows in runs]
        return np.asarray(np.concatenate(smooth)[self._at])

    def residual(self, setting: Setting) -> Array:
        """Return what a model with these effects leaves (n, channels).

        Raises:
            InputError: no vehicle is like that.
        """
        mass, setting = self.flights.vehicle.mass, {**self.fixed, **setting}
        wrench = self.flights.residual(setting)
        left = wrench[:, :3] / mass
        felt = self.flights.felt(setting)
        both = [left] if felt is None else [left, left + felt / mass]
        rotation = self.flights.at_rows("rotation", setting)
        return self._thinned(
            [self._in_body(x, rotation) for x in both], wrench[:, 3:] / self._inertia
        )

    def noise(self) -> Array:
        """Return rows of the sensors' noise, as far as the logs show it."""
        noise = self.flights.visible_noise
        force = noise[:, :3] / self.flights.vehicle.mass
        return self.from_world(force, np.zeros_like(force), noise[:, 3:] / self._inertia)

    def columns(self, setting: Setting, wanted: Iterable[Column]) -> dict[Column, Array]:
        """Return what a unit of each coefficient explains (n, channels), by differences."""
        wanted = list(wanted)
        if not wanted:
            return {}
        mass, setting = self.flights.vehicle.mass, {**self.fixed, **setting}
        found = self.flights.columns(setting, wanted)
        pose = np.stack([found[c][:, :3] / mass for c in wanted], axis=2)
        torque = np.stack([found[c][:, 3:] / self._inertia for c in wanted], axis=2)
        rows = self.from_world(pose, torque=torque)
        out = {c: rows[:, :, i] for i, c in enumerate(wanted)}
        # what is felt is not what the pose shows
        sensing = [c for c in wanted if c[0] and get(c[0]).kind == "sensing"]
        if not (sensing and self.has_accelerometer):
            return out
        here = self.residual(setting)
        for effect, name in sensing:
            own = self.flights.coefficients(setting, effect)
            value, delta = self.flights.step(setting, (effect, name))
            moved = self.residual({**setting, effect: {**own, name: value + delta}})
            out[effect, name] = (here - moved) / delta
        return out
