"""The filter on a stream of rows: `windwrench estimate`, one row at a time.

A later row carries the filter to its time, in the same steps as offline, and corrects the filter
there. A row in the past is fused at its time, by the filter with a clock
(``estimator.late_poses``). The first rows are held back until their median step is known: this step
is the filter's period, and the tuning is scaled by the period.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..estimator import TimedFilter, UKFTuning, WrenchEstimate, WrenchUKF
from ..estimator.estimate import RESTARTED, STATUS, TRACKING
from ..estimator.row_steps import steps_between
from ..estimator.tuning import PERIOD
from ..identification.wrench_series import GATE
from ..runtime.arrays import Array
from .messages import Row
from .tallies import Tallies

_FIRST_ROWS = 21  # their median step is the period
_FIRST_SECONDS = 1.0  # enough of a slow source
_STARTUP = 1.0  # s after a start or restart: innovations do not count


@dataclass(frozen=True)
class LiveSettings:
    """Settings of the filter, and limits of the stream."""

    gate: float | None = GATE  # as for a log
    horizon: float = 0.3  # s, largest age of a row
    rate_hz: float | None = None  # rate of rows, if known; then no row waits
    wait: float = 10.0  # s until the first estimate; 0: for ever
    seconds: float | None = None  # s, length of the stream
    tuning: UKFTuning | None = None  # for steps of 5 ms; default: the vehicle's


@dataclass(slots=True)
class Output:
    """An estimate, and its row."""

    row: Row
    t: float  # s, stream's time, of the estimate
    estimate: WrenchEstimate
    std: Array  # (6,) force, N, and torque, Nm, from noise and the vehicle's uncertainty

    @property
    def wrench(self) -> Array:
        """External force, N, and torque, Nm, (6,), world."""
        return np.concatenate([self.estimate.force, self.estimate.torque])


class LiveFilter:
    """The external wrench, row by row.

    Args:
        vehicle: the declared vehicle.
        tallies: counts late, refused and left-out rows.
        settings: the filter's.
    """

    def __init__(
        self, vehicle: Vehicle, tallies: Tallies, settings: LiveSettings | None = None
    ) -> None:
        self.vehicle = vehicle
        self.settings = settings or LiveSettings()
        self._tallies = tallies
        self._held: list[Row] = []
        self._timed: TimedFilter | None = None
        self._before: Row | None = None
        self.period = math.nan  # s
        self._settled = math.inf  # s, when the filter's start is over
        if self.settings.rate_hz is not None:
            self._start(1.0 / self.settings.rate_hz)

    @property
    def restarts(self) -> int:
        """Restarts of the filter."""
        return 0 if self._timed is None else self._timed.estimate.restarts

    @property
    def tuning(self) -> UKFTuning | None:
        """The filter's tuning, in its period; None: before the start."""
        return None if self._timed is None else self._timed.ukf.tuning

    def take(self, row: Row) -> list[Output]:
        """Return the estimates after a row: none while rows are held back, then one each."""
        if self._timed is None:
            self._held.append(row)
            long = row.t - self._held[0].t > _FIRST_SECONDS and len(self._held) > 2
            if len(self._held) < _FIRST_ROWS and not long:
                return []
            return self.begin()
        return self._process(row)

    def begin(self) -> list[Output]:
        """Begin with the rows held back, however few; return their estimates."""
        if self._timed is not None or len(self._held) < 2:
            return []
        held = sorted(self._held, key=lambda row: row.t)
        self._held = []
        steps = np.diff([row.t for row in held])
        self._start(float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.005)
        return [output for row in held for output in self._process(row)]

    def _start(self, period: float) -> None:
        self.period = period
        stated_tuning = self.settings.tuning
        tuning = None if stated_tuning is None else stated_tuning.scaled(PERIOD, period)
        ukf = WrenchUKF(self.vehicle, tuning, period, self.settings.gate)
        self._white = ukf.record["innovation"][0]  # the last pose's, whitened
        commanded = WrenchUKF(replace(self.vehicle, omega_source="commanded"), tuning, period)
        # uncertainty of the vehicle with measured rotor speeds, and with commanded ones
        self._uncertain = tuple(one.record["uncertain"][0].copy() for one in (ukf, commanded))
        self._timed = TimedFilter(ukf, self.settings.horizon)

    def _process(self, row: Row) -> list[Output]:
        timed = self._timed
        assert timed is not None
        if math.isnan(timed.time):
            if row.position is None or row.quaternion is None:
                return []
            timed.reset(row.t, row.position, row.quaternion)
            self._before = row
            self._settled = row.t + _STARTUP
            return [self._output(row, timed.estimate)]
        now = timed.time
        if round(row.t, 9) > now:
            return [self._output(row, self._carry(timed, row, now))]
        late = round(row.t, 9) < now
        estimate = self._correct(timed, row)
        if estimate is None:
            if late and (row.has_pose or row.gyro is not None):
                self._tallies.counts["too late"] += 1
            return []
        if late:
            self._tallies.counts["late"] += 1
        return [self._output(row, estimate)]

    def _carry(self, timed: TimedFilter, row: Row, now: float) -> WrenchEstimate:
        """Carry the filter to a row's time, and correct there."""
        before = self._before
        assert before is not None
        timed.ukf.record["uncertain"][0] = self._uncertain[row.commanded]
        speeds = 0.5 * (before.rotor_speeds + row.rotor_speeds)
        voltage = None
        if before.voltage is not None and row.voltage is not None:
            voltage = 0.5 * (before.voltage + row.voltage)
        steps = steps_between(row.t - now, self.period)
        for step in steps[:-1]:
            now += step
            timed.predict(now, speeds, voltage)
        estimate = timed.predict(row.t, speeds, voltage)
        self._before = row
        estimate = self._correct(timed, row) or estimate
        status = estimate.numbers[STATUS]  # a pose tests the tuning
        if row.has_pose and status == RESTARTED:
            self._settled = row.t + _STARTUP
        elif row.has_pose and status == TRACKING and row.t > self._settled:
            self._tallies.consistency.add(row.t, self._white)
        return estimate

    @staticmethod
    def _correct(timed: TimedFilter, row: Row) -> WrenchEstimate | None:
        """Fuse a row's measurements at its time; None: there are none, or too late."""
        estimate = None
        if row.has_imu:
            estimate = timed.correct_imu(row.t, row.gyro, row.accelerometer)
        if row.has_pose:
            estimate = timed.correct(row.t, row.position, row.quaternion)
        return estimate

    def _output(self, row: Row, estimate: WrenchEstimate) -> Output:
        assert self._timed is not None
        std = np.roll(estimate.std_wrench, 3)  # from torque and force
        if row.has_pose and estimate.status == "rejected":
            self._tallies.counts["refused"] += 1
        return Output(row, self._timed.time, estimate, std)
