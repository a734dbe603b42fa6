"""The fixed-lag smoother: for streams, the wrench a little ago from all that was seen since."""

import math

import numpy as np
from numpy.typing import ArrayLike

from ..runtime.compiled import compiled
from ..runtime.errors import InputError
from .estimate import STATE_SIZE, Array, WrenchEstimate
from .filter_record import N
from .rauch_tung_striebel import LINK, WORK, step_back, step_with_link
from .ukf import WrenchUKF


class FixedLagSmoother:
    """A ``WrenchUKF`` whose steps return the estimate ``lag`` s ago, given all data up to now.

    It is what the fixed-interval smoother says of that time on a log that ends now. ``reset`` and
    ``step`` are those of the filter; the filter itself goes on in ``ukf``, whose ``estimate`` is
    the undelayed one. In the first ``lag`` s after a reset the estimate is that of the reset's
    time: ``delay`` says how old it is.

    A step costs about 30 us and 5.5 us for each step of lag more (0.3 s at 200 Hz: 0.36 ms): the
    whole window is gone through each time, so no error gathers.

    Args:
        ukf: the filter; between resets it must be stepped through this object alone.
        lag: s, rounded to whole periods. Beyond the filter's rise time more lag gains little.

    Raises:
        InputError: not a ``WrenchUKF`` itself, or a lag that is not positive or above 20,000
            periods.
    """

    def __init__(self, ukf: WrenchUKF, lag: float = 0.3) -> None:
        if type(ukf) is not WrenchUKF:
            raise InputError(f"FixedLagSmoother: expected a WrenchUKF, got {type(ukf).__name__}")
        steps = lag / ukf.period if isinstance(lag, (int, float)) else math.nan
        if not 0.5 <= steps <= _LONGEST:
            raise InputError(
                f"FixedLagSmoother: lag must lie between half a period and {_LONGEST} periods of "
                f"{ukf.period:g} s, got {lag!r}"
            )
        self.ukf = ukf
        self._links = np.zeros(round(steps) + 1, dtype=LINK)  # a ring
        self._steps = 0  # since the reset
        self._work = np.empty(WORK)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.lag:g} s: {self.ukf!r}>"

    @property
    def lag(self) -> float:
        """How old an estimate is, s, once that much time has passed since the reset."""
        return (len(self._links) - 1) * self.ukf.period

    @property
    def delay(self) -> float:
        """How old the last estimate is, s."""
        return min(self._steps, len(self._links) - 1) * self.ukf.period

    def reset(
        self,
        position: ArrayLike,
        quaternion: ArrayLike,
        covariance: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Start at a pose, as ``WrenchUKF.reset``; what was before is forgotten."""
        self.ukf.reset(position, quaternion, covariance, velocity, angular_velocity)
        self._steps = 0
        self._links["x"][0] = self.ukf.record["x"][0]

    def step(
        self,
        rotor_speeds: ArrayLike,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        voltage: float | None = None,
    ) -> WrenchEstimate:
        """Step the filter as ``WrenchUKF.step`` does; return the smoothed estimate ``delay`` s ago.

        Its ``nis`` is that of the measurement at its own time.

        Raises:
            InputError: as of ``WrenchUKF.step``; nothing has changed then.
        """
        ukf = self.ukf
        parts = ukf._sample.read(rotor_speeds, position, quaternion)
        numbers = np.empty(STATE_SIZE + N * N)
        arguments = (
            ukf.record,
            parts,
            ukf.period,
            ukf.vehicle.voltage_ref if voltage is None else float(voltage),
            self._links,
            self._steps,
            self._work,
            numbers[:STATE_SIZE],
            numbers[STATE_SIZE:].reshape(N, N),
        )
        if _step(*arguments) < 0:
            raise ukf._sample.bad_quaternion()
        self._steps += 1
        return WrenchEstimate(numbers)


_LONGEST = 20_000  # periods of lag: 170 MB


@compiled
def _step(
    record: np.ndarray,
    parts: int,
    dt: float,
    voltage: float,
    links: np.ndarray,
    steps: int,
    work: Array,
    x: Array,
    P: Array,
) -> int:
    """Step the filter for the ``steps + 1``-th time; write the smoothed state and covariance."""
    f, size = record[0], len(links)
    usable: int = step_with_link(f, f.z, parts, dt, voltage, links[(steps + 1) % size], work)
    if usable < 0:
        return usable
    for i in range(STATE_SIZE):
        x[i] = f.x[i]
    for i in range(N):
        for j in range(N):
            P[i, j] = f.P[i, j]
    for k in range(min(steps + 1, size - 1)):
        now = steps + 1 - k
        step_back(x, P, links[now % size], links[(now - 1) % size].x, work)
    return usable
