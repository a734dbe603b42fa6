"""What episodes side by side are, and what their agents see: the whole frame, parts of it, its
history, or the pose alone; in SI units or divided by fixed scales.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..controllers.observation import (
    DECISION_PERIOD,
    FORCE_X,
    LAST_COMMAND,
    MAX_COMMAND,
)
from ..controllers.observation import VELOCITY_Y as _VELOCITY_Y
from ..runtime.errors import unknown_name
from .fan import STATIONS
from .plant import TICK

Frame = NDArray[np.float32]
Array = NDArray[np.float64]


class Episodes(NamedTuple):
    """Episodes side by side, a row each."""

    ticks: NDArray[np.int64]  # (n,) since the start; below zero while the filter settles
    paths: Array  # (n, m, 2) m, y and height of the fan's axis, a column a tick
    references: Array  # (n, k, 10) to be flown, a column a tick; k = 0: the set point moves
    distance: Array  # (n,) m, from the fan at the start
    commands: Array  # (n, actions) in SI units
    changes: Array  # (n, actions) of the commands
    broken: NDArray[np.bool_]  # (n,) whether the physics started over on its own


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
_TICKS = round(DECISION_PERIOD / TICK)  # of a decision
# largest size of a frame's numbers: N, Nm, m/s and m/s
LIMITS = (10.0, 10.0, 10.0, 1.0, 1.0, 1.0, 5.0, MAX_COMMAND)
# sizes that become 1: N, Nm, m/s and m/s; what the jet does to the standard vehicle
SCALES = (0.5, 0.5, 0.5, 0.03, 0.03, 0.03, 0.5, 1.0)
# of the pose: position (m), velocity (m/s), tilt, yaw (rad), command (m/s)
_POSE_LIMITS = (5.0, 5.0, 5.0, 5.0, 1.0, 1.0, math.pi, MAX_COMMAND)
_POSE_SCALES = (1.0, 1.0, 1.0, 0.5, 0.1, 0.1, 0.2, 1.0)
OBSERVE = ("wrench", "wrench-without-fx", "history", "pose")


class View:
    """From the frame (n,) of the environment to what its agent sees.

    Args:
        observe: one of ``OBSERVE``; other than ``"wrench"`` of FanTracking alone.
        normalize: whether each number is divided by its scale.
        limits: largest size (n,) of the frame's numbers.
        scales: sizes (n,) that become 1.

    Raises:
        InputError: an unknown view.
    """

    def __init__(
        self,
        observe: str = "wrench",
        normalize: bool = False,
        limits: Sequence[float] = LIMITS,
        scales: Sequence[float] = SCALES,
    ) -> None:
        if observe not in OBSERVE:
            raise unknown_name("view", str(observe), OBSERVE, "FanTracking: observe")
        self.observe, self.normalize = observe, normalize
        if observe == "pose":
            limits, scales = _POSE_LIMITS, _POSE_SCALES
        kept = [i for i in range(len(limits)) if observe != "wrench-without-fx" or i != FORCE_X]
        self._kept = kept
        self._limits = np.array(limits, dtype=np.float32)[kept]
        self._scales = (
            np.array(scales, dtype=np.float32)[kept]
            if self.normalize
            else np.ones(len(kept), dtype=np.float32)
        )
        self.size = len(kept) * (FRAMES if observe == "history" else 1)
        self._past = np.zeros((FRAMES, len(kept)), dtype=np.float32)
        self._seen = -1  # ticks at which the history ends
        self._start = np.zeros(3)

    @property
    def is_plain(self) -> bool:
        """Whether the frame is seen as it is."""
        return self.observe == "wrench" and not self.normalize

    @property
    def is_of_a_frame(self) -> bool:
        """Whether a frame alone says what is seen, so that many can be turned at once."""
        return self.observe in ("wrench", "wrench-without-fx")

    def bound(self) -> Frame:
        """Return the largest size (n,) of what is seen."""
        largest: Frame = np.tile(self._limits / self._scales, self.size // len(self._kept))
        return largest

    def restart(self, state: Array) -> None:
        """Begin an episode at an estimated state (20,)."""
        self._seen, self._start = -1, state[:3].copy()

    def of_frames(self, frames: Frame) -> Frame:
        """Return what is seen of frames (n, size), where a frame alone says so."""
        seen: Frame = frames[:, self._kept] / self._scales
        return seen

    def of(self, frame: Frame, state: Array, ticks: int) -> Frame:
        """Return what is seen of a frame (8,) and the estimated state (20,), ``ticks`` after the
        episode's start; the same ticks twice are one frame of the history.
        """
        if self.observe == "pose":
            pose = np.clip(self._pose(frame, state), -self._limits, self._limits)
            return (np.nan_to_num(pose).astype(np.float32) / self._scales).astype(np.float32)
        one: Frame = frame[self._kept] / self._scales
        if self.observe != "history":
            return one
        if self._seen < 0 or ticks < self._seen:
            self._past[:] = one
        elif ticks > self._seen:
            steps = min(-(-(ticks - self._seen) // _TICKS), FRAMES)
            self._past[:-steps] = self._past[steps:]
            self._past[-steps:] = one
        self._seen = ticks
        return self._past.ravel().copy()

    def _pose(self, frame: Frame, x: Array) -> Array:
        w, i, j, k = x[3:7]
        yaw = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k)) - math.pi
        return np.array(
            [
                *(x[:3] - self._start),
                frame[_VELOCITY_Y],
                2.0 * (i * k + w * j),
                2.0 * (j * k - w * i),
                math.atan2(math.sin(yaw), math.cos(yaw)),
                frame[LAST_COMMAND],
            ]
        )


__all__ = ["FRAMES", "OBSERVE", "SCALES", "Episodes", "Motion", "View"]
