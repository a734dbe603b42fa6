"""Laws of the fan-tracking task in two directions: velocities along y and z from the wrench.

In a jet along +x the world's ``tau_z`` is positive at positive y, and ``tau_y`` negative above the
axis: a vehicle that moves by ``(-k tau_z, +k tau_y)`` moves towards it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.errors import InputError
from .observation import FORCE_X, MAX_COMMAND, TORQUE_Y, TORQUE_Z

Array = NDArray[np.floating[Any]]


def _limited(y: float, z: float) -> Array:
    return np.array(
        [min(max(v, -MAX_COMMAND), MAX_COMMAND) for v in (y, z)],
        dtype=np.float32,
    )


class Hover2D:
    """Stays where it is: the lower end of the score, 0."""

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (2,) m/s for an observation (10,)."""
        return _limited(0.0, 0.0)


class Admittance2D:
    """Velocities in proportion to the torques, as in McKinnon and Schoellig (2016) for one.

    Args:
        gain: m/s per Nm, sideways.
        gain_z: up and down.
    """

    def __init__(self, gain: float = 18.0, gain_z: float = 18.0) -> None:
        self.gain, self.gain_z = gain, gain_z

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (2,) m/s for an observation (10,)."""
        o = observation
        return _limited(-self.gain * float(o[TORQUE_Z]), self.gain_z * float(o[TORQUE_Y]))


class Ratio2D:
    """Velocities in proportion to the torques over the force along the jet.

    Args:
        gain: 1/s per metre-like ratio, sideways.
        gain_z: up and down.
        least_force: N, below which the force is held to be no jet at all.
    """

    def __init__(self, gain: float = 8.0, gain_z: float = 8.0, least_force: float = 0.1) -> None:
        self.gain, self.gain_z, self.least_force = gain, gain_z, least_force

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (2,) m/s for an observation (10,)."""
        o = observation
        force = max(float(o[FORCE_X]), self.least_force)
        return _limited(
            -self.gain * float(o[TORQUE_Z]) / force, self.gain_z * float(o[TORQUE_Y]) / force
        )


class Oracle2D:
    """Sees the fan: moves with it and towards its axis. The upper end of the score, 1.

    Args:
        gain: 1/s, from the true offset to velocity.
    """

    def __init__(self, gain: float = 2.0) -> None:
        self.gain = gain

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (2,) m/s; ``info`` is the environment's, with the fan in it.

        Raises:
            InputError: no ``info``.
        """
        if info is None:
            raise InputError(
                "oracle: needs the environment's info (fan, fan_velocity, position), which only a "
                "simulator has"
            )
        command = info["fan_velocity"] + self.gain * (info["fan"] - info["position"])
        return _limited(float(command[0]), float(command[1]))
