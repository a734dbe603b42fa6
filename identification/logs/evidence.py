"""How well a flight agrees with each reading of its columns: one physics, one set of filters, one
rule.

Three balances hold in any flight, whatever small effects a vehicle's model lacks:

* the specific force points along the thrust axis: ``f_h = f_z d_h / d_z`` with ``f = a + g e3`` and
  the body's z axis ``d``.
* its vertical part follows the rotors' thrust: ``f_z = T d_z / m``.
* the rotors turn the body: ``J alpha + omega x J omega = tau``; without a vehicle, rotors on one
  side turn the body to the other.

Each balance leaves a share of the motion's variance unexplained, and shares make a likelihood: with
Gaussian residuals of unknown size, ``log L = -n/2 sum(log share)``. Undeclared effects last, so a
flight counts for few independent samples ``n``. A hover tells nothing: all shares are near 1. The
likeliest reading is taken, after a penalty on unusual ones.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..motion.signals import LONGEST_GAP, SHORTEST_PIECE
from ..motion.smoothing import (
    CUTOFFS,
    continuous,
    derivative,
    low_pass,
    resampled,
    turning,
    unbroken,
)
from .flight_log import FlightLog, SomeVehicle, excerpt
from .flight_phases import usual_thrust
from .log_map import UNITS, Attitude
from .readings import (
    DECLARED,
    OFFSET,
    ROTOR_READINGS,
    ROTORS,
    Convention,
    applied,
    as_written,
    log_readings,
)
from .table import Array, ArrayPair, Pair, Rows, SomeArray, finite_rows, lengths, median_step

# Filters, and when a reading is certain.
_FEWEST = 60  # samples in flight for a decision

# gains and delays (s) by undeclared effects
_FORCE_GAIN = (0.6, 1.6)
_TORQUE_GAIN = (0.4, 2.5)  # and of thrust in commands
# s: the motion comes up to 0.22 s behind the rotors' columns on measured flights, by motors, radio
# and filters on one clock
_STEP = 0.02
_DELAYS = tuple(_STEP * k for k in range(-5, 13))

_MOST_SHARE = 2.0  # larger shares count the same
GOOD = 0.5  # share: a reading below is believed
GOOD_TORQUE = 0.65  # the same of torques without a vehicle
_CERTAIN_LEAD = 3.4  # log-likelihood ratio over the next best: 30 to 1
_G = 9.81
# roll and pitch of rotors 1 to 4, whatever the vehicle
SIDES = np.array([[1.0, 1.0, -1.0, -1.0], [-1.0, 1.0, 1.0, -1.0]])


def likelihood(left: ArrayLike) -> Array:
    """Return the log-likelihoods (...), up to a constant, of shares (..., k) of one component
    each.
    """
    # no model leaves less than 1 %; a flight has at most 20 independent samples of one component
    return np.asarray(-10.0 * np.log(np.clip(left, 0.01, _MOST_SHARE)).sum(axis=-1))


def _shares(total: Array, power: Array, cross: Array, gain: Array | Pair) -> Array:
    """Return the shares of variances ``total`` (...) left by signals of variance ``power`` and
    covariance ``cross``, times a gain in range: ``gain`` (2, ...).
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # all of a zero variance is left
        factor = np.clip(cross / power, *gain)
        left = np.minimum(1.0 - factor * (2.0 * cross - factor * power) / total, _MOST_SHARE)
    return np.where((total > 0.0) & (power > 0.0), left, 1.0)


@dataclass(frozen=True)
class Fit:
    """Unexplained shares of variance by a reading, and its score."""

    reading: Any  # a Convention, or a SensorReading
    horizontal: float  # share of the horizontal specific force, or of the sensor's vector
    torque: float  # mean share of the torques about x, y and, with a vehicle, z
    score: float  # log-likelihood less the penalty on an unusual reading
    delay: float = 0.0  # s, the likeliest of the motion behind the rotors' columns
    vertical: float = 1.0  # share of the vertical specific force at this delay


class Evidence:
    """A flight's motion, ready to be compared with any reading of its columns.

    Args:
        t: (N,) s.
        thrusts: (N, 4) of the rotors' columns, in any unit growing with thrust.
        position: (N, 3) in the columns' unit; None: unknown.
        attitude: (N, 4) or (N, 3) as in the columns; None: unknown.
        gyro: (N, 3) rad/s, in the kit's body axes, without an attitude.
        along: (N,) m/s2, specific force along the body's z axis, without a pose.
        vehicle: as declared; ``thrusts`` are squared rotor speeds then. None: unknown.
        sides: (2, 4) roll and pitch of the kit's rotors, without a vehicle.
    """

    def __init__(
        self,
        t: Array,
        thrusts: Array,
        position: SomeArray = None,
        attitude: SomeArray = None,
        gyro: SomeArray = None,
        along: SomeArray = None,
        vehicle: SomeVehicle = None,
        sides: Array = SIDES,
    ) -> None:
        self._t, self._position, self.attitude = t, position, attitude
        self._gyro, self._along = gyro, np.zeros(len(t)) if along is None else along
        self._k, self._inertia, self._mixing = np.ones(4), np.eye(3), sides
        self._gains = [_TORQUE_GAIN, (0.0, np.inf), (0.0, np.inf)]  # of thrust, and of torques
        if vehicle is not None:
            self._k, self._inertia, self._mixing = vehicle.k, vehicle.inertia, vehicle.mixing[1:]
            self._gains = [_FORCE_GAIN, _TORQUE_GAIN, _TORQUE_GAIN, _TORQUE_GAIN]
        self._thrusts = thrusts
        if np.isfinite(thrusts).any():
            # more than 1.5 of the 99th percentile is a wrong reading of a sensor
            self._thrusts = np.minimum(thrusts, 1.5 * np.nanquantile(thrusts, 0.99))
        moving = [x for x in (t[:, None], position, attitude, gyro) if x is not None]
        self._compared = self._laid_out(np.flatnonzero(finite_rows(np.hstack(moving))))
        self.enough = len(self._compared) >= _FEWEST  # whether the flight is long enough
        self._motion, self._delayed = lru_cache(self._moving), lru_cache(2)(self._pushes)
        self._moved = lru_cache(2)(self._balances)

    @classmethod
    def of_log(cls, log: FlightLog, vehicle: SomeVehicle, by_imu: bool = False) -> "Evidence":
        """Return the evidence of a log: by its pose, or by its IMU."""
        squares = log.rotor_speeds**2
        if by_imu:
            assert log.accelerometer is not None
            force = log.accelerometer[:, 2]
            return cls(log.t, squares, gyro=log.gyro, along=force, vehicle=vehicle)
        position, quaternion = (
            np.where(log.valid[:, None], x, np.nan) for x in (log.position, log.quaternion)
        )
        return cls(log.t, squares, position, quaternion, vehicle=vehicle)

    def _laid_out(self, rows: Rows) -> Rows:
        """Lay the runs of known motion out on one even clock, 2 s apart. Return the samples
        in flight, far enough from the runs' ends for the filters.
        """
        step = median_step(self._t[rows]) if len(rows) > 1 else 0.0
        self._period = period = max(step, 0.005)
        known = finite_rows(self._thrusts)
        runs = [
            run
            for run in unbroken(self._t, rows, max(LONGEST_GAP, 3.5 * step), 8, SHORTEST_PIECE)
            if known[run[0] : run[-1] + 1].any()
        ]
        if not runs:
            return rows[:0]
        ends = np.array([self._t[run[[0, -1]]] for run in runs])
        before = np.append(0.0, (np.diff(ends)[:-1, 0] + 2.0).cumsum())
        laid = before[:, None] + ends - ends[:, :1]
        # of the rows; NaN outside the runs
        self._times = np.interp(self._t, ends.ravel(), laid.ravel(), left=np.nan, right=np.nan)
        self._clock = clock = np.arange(0.0, laid[-1, 1], period)
        self._ends = begin, end = laid[np.searchsorted(before, clock, "right") - 1].T
        total = self._slow(self._even(self._thrusts)) @ self._k
        aloft = total > 0.5 * usual_thrust(total[clock <= end])
        aloft &= (clock >= begin + 0.3) & (clock <= end - 0.3)  # the filters' start
        # 20 a second, at most 2000: of longer flights every second one, or third ...
        every = max(1, round(np.ceil(len(rows) * step * 20.0 / 2000) / (20.0 * period)))
        return np.flatnonzero(aloft & (np.arange(len(clock)) % every == 0))

    def _even(self, x: Array) -> Array:
        """Return columns (N, k) on the even clock, (m, k); NaN: there are none."""
        there = finite_rows(x) & np.isfinite(self._times)
        if not there.any():
            return np.full((len(self._clock), x.shape[1]), np.nan)
        return resampled(self._clock, self._times[there], x[there])

    def _slow(self, x: Array) -> Array:
        """Return columns (m, k), low-passed as a trajectory's motion is."""
        return low_pass(x, CUTOFFS.convention_hz, self._period)

    def _band(self, x: Array, rows: Rows | slice = slice(None)) -> Array:
        """Return columns (m, k) in the bands of roll and pitch and of yaw, (m, 2, k), some rows."""
        # Below 1 Hz, steady moments of the air are larger than the torques of turning; above 4 Hz
        # (of yaw, where rotors do least, 3 Hz), the pose's noise is
        low, high, yaw = (low_pass(x, hz, self._period)[rows] for hz in (1.0, 4.0, 3.0))
        return np.stack([high - low, yaw - low], axis=1)

    @cached_property
    def _place(self) -> ArrayPair:
        """Acceleration (n, 3) by s2, and median position (3,), in the columns' world and length."""
        assert self._position is not None
        place = self._even(self._position)
        second = derivative(low_pass(place, CUTOFFS.pose_hz, self._period), self._period, 2)
        return self._slow(second)[self._compared], np.median(place, axis=0)

    @cached_property
    def _driving(self) -> Array:
        """Thrusts (m, 10): four in the band of roll and pitch, four in the band of yaw, and the
        total, low-passed and raw. The total is in m/s2, with gravity as its median in flight.
        """
        thrusts = self._even(self._thrusts)
        total = thrusts @ self._k
        total *= _G / max(np.median(total[self._compared]), 1e-300)
        return np.column_stack([self._band(thrusts).reshape(-1, 8), self._slow(total), total])

    def _pushes(self, *delays: float) -> ArrayPair:
        """Return whether the samples compared, less each delay (d, n), lie within their run (1, or
        0), and thrusts. The thrusts (d, 9, n) are the first nine of ``_driving``, less their means;
        zero elsewhere.
        """
        at = self._clock[self._compared] - np.array(delays)[:, None]
        begin, end = (x[self._compared] for x in self._ends)
        within = ((at >= begin) & (at <= end)).astype(float)
        thrusts = resampled(at.ravel(), self._clock, self._driving[:, :9]).reshape(*at.shape, 9)
        means = within[:, None] @ thrusts / np.maximum(within.sum(axis=1), 1.0)[:, None, None]
        return within, np.swapaxes(within[..., None] * (thrusts - means), 1, 2)

    def _moving(self, attitude: Attitude) -> ArrayPair:
        """Return thrust and turns by one convention of the attitude. Thrust is specific, times the
        body's axes (n, 3, 3), in m/s2, in the world. Turns in two bands (n, 2, 15) are angular
        velocity, angular acceleration and products of the angular velocity.
        """
        if self.attitude is None:
            assert self._gyro is not None
            w = self._even(self._gyro)
            matrices = np.zeros((len(w), 3, 3))
        else:
            good, rotation = as_written(self.attitude, attitude)
            quaternion = np.full((len(good), 4), np.nan)
            quaternion[good] = continuous(rotation.as_quat(scalar_first=True))
            smooth = low_pass(self._even(quaternion), CUTOFFS.pose_hz, self._period)
            matrices, w = turning(smooth, self._period)
        axes = self._slow(self._driving[:, 9:] * matrices.reshape(-1, 9))
        products = np.einsum("ni,nj->nij", w, w).reshape(-1, 9)
        turns = np.column_stack([w, derivative(w, self._period), products])
        rows = self._compared
        return axes[rows].reshape(-1, 3, 3), self._band(turns, rows)

    def _needed(self, along: Array, reading: Convention) -> Array:
        """Return the force ``along`` the thrust axis (n,) above the torques in Nm of the motion, in
        the band of turning (4, n), less their means. Without a vehicle, angular accelerations stand
        for torques.
        """
        # a pseudovector: a mirrored body frame turns its sign as well
        body = reading.frames.body
        turn = reading.gyro.turn @ body.T * np.linalg.det(body)
        driven = self._inertia @ turn
        products = np.cross(turn[:, None, :], driven[:, :, None], axis=0).reshape(3, 9)
        each, columns = np.hstack([driven, products]), self._motion(reading.attitude)[1][..., 3:]
        needed = np.vstack([along, each[:2] @ columns[:, 0].T, each[2] @ columns[:, 1].T])
        needed -= needed.mean(axis=1, keepdims=True)
        return needed

    def _balances(self, *moves: Any) -> tuple[float, float, Array]:
        """Return the terms of a reading without rotors. They are the unexplained share of the
        horizontal force, the penalty on the flight's place (log-likelihood ratio), and ``_needed``.
        """
        reading = Convention(*moves)
        if self.attitude is None:
            felt = self._slow(self._even(self._along[:, None]))[self._compared]
            return 0.0, 0.0, self._needed(felt[:, 0], reading)
        frames, axes = reading.frames, self._motion(reading.attitude)[0]
        push = axes @ frames.body[:, 2] @ frames.world.T
        acceleration, middle = self._place
        force = acceleration @ frames.position.T * UNITS["position"][reading.length]
        force += np.array([0.0, 0.0, _G])
        needed, given = (np.ravel(x[:, :2] - x[:, :2].mean(axis=0)) for x in (force, push))
        mean = push.mean(axis=0)
        along = (force * push).sum(axis=1) / np.maximum(lengths(push), 1e-9)
        # log-likelihood ratios against a flight on its side, and below its origin
        cost = 60.0 * (mean[2] <= GOOD * np.linalg.norm(mean))
        cost += 3.0 * ((frames.position @ middle)[2] < 0.0)
        left = _shares(needed @ needed, given @ given, needed @ given, _FORCE_GAIN)
        return float(left), cost, self._needed(along, reading)

    def fit(self, reading: Convention, torques: bool = True) -> Fit:
        """Return how well a reading explains the flight; without torques, by forces alone. A flight
        too short for a decision leaves all of its motion.
        """
        if not self.enough:
            return Fit(reading, 1.0, 1.0, -reading.unlikely)
        if torques:
            return self._fit(reading, self._mixing, *(delay - reading.late for delay in _DELAYS))
        return self._fit(reading, self._mixing[:0], 0.0)

    def late(self, reading: Convention = DECLARED) -> Fit:
        """Return the fit of a reading at the likeliest delay of the rotors beyond a flight loop's
        own.
        """
        far = np.arange(-5.0, 5.0, _STEP)
        parts = np.array_split(far[(far < _DELAYS[0]) | (far > _DELAYS[-1] + _STEP)], 20)
        reading = replace(reading, unlikely=reading.unlikely + OFFSET)
        fits = (self._fit(reading, self._mixing, *part.tolist()) for part in parts)
        fit = max(fits, key=attrgetter("score"))
        return replace(fit, reading=replace(reading, late=-fit.delay))

    def _fit(self, reading: Convention, mixing: Array, *delays: float) -> Fit:
        """Return the fit of a reading at the likeliest delay in s."""
        rows = np.zeros((1 + len(mixing), 9))  # what drives: all together along, and each torque
        rows[0, 8] = 1.0
        torques = mixing[:, np.subtract(reading.rotors, 1)]
        rows[1:3, :4] = torques[:2]
        rows[3:, 4:8] = -torques[2:] if reading.mirrored else torques[2:]
        horizontal, cost, needed = self._moved(*reading.moves)
        needed = needed[: len(rows)]
        there, thrusts = self._delayed(*delays)
        given = rows @ thrusts
        left = _shares(  # (d, 1 + torques)
            there @ (needed**2).T,
            (given * given).sum(axis=2),
            (given * needed).sum(axis=2),
            np.transpose(self._gains[: len(rows)]),
        )
        left[there.sum(axis=1) < _FEWEST] = _MOST_SHARE
        best = likelihood(left).argmax()
        score = likelihood([horizontal, horizontal, *left[best]]) - cost - reading.unlikely
        torque = left[best, 1:].mean() if len(mixing) else 1.0
        return Fit(reading, horizontal, torque, float(score), delays[best], left[best, 0])

    def turns(self, reading: Convention) -> float:
        """Return the root mean square of roll and pitch rates in the band of turning, rad/s."""
        return float(np.sqrt((self._motion(reading.attitude)[1][:, 0, :2] ** 2).mean()))


class RankedFits:
    """Fits of readings, the likeliest first.

    Args:
        fits: at least one. Equally likely ones keep their order.
        left: words for the unexplained share.
    """

    def __init__(
        self, fits: Iterable[Fit], left: str = "horizontal acceleration is not due to the tilt"
    ) -> None:
        self.ranked = sorted(fits, key=lambda fit: -fit.score)
        self.left = left
        self.fit = self.ranked[0]
        self.best = self.fit.reading

    def other(self, name: str) -> tuple[object, float]:
        """Return the next best value of a property, and the log-likelihood ratio of the best over
        the next. The ratio is 0 where the flight tells nothing, infinite without another value.
        """
        tells = self.fit.horizontal <= GOOD
        value_of = attrgetter(name)
        for fit in self.ranked:
            if (value := value_of(fit.reading)) != value_of(self.best):
                return value, self.fit.score - fit.score if tells else 0.0
        return None, np.inf if tells else 0.0

    def certain(self, *names: str) -> bool:
        """Return whether every other value of properties explains the flight clearly less."""
        return all(self.other(name)[1] >= _CERTAIN_LEAD for name in names)

    def departures(self) -> list[Convention]:
        """Return the readings of a log that explain it better than its declaration."""
        is_good = self.fit.torque <= GOOD_TORQUE
        if self.best.moves[:3] != DECLARED.moves[:3]:  # another pose: forces tell, not torques
            is_good = self.fit.horizontal <= GOOD
        # thrust alone shows a delay: the best of some 500 delays leaves .3 of the vertical force by
        # chance where a flight repeats its path
        if self.best.late and self.fit.vertical < 0.1:
            is_good = True
        if self.best is DECLARED or not is_good:
            return []
        return [
            fit.reading
            for fit in self.ranked
            if fit.score >= self.fit.score - _CERTAIN_LEAD and fit.reading is not DECLARED
        ]

    def says(self, name: str) -> tuple[Any, bool, str]:
        """Return the best value of a property, whether it is certain, and why."""
        other, lead = self.other(name)
        why = f"{self.fit.horizontal:.0%} of the {self.left}"
        if other is not None and lead > 0.0:
            why += f"; the log likelihood of {other} is {lead:.3g} lower"
        return attrgetter(name)(self.best), self.certain(name), why


def log_ranking(evidence: Evidence) -> RankedFits:
    """Return the ranking of the readings of the kit's own columns, and of a delay of the rotors."""
    fits = [evidence.fit(reading) for reading in log_readings(evidence.attitude is not None)]
    return RankedFits([*fits, evidence.late()] if evidence.enough else fits)


def remedies(
    log: FlightLog, vehicle: SomeVehicle, by_imu: bool = False
) -> tuple[list[Convention], bool]:
    """Return the equally good readings of a contradictory log, and whether each of them, applied,
    leaves a consistent log. No reading: the log is consistent as declared.

    Args:
        log: the flight.
        vehicle: as declared; None: unknown.
        by_imu: the motion is the gyro's and the accelerometer's, else the pose's.
    """

    def mends(reading: Convention) -> bool:
        spins = vehicle
        if vehicle is not None and reading.mirrored:
            spins = replace(vehicle, spin=-vehicle.spin)
        return log_ranking(Evidence.of_log(applied(log, reading), spins, by_imu)).best is DECLARED

    log = excerpt(log)
    evidence = Evidence.of_log(log, vehicle, by_imu)
    ranking = log_ranking(evidence)
    if not ranking.departures():
        return [], True
    fits = [*ranking.ranked]
    # six readings, each with a second one behind
    for one in (fit.reading for fit in ranking.ranked[:6] if fit.reading is not DECLARED):
        if not one.late:
            fits.append(evidence.late(one))
        if one.rotors == ROTORS and not one.mirrored:
            fits += [
                evidence.fit(
                    replace(
                        one,
                        rotors=other.rotors,
                        mirrored=other.mirrored,
                        unlikely=one.unlikely + other.unlikely,
                    )
                )
                for other in ROTOR_READINGS
            ]
    alike = RankedFits(fits).departures()[:3] or ranking.departures()[:1]
    mending = [reading for reading in alike if mends(reading)]
    return mending or alike[:1], bool(mending)
