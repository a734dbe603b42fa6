"""Hand-designed laws that turn the estimated wrench into a velocity along y.

With the fan at the origin and the jet along +x, the world's ``tau_z`` is positive at positive y: a
vehicle that moves by ``-gain tau_z`` moves towards the axis. (In the body frame of a vehicle that
faces the fan, y and the sign turn round.)
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .observation import FORCE_X, MAX_COMMAND, TORQUE_Z

Array = NDArray[np.floating[Any]]


class Admittance:
    """The admittance controller of McKinnon and Schoellig (2016): velocity in proportion to the yaw
    torque.

    Args:
        gain: m/s per Nm; ``gain`` times the jet's largest torque bounds the speed of a fan that it
            can follow.
    """

    def __init__(self, gain: float = 18.0) -> None:
        self.gain = gain

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (1,) m/s for an observation (8,)."""
        return np.array(
            [np.clip(-self.gain * observation[TORQUE_Z], -MAX_COMMAND, MAX_COMMAND)],
            dtype=np.float32,
        )


class Ratio:
    """Velocity in proportion to ``tau_z / f_x``, which grows with the offset where ``tau_z`` alone
    falls off again.

    Args:
        gain: 1/s per metre-like ratio, m/s per m.
        least_force: N, below which the force is held to be no jet at all.
    """

    def __init__(self, gain: float = 8.0, least_force: float = 0.1) -> None:
        self.gain, self.least_force = gain, least_force

    def reset(self) -> None:
        """Forget the last episode."""

    def __call__(self, observation: Array, info: Mapping[str, Any] | None = None) -> Array:
        """Return the command (1,) m/s for an observation (8,)."""
        command = (
            -self.gain * observation[TORQUE_Z] / max(float(observation[FORCE_X]), self.least_force)
        )
        return np.array([np.clip(command, -MAX_COMMAND, MAX_COMMAND)], dtype=np.float32)
