"""Inputs of a learned policy: scaled quantities of an observation, over the last few decisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..runtime.arrays import Mask, Single
from ..runtime.errors import InputError, unknown_name
from .observation import (
    DECISION_PERIOD,
    FORCE_X,
    FORCE_Y,
    FORCE_Z,
    LAST_COMMAND,
    TORQUE_X,
    TORQUE_Y,
    TORQUE_Z,
    VELOCITY_Y,
)


@dataclass(frozen=True)
class Quantity:
    """Place of a quantity, and its size on the scale 1."""

    scale: float  # N, Nm, m/s or m
    column: int
    summed: bool = False  # over the decisions since the episode's start, times their period
    odd: bool = False  # changes its sign where left and right change places


QUANTITIES: dict[str, Quantity] = {
    "torque_x": Quantity(0.03, TORQUE_X, odd=True),
    "torque_y": Quantity(0.03, TORQUE_Y),
    "torque_z": Quantity(0.03, TORQUE_Z, odd=True),
    "force_x": Quantity(0.5, FORCE_X),
    "force_y": Quantity(0.5, FORCE_Y, odd=True),
    "force_z": Quantity(0.5, FORCE_Z),
    "velocity_y": Quantity(0.5, VELOCITY_Y, odd=True),
    "command": Quantity(1.0, LAST_COMMAND, odd=True),
    # how far it has flown along y since the episode's start, by its own estimated velocity
    "path_y": Quantity(1.0, VELOCITY_Y, summed=True, odd=True),
}


@dataclass(frozen=True)
class Features:
    """The quantities of one frame with their scales, and the number of frames of a policy.

    Raises:
        InputError: an unknown or repeated quantity, no frame, a scale of zero or less.
    """

    frame: tuple[str, ...]
    history: int
    scale: tuple[float, ...] = ()  # default: that of ``QUANTITIES``

    def __post_init__(self) -> None:
        for name in self.frame:
            if not isinstance(name, str) or name not in QUANTITIES:
                raise unknown_name("quantity", str(name), QUANTITIES, "features: frame")
        if not self.frame or len(set(self.frame)) != len(self.frame):
            raise InputError(
                f"features: frame must name different quantities, got {list(self.frame)}"
            )
        if self.history < 1:
            raise InputError(f"features: history must be at least 1, got {self.history}")
        if not self.scale:
            object.__setattr__(self, "scale", tuple(QUANTITIES[name].scale for name in self.frame))
        if len(self.scale) != len(self.frame) or min(self.scale) <= 0:
            raise InputError(
                f"features: scale must hold {len(self.frame)} positive numbers, got "
                f"{list(self.scale)}"
            )

    @property
    def size(self) -> int:
        """Number of a policy's inputs."""
        return self.history * len(self.frame)

    def frames(self, observations: ArrayLike) -> Single:
        """Return scaled frames (n, quantities) of n environments' observations (n, 8)."""
        rows = np.asarray(observations, dtype=np.float64)
        scaled = rows[:, [QUANTITIES[name].column for name in self.frame]] / np.array(self.scale)
        scaled[:, self.summed] *= DECISION_PERIOD  # change of one decision
        clipped: Single = np.clip(scaled, -10.0, 10.0).astype(np.float32)
        return clipped

    @property
    def mirrored(self) -> Single:
        """Signs (size,) of a policy's inputs where left and right change places."""
        signs = [-1.0 if QUANTITIES[name].odd else 1.0 for name in self.frame]
        return np.array(signs * self.history, dtype=np.float32)

    @property
    def summed(self) -> list[int]:
        """Columns of a frame summed by a ``History``."""
        return [i for i, name in enumerate(self.frame) if QUANTITIES[name].summed]


_ALL = slice(None)


class History:
    """The last frames of n environments, oldest first; an episode begins with its first frame
    repeated, and sums begin at 0.
    """

    def __init__(self, features: Features, count: int) -> None:
        self._summed = features.summed
        self._frames = np.zeros((count, features.history, len(features.frame)), dtype=np.float32)

    def restart(self, frames: Single, which: slice | Mask = _ALL) -> None:
        """Begin an episode in the environments ``which`` with their rows of ``frames`` (n,
        quantities).
        """
        self._frames[which] = frames[which][:, None, :]
        for column in self._summed:
            self._frames[which, :, column] = 0.0

    def push(self, frames: Single) -> None:
        """Add one frame (n, quantities) each."""
        sums = self._frames[:, -1, self._summed]
        self._frames[:, :-1] = self._frames[:, 1:]
        self._frames[:, -1] = frames
        self._frames[:, -1, self._summed] += sums

    def flat(self) -> Single:
        """Return a copy (n, history * quantities)."""
        flat: Single = self._frames.reshape(len(self._frames), -1).copy()
        return flat
