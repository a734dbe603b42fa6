"""What every estimator of this kit is given and returns."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Layout of the state vector: the estimate and nothing else
POSITION, QUATERNION, VELOCITY, RATE, TORQUE, FORCE = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13), slice(13, 16), slice(16, 19)
NIS = 19
STATE_SIZE = 20


class WrenchEstimate:
    """The state that an estimator believes in after one step; later steps do not change it."""

    __slots__ = ("covariance", "state")

    def __init__(self, state: Array, covariance: Array) -> None:
        self.state = state  # (20,), laid out by the constants above
        self.covariance = covariance  # (18, 18), order (rho, omega, x, v, torque, force)

    @property
    def position(self) -> Array:
        """Position (3,) of the geometric centre, m, world."""
        return self.state[POSITION]

    @property
    def quaternion(self) -> Array:
        """Attitude (4,), body to world, scalar first."""
        return self.state[QUATERNION]

    @property
    def velocity(self) -> Array:
        """Velocity (3,), m/s, world."""
        return self.state[VELOCITY]

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity (3,), rad/s, body."""
        return self.state[RATE]

    @property
    def torque(self) -> Array:
        """External torque (3,) about the centre of mass, Nm, world."""
        return self.state[TORQUE]

    @property
    def force(self) -> Array:
        """External force (3,), N, world."""
        return self.state[FORCE]

    @property
    def nis(self) -> float:
        """Normalised innovation squared of the last measurement; NaN where there was none."""
        return float(self.state[NIS])


class WrenchEstimator(Protocol):
    """What the estimators share: reset at a pose, then one step a sample."""

    def reset(self, position: ArrayLike, quaternion: ArrayLike, covariance: ArrayLike | None = None) -> None:
        """Start at a pose, at rest and without an external wrench."""
        ...

    def step(
        self, rotor_speeds: ArrayLike, position: ArrayLike | None = None, quaternion: ArrayLike | None = None
    ) -> WrenchEstimate:
        """Predict over one period with the turn rates (4,) of that period, then take in the pose at its end."""
        ...
