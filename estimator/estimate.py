"""The result of every estimator of this kit."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.arguments import in_brackets
from ..runtime.errors import InputError

Array = NDArray[np.float64]

# Layout of the state vector
POSITION, QUATERNION, VELOCITY = slice(0, 3), slice(3, 7), slice(7, 10)
RATE, TORQUE, FORCE = slice(10, 13), slice(13, 16), slice(16, 19)
NIS = 19
STATE_SIZE = 20


class Status(IntEnum):
    """The verdict on the last step's measurement."""

    TRACKING = 0  # taken in
    COASTING = 1  # none was made
    REJECTED = 2  # refused by the gate
    RESTARTED = 3  # pose and twist start anew there


STATUSES = tuple(status.name.lower() for status in Status)
TRACKING, COASTING, REJECTED, RESTARTED = map(float, Status)  # in the filter's memory
# Layout of an estimate's numbers: the state, the status, the restarts, the excess of the variances
# of measured attitudes and positions over the declared ones. Then come the variances of torque and
# force by the vehicle's uncertainty, and perhaps the covariance
STATUS, RESTARTS, WITHOUT_COVARIANCE = STATE_SIZE, STATE_SIZE + 1, STATE_SIZE + 10
EXCESS, MODEL = slice(RESTARTS + 1, RESTARTS + 3), slice(RESTARTS + 3, WITHOUT_COVARIANCE)
ESTIMATE_SIZE = WITHOUT_COVARIANCE + 18 * 18


class WrenchEstimate:
    """The estimate of one filter, of each filter of a batch, or at each time of a series.

    Shapes below are one filter's; a batch or series has its axis in front. Later steps do not
    change an estimate.

    Args:
        numbers: (30,) state, status, restarts, the excess of the measurements' variances and the
            model's variances, or (354,), the covariance behind them.
        std: (18,) standard deviations of the error state, where there is no covariance.
    """

    __slots__ = ("_std", "numbers")

    def __init__(self, numbers: Array, std: Array | Callable[[], Array] | None = None) -> None:
        self.numbers = numbers
        self._std = std

    def __repr__(self) -> str:
        name, codes = type(self).__name__, np.atleast_1d(self.status_code)
        if self.numbers.ndim > 1:
            counts = [(int(np.sum(codes == i)), word) for i, word in enumerate(STATUSES)]
            words = ", ".join(f"{count} {word}" for count, word in counts if count)
            return f"<{name} of {len(codes)}: {words}>"
        return (
            f"<{name} {self.status}: force {in_brackets(self.force)} N, torque "
            f"{in_brackets(self.torque)} Nm, NIS {self.nis:.3g}>"
        )

    def at(self, i: int) -> WrenchEstimate:
        """Return the estimate at place ``i`` of the axis in front."""
        return WrenchEstimate(self.numbers[i], None if self._std is None else self.std[i])

    @property
    def state(self) -> Array:
        """All of the estimate (20,), laid out by this module's constants."""
        return self.numbers[..., :STATE_SIZE]

    @property
    def covariance(self) -> Array:
        """Covariance (18, 18) of the error state (rho, omega, x, v, torque, force), by noise and
        the wrench's changes, for a vehicle exactly as declared; rho is a world-frame MRP.

        Raises:
            InputError: the estimate has none: a batch's stands in the batch, a smoothed one must
                be asked for.
        """
        if self.numbers.shape[-1] != ESTIMATE_SIZE:
            raise InputError(
                "WrenchEstimate: no covariance here; a batch has its own, and smooth takes "
                "covariance=True"
            )
        return self.numbers[..., WITHOUT_COVARIANCE:].reshape(*self.numbers.shape[:-1], 18, 18)

    @property
    def std(self) -> Array:
        """Standard deviations (18,) of the same: without the vehicle's own uncertainty."""
        if callable(self._std):  # worked out when they are asked for
            self._std = self._std()
        if self._std is None:
            return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))
        return self._std

    @property
    def model_std(self) -> Array:
        """Standard deviations (6,) of torque, Nm, and force, N, by the stated uncertainty of the
        vehicle (``estimator.model_uncertainty``).
        """
        return np.sqrt(self.numbers[..., MODEL])

    @property
    def std_wrench(self) -> Array:
        """Standard deviations (6,) of torque, Nm, and force, N, by noise and the vehicle's
        uncertainty.
        """
        return np.hypot(self.std[..., 12:], self.model_std)

    @property
    def std_torque(self) -> Array:
        """Standard deviations (3,) of the torque, Nm."""
        return self.std_wrench[..., :3]

    @property
    def std_force(self) -> Array:
        """Standard deviations (3,) of the force, N."""
        return self.std_wrench[..., 3:]

    @property
    def position(self) -> Array:
        """Position (3,) of the geometric centre, m, world."""
        return self.numbers[..., POSITION]

    @property
    def quaternion(self) -> Array:
        """Attitude (4,), body to world, scalar first."""
        return self.numbers[..., QUATERNION]

    @property
    def velocity(self) -> Array:
        """Velocity (3,), m/s, world."""
        return self.numbers[..., VELOCITY]

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity (3,), rad/s, body."""
        return self.numbers[..., RATE]

    @property
    def torque(self) -> Array:
        """External torque (3,) about the centre of mass, Nm, world."""
        return self.numbers[..., TORQUE]

    @property
    def force(self) -> Array:
        """External force (3,), N, world."""
        return self.numbers[..., FORCE]

    @property
    def nis(self) -> Any:
        """Normalised innovation squared of the last measurement, a number; NaN where there was
        none.
        """
        nis = self.numbers[..., NIS]
        return nis if self.numbers.ndim > 1 else float(nis)

    @property
    def noise_scales(self) -> Array:
        """Noise of measured attitudes and positions (2,) as a multiple of the declared standard
        deviations, over some 200 poses; 1 at first (``estimator.recovery``).
        """
        return np.sqrt(1.0 + self.numbers[..., EXCESS])

    @property
    def noise_scale(self) -> Any:
        """Root mean square of the two ``noise_scales``, a number: 2 where poses are twice as noisy
        as declared.
        """
        scale = np.sqrt(1.0 + np.mean(self.numbers[..., EXCESS], axis=-1))
        return scale if self.numbers.ndim > 1 else float(scale)

    @property
    def status_code(self) -> Any:
        """Verdict on the last step's measurement, an index of ``STATUSES``."""
        code = self.numbers[..., STATUS]
        return code.astype(np.int64) if self.numbers.ndim > 1 else int(code)

    @property
    def status(self) -> Any:
        """The same as a word.

        "tracking": taken in; "coasting": no measurement, the estimate is a prediction, or held
        after a gap that leaves nothing to predict from; "rejected": refused by the gate;
        "restarted": pose and twist start anew at the measurement, after a gap or a contradiction
        (``estimator.recovery``).
        """
        code = self.status_code
        return [STATUSES[i] for i in code] if self.numbers.ndim > 1 else STATUSES[code]

    @property
    def restarts(self) -> Any:
        """How often the estimator restarted since its ``reset``, a whole number."""
        restarts = self.numbers[..., RESTARTS]
        return restarts.astype(np.int64) if self.numbers.ndim > 1 else int(restarts)
