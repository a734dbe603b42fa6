"""What every estimator of this kit is given and returns."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..runtime.arguments import in_brackets

Array = NDArray[np.float64]

# Layout of the state vector: the estimate and nothing else
POSITION, QUATERNION, VELOCITY = slice(0, 3), slice(3, 7), slice(7, 10)
RATE, TORQUE, FORCE = slice(10, 13), slice(13, 16), slice(16, 19)
NIS = 19
STATE_SIZE = 20
# What became of the last step's measurement, in the filter's memory
TRACKING, COASTING, REJECTED, RESTARTED = 0.0, 1.0, 2.0, 3.0
STATUSES = ("tracking", "coasting", "rejected", "restarted")
# Behind the state the covariance, then the status and how often the estimator restarted
STATUS, RESTARTS = STATE_SIZE + 18 * 18, STATE_SIZE + 18 * 18 + 1
ESTIMATE_SIZE = RESTARTS + 1


class WrenchEstimate:
    """The state that an estimator believes in after one step; later steps do not change it."""

    __slots__ = ("_numbers",)

    def __init__(self, numbers: Array) -> None:
        # (346,) state, covariance, status and count of restarts, one after the other
        self._numbers = numbers

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} {self.status}: force {in_brackets(self.force)} N, torque "
            f"{in_brackets(self.torque)} Nm, NIS {self.nis:.3g}>"
        )

    @property
    def state(self) -> Array:
        """All of the estimate (20,), laid out by this module's constants."""
        return self._numbers[:STATE_SIZE]

    @property
    def covariance(self) -> Array:
        """Covariance (18, 18) of the error state (rho, omega, x, v, torque, force), rho being a
        world-frame MRP.
        """
        return self._numbers[STATE_SIZE:STATUS].reshape(18, 18)

    @property
    def position(self) -> Array:
        """Position (3,) of the geometric centre, m, world."""
        return self._numbers[POSITION]

    @property
    def quaternion(self) -> Array:
        """Attitude (4,), body to world, scalar first."""
        return self._numbers[QUATERNION]

    @property
    def velocity(self) -> Array:
        """Velocity (3,), m/s, world."""
        return self._numbers[VELOCITY]

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity (3,), rad/s, body."""
        return self._numbers[RATE]

    @property
    def torque(self) -> Array:
        """External torque (3,) about the centre of mass, Nm, world."""
        return self._numbers[TORQUE]

    @property
    def force(self) -> Array:
        """External force (3,), N, world."""
        return self._numbers[FORCE]

    @property
    def nis(self) -> float:
        """Normalised innovation squared of the last measurement; NaN where there was none."""
        return float(self._numbers[NIS])

    @property
    def status(self) -> str:
        """What became of the last step's measurement.

        "tracking": it was taken in; "coasting": there was none, the estimate is a prediction, or
        held where a gap has left nothing to predict from; "rejected": the gate refused it;
        "restarted": pose and twist start anew at it, after a gap, or because it and those before it
        contradict what was estimated (``estimator.recovery``).
        """
        return STATUSES[int(self._numbers[STATUS])]

    @property
    def restarts(self) -> int:
        """How often the estimator restarted since its ``reset``."""
        return int(self._numbers[RESTARTS])


class WrenchEstimator(Protocol):
    """What the estimators share: reset at a pose, then one step a sample."""

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose, without an external wrench."""
        ...

    def step(
        self,
        rotor_speeds: ArrayLike,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        voltage: float | None = None,
    ) -> WrenchEstimate:
        """Predict over one period with the rotor speeds (4,) of that period, then take in the pose
        at its end.
        """
        ...
