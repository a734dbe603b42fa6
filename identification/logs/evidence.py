"""How well a flight agrees with each reading of its columns: one physics, one set of filters, one
set of thresholds.

Three balances hold in any flight, whatever small effects a vehicle's model lacks:

* the specific force points along the thrust axis: ``f_h = f_z d_h / d_z`` with ``f = a + g e3`` and
  the body's z axis ``d``;
* its vertical part follows the rotors' thrust: ``f_z = T d_z / m``;
* the rotors turn the body: ``J alpha + omega x J omega = tau``; without a vehicle, rotors on one
  side turn it over to the other.

Each balance leaves a share of the motion's variance unexplained, and shares make a likelihood: with
Gaussian residuals of unknown size, ``log L = -n/2 sum(log share)``. Undeclared effects last, so a
flight counts for few independent samples ``n``. A hover tells nothing: all shares are near 1.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import CUTOFFS, continuous, derivative, low_pass, resampled, unbroken
from .flight_log import FlightLog
from .log_map import LENGTH_UNITS
from .readings import (
    AS_DECLARED,
    DECLARED,
    Reading,
    as_written,
    gyro_readings,
    pose_readings,
    rotor_readings,
)

Array = NDArray[np.float64]
Rows = NDArray[np.intp]


@dataclass(frozen=True)
class EvidenceSettings:
    """Filters, and when a reading is certain."""

    # Hz, of the angular acceleration: from, to, and to of yaw, where rotors do least. Below, steady
    # moments of the air are larger than what turns the body; above, noise of the pose is
    turn_hz: tuple[float, float, float] = (1.0, 4.0, 3.0)
    rate_hz: float = 20.0  # of the samples compared
    period: float = 0.005  # s, the shortest of the clock of the filters
    edge: float = 0.3  # s at either end of a piece, where filters start
    gap: float = 0.1  # s (or 3.5 periods) without a sample, which end a piece
    shortest: float = 3.0  # s of a piece
    fewest: int = 60  # samples in flight that decide something
    flying: float = 0.5  # of the median thrust: less is take-off, landing or ground

    # what undeclared effects may make of a gain, of a delay (s) and of the vertical (cosine)
    force_gain: tuple[float, float] = (0.6, 1.6)
    torque_gain: tuple[float, float] = (0.4, 2.5)  # and of thrust in commands
    most_thrust: float = 1.5  # of its 99th percentile: more is a wrong reading of a sensor
    delays: tuple[float, ...] = tuple(0.02 * k for k in range(-5, 6))
    upright: float = 0.9
    not_upright: float = 0.77

    samples: float = 20.0  # independent samples of one component that a flight counts for, at most
    least_share: float = 0.01  # a smaller share says no more: no model is better
    most_share: float = 2.0  # a larger share says no more
    unusual: float = 1.0  # log-likelihood ratio that a reading must make up for being less usual
    below: float = 3.0  # the same for a flight below its origin
    good: float = 0.5  # share up to which a reading is believed, and from which on it is not
    good_torque: float = 0.65  # the same of torques without a vehicle, and of shifted rotors
    certain: float = 3.4  # log-likelihood ratio over the next best: 30 to 1
    refused: float = 8.0  # the same over the reading as declared, which is right far more often
    shifted: float = 16.0  # the same of one in 200 time offsets
    decisive: float = 30.0  # the same, where the reading as declared is not bad by itself
    some: float = 0.2  # share from which undeclared effects may be all that is wrong
    contradicts: float = 1.15  # share of one torque alone that contradicts, be the two others right
    upside_down: float = 1.0  # share of the vertical force alone: more than there was
    worse: float = 0.15  # share by which a reading may be worse in another balance
    says_nothing: float = 0.8  # a share beyond as declared cannot be made worse: commanded rotors
    # rad/s of roll and pitch in the band of turning: in hovers (0.03 in a simulated one) rotors
    # answer disturbances more than they turn the body, and the mirrored order may explain more
    turning: float = 0.06

    longest_shift: float = 2.0  # s, of rotor speeds against the motion
    shift_step: float = 0.02  # s
    longest_delay: float = 0.1  # s, of motors and radio


EVIDENCE = EvidenceSettings()
_G = 9.81
# roll and pitch of rotors 1 to 4, whatever the vehicle
_SIDES = np.array([[1.0, 1.0, -1.0, -1.0], [-1.0, 1.0, 1.0, -1.0]])


@dataclass(frozen=True)
class Fit:
    """Shares of variance that a reading leaves unexplained, and whether it flies upright."""

    horizontal: float  # of the specific force
    vertical: float
    torques: tuple[float, ...]  # about x, y and, with a vehicle, z
    upright: float  # cosine of the mean thrust's angle from the vertical

    @property
    def torque(self) -> float:
        """Mean share of the torques."""
        return float(np.mean(self.torques)) if self.torques else 1.0

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the likelihood, up to a constant."""
        shares = np.array([self.horizontal, self.horizontal, self.vertical, *self.torques])
        left = np.clip(shares, EVIDENCE.least_share, EVIDENCE.most_share)
        fallen = 0.0 if self.upright > EVIDENCE.good else 2.0 * EVIDENCE.decisive
        return -0.5 * EVIDENCE.samples * float(np.log(left).sum()) - fallen


def share(needed: Array, given: Array, gain: tuple[float, float]) -> float:
    """Return the share of the variance of ``needed`` (n, m) that ``given`` (n, m), times a gain in
    range, leaves.
    """
    needed, given = needed - needed.mean(axis=0), given - given.mean(axis=0)
    total, power = float(np.sum(needed * needed)), float(np.sum(given * given))
    if not (total > 0.0 and power > 0.0):
        return 1.0
    factor = float(np.clip(np.sum(needed * given) / power, *gain))
    return min(float(np.sum(np.square(needed - factor * given))) / total, EVIDENCE.most_share)


def ratio(other: float, best: float, components: int) -> float:
    """Return the log-likelihood ratio of two shares of the same components."""
    least = EVIDENCE.least_share
    return 0.5 * EVIDENCE.samples * components * float(np.log(max(other, least) / max(best, least)))


@dataclass(frozen=True, eq=False)
class _Piece:
    """An unbroken piece: its rows, its clock (m,) in s, and the samples compared."""

    rows: Rows
    t: Array
    period: float
    compared: Rows

    def even(self, t: Array, values: Array) -> Array:
        """Return columns (m, k) on the piece's clock, also of rows between those of the piece; NaN
        where there are none.
        """
        inside = slice(self.rows[0], self.rows[-1] + 1)
        x, at = values[inside], t[inside]
        there = np.isfinite(x).all(axis=1) & np.isfinite(at)
        if not there.any():
            return np.full((len(self.t), x.shape[1]), np.nan)
        return resampled(self.t, at[there], x[there])


@dataclass(frozen=True, eq=False)
class _Turning:
    """Motion by one way to turn the attitude's columns into rotations."""

    frame: Array  # (n, 3, 3) body to world times specific thrust, m/s2, at the samples compared
    rates: Sequence[Array]  # per piece (m, 3) rad/s, body
    inverse: Sequence[Array]  # per piece (m, 3) the same of the inverse rotation


class Evidence:
    """A flight's motion, ready to be compared with any reading of its columns.

    Args:
        t: (N,) s.
        thrusts: (N, 4) of the rotors' columns, in any unit that grows with thrust; None: unknown.
        position: (N, 3) in the columns' unit; None: unknown.
        attitude: (N, 4) or (N, 3) as in the columns; None: unknown.
        gyro: (N, 3) rad/s, in the kit's body axes; turns are told from it where it is there.
        along: (N,) m/s2, specific force along the body's z axis, where no pose tells it.
        vehicle: as declared; ``thrusts`` are squared rotor speeds then. None: unknown.
    """

    def __init__(
        self,
        t: Array,
        thrusts: Array | None,
        position: Array | None = None,
        attitude: Array | None = None,
        gyro: Array | None = None,
        along: Array | None = None,
        vehicle: Vehicle | None = None,
    ) -> None:
        self._t, self._vehicle = t, vehicle
        self._position, self._attitude = position, attitude
        self._gyro, self._along = gyro, along
        self._thrusts = thrusts
        if thrusts is not None and np.isfinite(thrusts).any():
            most = EVIDENCE.most_thrust * float(np.nanquantile(thrusts, 0.99))
            self._thrusts = np.minimum(thrusts, most)
        self._k = np.ones(4) if vehicle is None else vehicle.k
        self._turnings: dict[object, _Turning] = {}
        self._needed: dict[object, Array] = {}
        self._torques: dict[object, tuple[float, ...]] = {}
        known = [x for x in (position, attitude) if x is not None]
        moving = known or [x for x in (gyro,) if x is not None]
        there = np.isfinite(t) & np.all([np.isfinite(x).all(axis=1) for x in moving], axis=0)
        self._pieces = self._cut(np.flatnonzero(there))

    @classmethod
    def of_log(cls, log: FlightLog, vehicle: Vehicle, by_imu: bool = False) -> "Evidence":
        """Return the evidence of a log: of its pose, or of its IMU."""
        squares = np.square(log.rotor_speeds)
        if by_imu:
            assert log.gyro is not None
            assert log.accelerometer is not None
            force = log.accelerometer[:, 2]
            return cls(log.t, squares, gyro=log.gyro, along=force, vehicle=vehicle)
        position, quaternion = (
            np.where(log.valid[:, None], x, np.nan) for x in (log.position, log.quaternion)
        )
        return cls(log.t, squares, position, quaternion, vehicle=vehicle)

    def _cut(self, rows: Rows) -> list[_Piece]:
        """Return the pieces in which the motion is known, and of each which samples fly."""
        if len(rows) < 2:
            return []
        step = float(np.median(np.diff(self._t[rows])))
        period = max(step, EVIDENCE.period)
        pieces = []
        for part in unbroken(self._t, rows, max(EVIDENCE.gap, 3.5 * step)):
            begin, end = self._t[part[0]], self._t[part[-1]]
            if end - begin > EVIDENCE.shortest and len(part) > 8:
                t = np.arange(begin, end, period)
                edge, every = round(EVIDENCE.edge / period), 1.0 / (EVIDENCE.rate_hz * period)
                compared = np.arange(edge, len(t) - edge, max(1, round(every)))
                pieces.append(_Piece(part, t, period, compared))
        if self._thrusts is None or not pieces:
            return pieces
        totals = [
            low_pass(p.even(self._t, self._thrusts), CUTOFFS.convention_hz, p.period) @ self._k
            for p in pieces
        ]
        total = np.nan_to_num(np.concatenate(totals))
        turning = total[total > 0.1 * float(np.quantile(total, 0.9))]
        least = EVIDENCE.flying * float(np.median(turning)) if turning.size else np.inf
        return [
            replace(p, compared=p.compared[x[p.compared] > least])
            for p, x in zip(pieces, totals, strict=True)
            if np.isfinite(x).all()
        ]

    @property
    def has_pose(self) -> bool:
        """Whether the motion is that of a pose."""
        return self._attitude is not None

    @property
    def samples(self) -> int:
        """Number of samples in flight."""
        return sum(len(p.compared) for p in self._pieces)

    @property
    def enough(self) -> bool:
        """Whether the flight is long enough to decide something."""
        return self.samples >= EVIDENCE.fewest

    def _at(self, values: Callable[[_Piece], Array]) -> Array:
        """Return values on the pieces' clocks, low-passed, at the samples compared."""
        hz = CUTOFFS.convention_hz
        return np.concatenate([low_pass(values(p), hz, p.period)[p.compared] for p in self._pieces])

    @cached_property
    def _acceleration(self) -> Array:
        """Acceleration (n, 3) in the columns' world and unit of length, by s2."""
        position = self._position
        assert position is not None

        def second(p: _Piece) -> Array:
            smooth = low_pass(p.even(self._t, position), CUTOFFS.pose_hz, p.period)
            return derivative(smooth, p.period, 2)

        return self._at(second)

    @cached_property
    def _middle(self) -> Array:
        """Median position (3,) in the columns' world and unit."""
        assert self._position is not None
        rows = np.concatenate([p.rows for p in self._pieces])
        return np.asarray(np.median(self._position[rows], axis=0))

    def score(self, reading: Reading, fit: Fit) -> float:
        """Return a fit's log-likelihood less what is unusual: of the reading, of its height."""
        placed = self._position is not None
        below = placed and (reading.frames.position @ self._middle)[2] < 0.0
        unusual = EVIDENCE.unusual * reading.unusual + EVIDENCE.below * below
        return fit.log_likelihood - float(unusual)

    @cached_property
    def _specific(self) -> list[Array]:
        """Specific thrust (m,) of each piece in m/s2; the median of all is scaled to gravity."""
        thrusts = self._thrusts
        if thrusts is None:
            return [np.full(len(p.t), _G) for p in self._pieces]
        totals = [p.even(self._t, thrusts) @ self._k for p in self._pieces]
        flown = [x[p.compared] for x, p in zip(totals, self._pieces, strict=True)]
        level = float(np.median(np.concatenate(flown)))
        return [x * (_G / max(level, 1e-300)) for x in totals]

    def _turning(self, reading: Reading) -> _Turning:
        """Return the motion by a reading's way to turn columns into rotations."""
        if reading.attitude not in self._turnings:
            self._turnings[reading.attitude] = self._turned(reading)
        return self._turnings[reading.attitude]

    def _turned(self, reading: Reading) -> _Turning:
        assert self._attitude is not None
        good, rotation = as_written(self._attitude, reading)
        quaternion = np.full((len(good), 4), np.nan)
        quaternion[good] = continuous(rotation.as_quat(scalar_first=True))
        frames, rates, inverse = [], [], []
        for p, thrust in zip(self._pieces, self._specific, strict=True):
            q = low_pass(p.even(self._t, quaternion), CUTOFFS.pose_hz, p.period)
            q /= np.linalg.norm(q, axis=1, keepdims=True)
            matrices = Rotation.from_quat(q, scalar_first=True).as_matrix()
            dq = derivative(q, p.period)
            w, v, dw, dv = q[:, :1], q[:, 1:], dq[:, :1], dq[:, 1:]
            rates.append(2.0 * (w * dv - dw * v - np.cross(v, dv)))
            inverse.append(-np.einsum("nij,nj->ni", matrices, rates[-1]))
            pushed = thrust[:, None] * matrices.reshape(-1, 9)
            smooth = low_pass(pushed, CUTOFFS.convention_hz, p.period)
            frames.append(smooth[p.compared].reshape(-1, 3, 3))
        return _Turning(np.concatenate(frames), rates, inverse)

    def _push(self, reading: Reading) -> Array:
        """Return the specific thrust (n, 3) in m/s2 and the kit's world."""
        frame = self._turning(reading).frame
        if reading.sense == "world_to_body":
            frame = frame.transpose(0, 2, 1)
        push: Array = np.einsum(
            "ij,njk,k->ni", reading.frames.world, frame, reading.frames.body[:, 2]
        )
        return push

    def _force(self, reading: Reading) -> Array:
        """Return the specific force (n, 3) in m/s2 and the kit's world."""
        scale = LENGTH_UNITS[reading.length]
        force: Array = self._acceleration @ reading.frames.position.T * scale + [0.0, 0.0, _G]
        return force

    def fit(self, reading: Reading, torques: bool = True) -> Fit:
        """Return how well a reading explains the flight; without an attitude, by torques alone."""
        if self._attitude is None:
            return Fit(0.0, 0.0, self.torques(reading), 1.0)
        push, force = self._push(reading), self._force(reading)
        mean = push.mean(axis=0)
        vertical = EVIDENCE.torque_gain if self._vehicle is None else EVIDENCE.force_gain
        return Fit(
            share(force[:, :2], push[:, :2], EVIDENCE.force_gain),
            share(force[:, 2:], push[:, 2:], vertical),
            self.torques(reading) if torques and self._thrusts is not None else (),
            float(mean[2] / max(float(np.linalg.norm(mean)), 1e-9)),
        )

    def _rates(self, reading: Reading) -> Sequence[Array]:
        """Return the angular velocity of each piece, (m, 3) rad/s, in the kit's body axes."""
        gyro = self._gyro
        if gyro is not None:
            return [p.even(self._t, gyro) for p in self._pieces]
        turning = self._turning(reading)
        # a pseudovector: a mirrored body frame turns its sign as well
        turn = reading.frames.body * np.linalg.det(reading.frames.body)
        rates = turning.inverse if reading.sense == "world_to_body" else turning.rates
        return [x @ turn for x in rates]

    def _band(self, x: Array, period: float) -> Array:
        """Return columns (m, k) in the band of turning; the third (yaw) has a band of its own."""
        low, high, yaw = EVIDENCE.turn_hz
        band = low_pass(x, high, period) - low_pass(x, low, period)
        band[:, 2:] = low_pass(x[:, 2:], yaw, period) - low_pass(x[:, 2:], low, period)
        return band

    def _needed_torques(self, reading: Reading) -> Array:
        """Return the torques (n, 3) in Nm that the motion needs, in the band of turning; without a
        vehicle, the angular accelerations (n, 2) about x and y.
        """
        key = reading.attitude, reading.sense, id(reading.frames.body), id(reading.gyro)
        if key in self._needed:
            return self._needed[key]
        parts = []
        for p, rate in zip(self._pieces, self._rates(reading), strict=True):
            w = rate if reading.gyro is AS_DECLARED else rate @ reading.gyro.turn.T
            alpha = derivative(w, p.period)
            if self._vehicle is None:
                torque = alpha[:, :2]
            else:
                J = self._vehicle.inertia
                torque = alpha @ J.T + np.cross(w, w @ J.T)
            parts.append(self._band(torque, p.period)[p.compared])
        self._needed[key] = np.concatenate(parts)
        return self._needed[key]

    @cached_property
    def _delayed(self) -> list[tuple[Array, Array]]:
        return [(self._pushes(delay), self._pushes(delay, kind=1)) for delay in EVIDENCE.delays]

    @cached_property
    def _filtered(self) -> list[tuple[Array, Array, Array]]:
        """Thrusts (m, 4) of each piece: in the band of turning, in that of yaw, and low-passed."""
        thrusts = self._thrusts
        assert thrusts is not None
        low, high, yaw = EVIDENCE.turn_hz
        out = []
        for p in self._pieces:
            x = p.even(self._t, thrusts)
            slow, *others = (
                low_pass(x, hz, p.period) for hz in (low, high, yaw, CUTOFFS.convention_hz)
            )
            out.append((others[0] - slow, others[1] - slow, others[2]))
        return out

    def _pushes(self, delay: float, kind: int = 0) -> Array:
        """Return the thrusts (n, 4) of one kind of ``_filtered``, at the samples compared less a
        delay; NaN outside their piece.
        """
        out = []
        for p, filtered in zip(self._pieces, self._filtered, strict=True):
            at = p.t[p.compared] - delay
            out.append([np.interp(at, p.t, column, np.nan, np.nan) for column in filtered[kind].T])
        return np.concatenate([np.column_stack(columns) for columns in out])

    def torques(self, reading: Reading) -> tuple[float, ...]:
        """Return the shares of the torques that the rotors leave, at the delay that suits them
        best.
        """
        key = (
            *(reading.attitude, reading.sense, id(reading.frames.body)),
            *(reading.rotors, reading.mirrored, id(reading.gyro)),
        )
        if key not in self._torques:
            needed = self._needed_torques(reading)
            self._torques[key] = min(
                (self._shares(needed, pushes, reading) for pushes in self._delayed), key=sum
            )
        return self._torques[key]

    def _shares(
        self, needed: Array, pushes: tuple[Array, Array], reading: Reading
    ) -> tuple[float, ...]:
        there = np.isfinite(pushes[0][:, 0])
        columns = np.argsort(reading.rotors)
        mixing = _SIDES if self._vehicle is None else self._vehicle.mixing[1:]
        gain = (0.0, np.inf) if self._vehicle is None else EVIDENCE.torque_gain
        out = []
        for i, row in enumerate(mixing):
            given = pushes[i == 2][there][:, columns] @ row
            sign = -1.0 if i == 2 and reading.mirrored else 1.0
            out.append(share(needed[there, i : i + 1], sign * given[:, None], gain))
        return tuple(out)

    def turns(self, reading: Reading) -> float:
        """Return the root mean square of roll and pitch rates in the band of turning, rad/s."""
        parts = [
            self._band(rate[:, :2], p.period)[p.compared]
            for p, rate in zip(self._pieces, self._rates(reading), strict=True)
        ]
        return float(np.sqrt(np.mean(np.square(np.concatenate(parts)))))

    @cached_property
    def shift(self) -> tuple[float, Fit] | None:
        """Time offset of the rotor speeds against the motion (s, positive: they come late), where
        it is clearly over 0.1 s, and how well they fit with it; None elsewhere.

        Motor lag, latency and radio make rotor speeds early by less.
        """
        if not self.enough:
            return None
        if self._along is None:
            axis = self._push(DECLARED)
            axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
            along = np.sum(axis * self._force(DECLARED), axis=1)[:, None]
        else:
            force = self._along[:, None]
            along = self._at(lambda p: p.even(self._t, force))
        count = round(EVIDENCE.longest_shift / EVIDENCE.shift_step)
        shifts = EVIDENCE.shift_step * np.arange(-count, count + 1)
        needed = self._needed_torques(DECLARED)
        fits = [self._shifted(-shift, needed, along) for shift in shifts]
        scores = np.array([fit.log_likelihood for fit in fits])
        near = np.flatnonzero(np.abs(shifts) <= EVIDENCE.longest_delay + 1e-9)
        best, declared = int(np.argmax(scores)), int(near[np.argmax(scores[near])])
        clear = scores[best] - scores[declared] >= EVIDENCE.shifted
        far = abs(shifts[best]) > EVIDENCE.longest_delay + EVIDENCE.shift_step + 1e-9
        believed = fits[best].torque <= EVIDENCE.good_torque
        return (float(shifts[best]), fits[best]) if clear and believed and far else None

    def _shifted(self, delay: float, needed: Array, along: Array) -> Fit:
        """Return how well rotors fit at a delay: the torques, and the thrust along its axis."""
        pushes = self._pushes(delay), self._pushes(delay, kind=1)
        there = np.isfinite(pushes[0][:, 0])
        if there.sum() < EVIDENCE.fewest:
            return Fit(1.0, EVIDENCE.most_share, (EVIDENCE.most_share,) * 3, 1.0)
        total = self._pushes(delay, kind=2)[there] @ self._k[:, None]
        total *= _G / float(np.median(total))
        thrust = share(along[there], total, EVIDENCE.force_gain)
        return Fit(1.0, thrust, self._shares(needed, pushes, DECLARED), 1.0)


@dataclass(frozen=True, eq=False)
class Ranking:
    """Readings of a pose, the likeliest first, each with its fit and its log-likelihood."""

    ranked: Sequence[tuple[float, Reading, Fit]]

    @classmethod
    def of(
        cls, evidence: Evidence, readings: Sequence[Reading], torques: bool = False
    ) -> "Ranking":
        """Return the ranking of readings; where a flight does not tell, the usual come first."""
        if not evidence.enough:
            nothing = Fit(1.0, 1.0, (), 1.0)
            return cls([(0.0, r, nothing) for r in sorted(readings, key=lambda r: r.unusual)])
        fits = [(r, evidence.fit(r, torques)) for r in readings]
        ranked = [(evidence.score(reading, fit), reading, fit) for reading, fit in fits]
        ranked.sort(key=lambda item: -item[0])
        if ranked[0][2].horizontal > EVIDENCE.good:
            ranked.sort(key=lambda item: item[1].unusual)
        return cls(ranked)

    @property
    def best(self) -> Reading:
        """The reading that is taken."""
        return self.ranked[0][1]

    @property
    def fit(self) -> Fit:
        """How well the best reading explains the flight."""
        return self.ranked[0][2]

    def other(self, name: str) -> tuple[object, float]:
        """Return the next best value of a property, and the log-likelihood ratio of the best over
        that value (0 where the flight tells nothing, infinite where there is no other value).
        """
        score, best, fit = self.ranked[0]
        for other_score, reading, _ in self.ranked[1:]:
            if getattr(reading, name) != getattr(best, name):
                tells = fit.horizontal <= EVIDENCE.good
                return getattr(reading, name), score - other_score if tells else 0.0
        return None, np.inf if fit.horizontal <= EVIDENCE.good else 0.0

    def certain(self, *names: str) -> bool:
        """Return whether every other value of properties explains the flight clearly less."""
        return all(self.other(name)[1] >= EVIDENCE.certain for name in names)


def recognise(evidence: Evidence) -> tuple[Reading, ...]:
    """Return the readings that explain a log where the log as declared does not: none, one, or
    several that fit alike.
    """
    if not evidence.enough:
        return ()
    declared = evidence.fit(DECLARED)
    readings = pose_readings() if evidence.has_pose else gyro_readings()
    if contradicted(declared.torques):
        readings += rotor_readings()
    fits = [(reading, evidence.fit(reading)) for reading in readings]
    winners = [(evidence.score(r, fit), r, fit) for r, fit in fits if _wins(fit, declared)]
    if any(r.turns_rotors for _, r, _ in winners) and evidence.shift is not None:
        # a shift by half a period of the motion looks like exchanged rotors
        best = replace(declared, torques=evidence.shift[1].torques).log_likelihood
        winners = [w for w in winners if not w[1].turns_rotors or w[2].log_likelihood > best]
    least = max((score for score, _, _ in winners), default=0.0) - EVIDENCE.certain
    return tuple(reading for score, reading, _ in winners if score >= least)


def contradicted(torques: Sequence[float]) -> bool:
    """Return whether shares of torques say that rotors do not turn the body as declared."""
    return float(np.mean(torques)) >= EVIDENCE.good or max(torques) >= EVIDENCE.contradicts


def _wins(fit: Fit, declared: Fit) -> bool:
    """Return whether a reading wins clearly in one balance and loses in none."""
    ratio = fit.log_likelihood - declared.log_likelihood
    if fit.upright < EVIDENCE.upright or ratio < EVIDENCE.refused:
        return False
    good, bad = EVIDENCE.good, EVIDENCE.good
    if declared.upright < EVIDENCE.not_upright and fit.horizontal <= good:
        return True
    by_force = declared.horizontal >= bad and fit.horizontal <= good
    by_height = declared.vertical >= EVIDENCE.upside_down and fit.vertical <= good
    by_torque = contradicted(declared.torques) and fit.torque <= good
    decisive = ratio >= EVIDENCE.decisive and declared.horizontal >= EVIDENCE.some
    loses = any(
        new > old + EVIDENCE.worse and old <= EVIDENCE.says_nothing
        for new, old in (
            (fit.horizontal, declared.horizontal),
            (fit.vertical, declared.vertical),
            (fit.torque, declared.torque),
        )
    )
    return (by_force or by_height or by_torque or decisive) and not loses
