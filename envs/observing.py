"""Episodes side by side, and their agents' views: the whole frame, a part, the history, or the pose
alone; in SI units or divided by fixed scales.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..controllers.observation import FORCE_X, LAST_COMMAND, MAX_COMMAND
from ..controllers.observation import VELOCITY_Y as _VELOCITY_Y
from ..runtime.errors import unknown_name
from .fan import STATIONS

Frame = NDArray[np.float32]
Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Episodes(NamedTuple):
    """Episodes side by side, a row each."""

    ticks: NDArray[np.int64]  # (n,) since the start; below zero while the filter settles
    paths: Array  # (n, m, 2) m, y and height of the fan's axis, a column a tick
    references: Array  # (n, k, 10), a column a tick; k = 0: the set point moves
    distance: Array  # (n,) m, from the fan at the start
    commands: Array  # (n, actions) in SI units
    changes: Array  # (n, actions) of the commands
    broken: Flags  # (n,) whether the physics started over on its own

    @classmethod
    def alike(
        cls, count: int, actions: int, path: Array, reference: Array, distance: float = 0.0
    ) -> "Episodes":
        """Return ``count`` episodes along the same path (m, 2) and reference (k, 10) that begin."""
        commands, changes = np.zeros((2, count, actions))
        return cls(
            np.zeros(count, dtype=np.int64),
            np.tile(path, (count, 1, 1)),
            np.tile(reference, (count, 1, 1)),
            np.full(count, distance),
            commands,
            changes,
            np.zeros(count, dtype=np.bool_),
        )


class Motion(NamedTuple):
    """Vehicles side by side: vehicle i in row ``i // lanes`` and lane ``i % lanes``."""

    position: Array  # (rows, 7, lanes) m, and quaternion
    velocity: Array  # (rows, 6, lanes) m/s, world, and rad/s, body
    wrench: Array  # (rows, 6, lanes) N and Nm, world, the true external one
    state: Array  # (rows, 20, lanes) as the filter estimates it
    specific: Array  # (rows, 3, lanes) m/s2, as of ``ClosedLoop``
    thrust: Array  # (rows, 3, lanes) m/s2, likewise
    air: Array  # (rows, STATIONS, 3, lanes) m/s, of the winds at the stations

    @classmethod
    def zeros(cls, rows: int) -> "Motion":
        """Return vehicles one to a row, before they fly."""
        sizes = (7,), (6,), (6,), (20,), (3,), (3,), (STATIONS, 3)
        return cls(*(np.zeros((rows, *size, 1)) for size in sizes))


FRAMES = 25  # decisions of a history, 2 s
# largest size of a frame's numbers: N, Nm, m/s and m/s
LIMITS = (10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, MAX_COMMAND)
# divisors: N, Nm, m/s and m/s; the jet's effect on the standard vehicle
SCALES = (0.5, 0.5, 0.5, 0.03, 0.03, 0.03, 0.5, 1.0)
# for the pose: position (m), velocity (m/s), tilt, yaw (rad), command (m/s)
_POSE_LIMITS = (5.0, 5.0, 5.0, 5.0, 1.0, 1.0, math.pi, MAX_COMMAND)
_POSE_SCALES = (1.0, 1.0, 1.0, 0.5, 0.1, 0.1, 0.2, 1.0)
OBSERVE = ("wrench", "wrench-without-fx", "history", "pose")


class View:
    """From the frames (n, size) of environments side by side to their agents' observations.

    Args:
        observe: one of ``OBSERVE``; other than ``"wrench"`` for FanTracking alone.
        normalize: whether each number is divided by its scale.
        limits: largest size (size,) of a frame's numbers.
        scales: divisors (size,) of the numbers.
        count: n, number of environments.

    Raises:
        InputError: an unknown view.
    """

    def __init__(
        self,
        observe: str = "wrench",
        normalize: bool = False,
        limits: Sequence[float] = LIMITS,
        scales: Sequence[float] = SCALES,
        count: int = 1,
    ) -> None:
        if observe not in OBSERVE:
            raise unknown_name("view", str(observe), OBSERVE, "FanTracking: observe")
        self._given = observe, normalize, limits, scales
        self.observe = observe
        if observe == "pose":
            limits, scales = _POSE_LIMITS, _POSE_SCALES
        kept = self._kept = slice(FORCE_X + 1 if observe == "wrench-without-fx" else 0, None)
        divisors = scales if normalize else np.ones(len(scales))
        self._limits, self._scales = (np.array(s, np.float32)[kept] for s in (limits, divisors))
        self._past = np.zeros((count, FRAMES, len(self._limits)), dtype=np.float32)
        self._begins = np.ones(count, dtype=np.bool_)  # before the episode's first frame
        self._start = np.zeros((count, 3))  # m

    def of_many(self, count: int) -> "View":
        """Return the same view of ``count`` environments."""
        return View(*self._given, count)

    def bound(self) -> Frame:
        """Return the largest size (m,) of an observation."""
        frames = FRAMES if self.observe == "history" else 1
        largest: Frame = np.tile(self._limits / self._scales, frames)
        return largest

    def restart(self, which: Flags | slice, states: Array) -> None:
        """Begin episodes in the environments ``which`` (n,) at estimated states (n, 20)."""
        self._begins[which], self._start[which] = True, states[which, :3]

    def of(self, which: Flags | slice, frames: Frame, states: Array) -> Frame:
        """Return the next observations (k, m) from frames (n, size) and estimated states (n, 20) in
        the environments ``which`` (n,).
        """
        if self.observe == "pose":
            pose = np.clip(self._pose(which, frames, states), -self._limits, self._limits)
            seen: Frame = np.nan_to_num(pose).astype(np.float32) / self._scales
            return seen
        one: Frame = frames[which][:, self._kept] / self._scales
        if self.observe != "history":
            return one
        before = np.concatenate([self._past[which, 1:], one[:, None]], axis=1)
        after = np.where(self._begins[which, None, None], one[:, None], before)
        self._past[which], self._begins[which] = after, False
        return after.reshape(len(one), FRAMES * one.shape[1])

    def _pose(self, which: Flags | slice, frames: Frame, states: Array) -> Array:
        x, frame = states[which].T, frames[which].T
        w, i, j, k = x[3:7]
        yaw = np.arctan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k)) - math.pi
        return np.column_stack(
            [
                x[:3].T - self._start[which],
                frame[_VELOCITY_Y],
                2.0 * (i * k + w * j),
                2.0 * (j * k - w * i),
                np.arctan2(np.sin(yaw), np.cos(yaw)),
                frame[LAST_COMMAND],
            ]
        )
