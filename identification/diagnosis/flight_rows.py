"""The residual of flights as a regression on the coefficients of effects.

Rows are samples of all flights, low-passed with zero phase and thinned out. The six channels are
force in the world frame and torque in the body frame. A column is the change of the residual with
one coefficient. Plant, estimator, residual and columns share the effect models; residual and
columns share the low-pass.
"""

import math
from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import NamedTuple, Self

import numpy as np

from ...dynamics.effects import get
from ...dynamics.vehicle import EffectSetting, Vehicle
from ...runtime.arrays import Index
from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog, Logs, excerpt
from ..logs.table import (
    Array,
    ArrayPair,
    Mask,
    Pair,
    Rows,
    Values,
    finite_rows,
    median_step,
)
from ..motion.inertial_signals import InertialSignals, inertial_signals, reads_imu, with_drift
from ..motion.noise_spectrum import pose_was_filtered
from ..motion.residual import acting_wrench, needed_wrench
from ..motion.sensing_effects import sensing_of, undo_log_sensing
from ..motion.signals import LONGEST_GAP, Signals, log_signals
from ..motion.smoothing import CUTOFFS, even_times, low_pass, mean_square, resampled
from .coefficients import (
    CENTRAL,
    STEP,
    Setting,
    V,
    coefficient,
    is_nonlinear,
    moves_time,
    typical_size,
)
from .column import Column
from .commanded_rotors import (
    UNSTATED_THRUST_STD,
    downsampled,
    in_flight,
    in_flight_by_thrust,
)
from .log_offsets import (
    ATTITUDE_TIME_OFFSET,
    BEHIND_A_FILTER,
    LAG_ASYMMETRY,
    ROTOR_SPREAD,
    ROTOR_TIME_OFFSET,
    TIMINGS,
    VELOCITY_TIME_OFFSET,
    Offset,
    bias_column,
    with_time_offsets,
    with_uneven_lag,
)

ROWS_PER_CUTOFF = 5.0  # rows in a period of the residual's cut-off
MARGIN = 0.6  # s at either end of a piece, where the filters lack half of their input
# least variation of rotor speeds in rounding steps: with less, the rounding is no noise but looks
# like an effect
LEAST_STEPS_OF_ROTOR_SPEED = 1.4
BLOCK = 3.0  # s of flight held out, or left out in cross-validation, in one piece
SHORT_BLOCK = 1.0  # s, the same of commanded flights of fewer than eight blocks
BLOCKS_PER_HELD_OUT = 4  # one of so many blocks is held out
MEMORY = 2**26  # bytes of cached pieces
_Residual = Callable[[Setting], Array]  # flights and a setting give (rows, channels)


def delivered(signals: Signals, vehicle: Vehicle) -> Array:
    """Return the thrust (N) and the torque (Nm, body) of a vehicle's rotors (n, 4), behind its lag
    and its other effects on the rotors.
    """
    own = tuple(e for e in vehicle.effects if get(e.name).kind == "rotor input")
    still = replace(signals, angular_velocity=np.zeros_like(signals.angular_velocity))
    wrench, _ = acting_wrench(still, replace(vehicle, effects=own))
    thrust = np.einsum("ni,ni->n", wrench[:, :3], signals.rotation[:, :, 2])
    return np.column_stack([thrust, wrench[:, 3:]])


class _FlightPiece(NamedTuple):
    """One unbroken piece of a flight, with its rows."""

    log: int  # index of the log
    signals: Signals
    rows: Index  # samples used as rows
    smooth: Callable[[Array], Array]  # samples (n, ...) to rows, through the residual's low-pass
    needed: Array  # (rows, 6) wrench of the motion, N and Nm, by the declared mass and inertia
    felt: Array | None  # (rows, 3) as of ``FlightRows.felt``, with an accelerometer


class FlightRows:
    """Flights of one vehicle as rows, and the residual of any setting of effects.

    Args:
        logs: the logs to fit.
        vehicle: as declared.
        test: further logs outside the fit; without any, one block of 3 s of each four is held out.
    """

    def __init__(self, logs: Logs, vehicle: Vehicle, test: Logs = ()) -> None:
        self.vehicle = vehicle
        self._declared = {e.name: e.coefficients for e in vehicle.effects}
        self.logs = (*logs, *test)
        # without a pose, or with a slow one, the motion is read from an IMU
        self.inertial = any(map(reads_imu, self.logs))
        for flown in self.logs if self.inertial else ():
            if flown.gyro is None or flown.accelerometer is None:
                raise InputError(
                    f"{flown.source or flown.name}: has a pose and no gyro and accelerometer, and "
                    "another log has no pose; expected the IMU in all of them, or the pose"
                )
        # torque is left out, and only the time in the air counts
        self.commanded = any(log.commanded for log in self.logs)
        posed = not (self.commanded or self.inertial)
        if not posed:  # an IMU shows no height, and the ground's support is no effect
            flown_part = in_flight_by_thrust if self.inertial else in_flight
            self.logs = tuple(flown_part(log, vehicle) for log in self.logs)
        # relative standard deviation of a command's thrust, without a curve in the vehicle's file
        assumed = self.commanded and vehicle.motor_curve is None
        self.thrust_std = UNSTATED_THRUST_STD if assumed else 0.0
        # a filtered pose hides its own noise, and the filter's delay and bandwidth take more away
        self.filtered = posed and any(map(pose_was_filtered, self.logs))
        periods = [log.period for log in self.logs]
        # poses and rotor speeds as measured, for one filter of all logs
        self.has_raw_poses = (
            posed and not self.filtered and np.allclose(periods, periods[0], rtol=0.01)
        )
        seconds = sum(np.ptp(log.t) for log in self.logs)
        self.logs = tuple(excerpt(log, seconds) for log in self.logs)
        self._fit_logs = len(logs)
        self._drift: np.random.Generator | None = None  # a copy with other errors of the fusion
        self._fused: dict[FlightLog, list[InertialSignals]] = {}
        self._first: list[_FlightPiece] = []
        self._forget()
        self._lay_rows()
        # errors of accelerometers behind the motion, and time offsets of all signals
        self.biases = self._biases()
        self.offsets = self._timings() | self.biases

    def _forget(self) -> None:
        """Clear all caches."""
        self._pieces: dict[str, list[_FlightPiece]] = {}
        self._residuals: dict[str, Array] = {}
        # wrenches of starting points at some samples, by effect and coefficients
        self.started: dict[str, Array] = {}

    def _of(self, logs: Iterable[FlightLog]) -> Self:
        """Return the same rows of other logs."""
        out = copy(self)
        out._forget()
        out.logs = tuple(logs)
        return out

    def _lay_rows(self) -> None:
        """Cut the flights into pieces, and choose the samples for rows."""
        self._first = pieces = self.pieces({})
        times = [piece.signals.t[piece.rows] for piece in pieces]
        self.t = np.concatenate(times)  # (rows,) s
        self.start = np.concatenate([t == t[0] for t in times])  # first row of a piece
        # (rows,) index of the log
        self.log = np.repeat([piece.log for piece in pieces], [len(t) for t in times])
        self.period = median_step(self.t)  # s, from row to row
        # s of unbroken flight
        self.seconds = float(sum(np.ptp(piece.signals.t) for piece in pieces))
        short = self.commanded and self.seconds < 8 * BLOCK
        self.block = blocks(self.t, self.start, SHORT_BLOCK if short else BLOCK)  # (rows,)
        self.fit_rows: Mask = (  # (rows,)
            self.log < self._fit_logs
            if len(self.logs) > self._fit_logs
            else self.block % BLOCKS_PER_HELD_OUT != held_out(self.block)
        )
        if self.fit_rows.all() and self.block[-1] > 0:  # fewer than four blocks
            self.fit_rows = self.block < self.block[-1]

    def rotor_wrench(self, setting: Setting) -> Array:
        """Return thrust (N) and torque (Nm, body) of the rotors at the rows (rows, 4), behind the
        vehicle's lag and its like, low-passed.
        """
        vehicle = self.amended(setting)
        return np.concatenate(
            [p.smooth(delivered(p.signals, vehicle)) for p in self.pieces(setting)]
        )

    def at_rows(self, name: str, setting: Setting | None = None) -> Array:
        """Return a signal (rows, ...) of ``Signals``, by its name, at the rows."""
        parts = [getattr(p.signals, name)[p.rows] for p in self.pieces(setting or {})]
        return np.concatenate(parts)

    @property
    def runs(self) -> list[Rows]:
        """The rows of each piece."""
        return np.split(np.arange(len(self.t)), np.flatnonzero(self.start)[1:])

    def low_passed(self, x: Array, cutoff_hz: float) -> Array:
        """Return samples at the rows (rows, ...), low-passed piece by piece."""
        return np.concatenate([low_pass(x[run], cutoff_hz, self.period) for run in self.runs])

    @cached_property
    def speed(self) -> float:
        """RMS of the speed, m/s."""
        return math.sqrt(mean_square(self.at_rows("velocity")).sum())

    @property
    def inertias(self) -> Array:
        """Mass (kg), three times, and moments of inertia (kg m2), (6,)."""
        return np.append([self.vehicle.mass] * 3, np.diagonal(self.vehicle.inertia))

    @property
    def rotor_speeds_vary(self) -> bool:
        """Whether the rotor speeds vary by enough of their rounding steps."""
        swing = float(np.median(self.at_rows("rotor_speeds").std(axis=0)))
        return swing > LEAST_STEPS_OF_ROTOR_SPEED * self.vehicle.omega_lsb

    def pieces(self, setting: Setting) -> list[_FlightPiece]:
        """Return the pieces, with the vehicle's sensing effects undone in the logs."""
        vehicle = self.amended(setting)
        size = 400 * max(sum(len(p.signals.t) for p in self._first), 1)  # bytes
        sensing = str(sensing_of(vehicle))
        return _kept(self._pieces, sensing, lambda: self._cut(vehicle), max(MEMORY // size, 1))

    def _cut(self, vehicle: Vehicle) -> list[_FlightPiece]:
        cut = [
            (i, downsampled(s) if self.commanded else s)
            for i, log in enumerate(self.logs)
            for s in (
                self._inertial_signals(log)
                if self.inertial
                else log_signals(undo_log_sensing(log, vehicle))
            )
        ]
        if not self._first:
            return [self._piece(i, s, _rows(s)) for i, s in cut]
        # a clock offset moves the start of a piece: the rows keep their times
        pieces = []
        for first in self._first:
            wanted = first.signals.t[first.rows]
            s = next(s for i, s in cut if i == first.log and s.t[0] <= wanted[0] <= s.t[-1])
            rows = np.rint((wanted - s.t[0]) / s.period).astype(np.int64)
            pieces.append(self._piece(first.log, s, rows))
        return pieces

    def _piece(self, log: int, signals: Signals, rows: Index) -> _FlightPiece:
        def smooth(x: Array) -> Array:
            return low_pass(x, CUTOFFS.residual_hz, signals.period)[rows]

        needed = smooth(needed_wrench(signals, self.vehicle))
        felt = None
        if not self.inertial and (read := _accelerometer(self.logs[log])):
            at = resampled(signals.t, *read)
            force = self.vehicle.mass * np.einsum("nij,nj->ni", signals.rotation, at)
            felt = smooth(force) - needed[:, :3]
        return _FlightPiece(log, signals, rows, smooth, needed, felt)

    def _inertial_signals(self, log: FlightLog) -> list[InertialSignals]:
        # no effect of the library changes an IMU's readings: each log is fused once
        if log not in self._fused:
            self._fused[log] = inertial_signals(log, self.vehicle.gravity)
        if self._drift is None:
            return self._fused[log]
        return [with_drift(s, self._drift, self.vehicle.gravity) for s in self._fused[log]]

    def _timings(self) -> dict[Column, Offset]:
        """Return the possible time offsets of the signals: none where commands stand for rotors."""
        if self.commanded:
            return {}
        others = ATTITUDE_TIME_OFFSET, ROTOR_SPREAD if self.inertial else VELOCITY_TIME_OFFSET
        rotors = BEHIND_A_FILTER if self.filtered else TIMINGS[ROTOR_TIME_OFFSET]
        return {ROTOR_TIME_OFFSET: rotors, **{c: TIMINGS[c] for c in others}}

    def _biases(self) -> dict[Column, Offset]:
        """Return the possible biases of accelerometers behind the motion."""
        out: dict[Column, Offset] = {}
        for piece in self._first:
            if isinstance(s := piece.signals, InertialSignals) and piece.log < self._fit_logs:
                for axis, std in enumerate(s.bias_std.tolist()):
                    c = bias_column(piece.log, axis)
                    out[c] = Offset(max(std, out.get(c, Offset(0.0)).size))
        return out

    def amended(self, setting: Setting) -> Vehicle:
        """Return the vehicle with these effects in place of its own of the same names."""
        kept = [e for e in self.vehicle.effects if e.name not in setting]
        new = (EffectSetting(name, dict(values)) for name, values in setting.items() if name)
        return replace(self.vehicle, effects=(*kept, *new))

    def coefficients(self, setting: Setting, effect: str) -> Values:
        """Return an effect's coefficients at a setting; outside the setting, the vehicle's own."""
        return {**self._declared, **setting}.get(effect, {})

    def value(self, setting: Setting, column: Column) -> float:
        """Return one of these coefficients; 0 if nowhere stated."""
        return self.coefficients(setting, column.effect).get(column.coefficient, 0.0)

    def stated(self, effect: str) -> Values:
        """Return the coefficients of an effect fixed by the vehicle's file: all stated ones, where
        the file states some. All may have changed in a file with all.
        """
        own = self._declared.get(effect, {})
        return own if {c.name for c in get(effect).coefficients} - {CENTRAL, *own} else {}

    def columns_of(self, effects: Iterable[str]) -> list[Column]:
        """Return the columns of effects: their coefficients except for the fixed ones, and for
        ``central``, without a force of its own.
        """
        return [
            Column(e, c.name)
            for e in effects
            for c in get(e).coefficients
            if c.name != CENTRAL and c.name not in self.stated(e)
        ]

    def is_nonlinear(self, effect: str) -> bool:
        """Return whether an effect's force is not linear in its coefficients, with no values of all
        of them in a file to linearise about.
        """
        return is_nonlinear(effect) and not (effect in self._declared and not self.stated(effect))

    def residual(self, setting: Setting) -> Array:
        """Return the residual (rows, 6) with these effects.

        The residual is an acceleration by the *declared* mass and inertia. A force would vanish
        with the mass, noise and all. Nor does a coefficient multiply the noise of differentiation.
        """

        def made() -> Array:
            out = np.concatenate(
                [
                    piece.needed - piece.smooth(self.acting(piece.signals, setting, piece.log))
                    for piece in self.pieces(setting)
                ]
            )
            if self.commanded:
                out[:, 3:] = 0.0
            out.setflags(write=False)
            return out

        # a fit asks several times for the residual at its setting
        return _kept(self._residuals, str(setting), made, 16)

    def acting(
        self, signals: Signals, setting: Setting, log: int = 0, body: Vehicle | None = None
    ) -> Array:
        """Return these effects' force and torque (n, 6) on the vehicle along signals of a log.

        Force is in the world frame, without the weight; both are by the declared mass and inertia,
        like the residual, or by a body's.
        """
        body = body or self.vehicle
        vehicle = self.amended(setting)
        offsets = setting.get("", {})
        s = with_time_offsets(signals, offsets)
        s = with_uneven_lag(s, vehicle, offsets.get(LAG_ASYMMETRY.coefficient, 0.0))
        wrench, _ = acting_wrench(s, vehicle, body)
        off = np.array([offsets.get(bias_column(log, i).coefficient, 0.0) for i in range(3)])
        if off.any():
            wrench[:, :3] += body.mass * np.einsum("nij,j->ni", s.rotation, off)
        return wrench

    def felt(self, setting: Setting) -> Array | None:
        """Return the accelerometers' force less the force of the poses' motion (rows, 3) N, world,
        low-passed; None without an accelerometer, or where the accelerometer gives the motion.
        """
        felt = [piece.felt for piece in self.pieces(setting) if piece.felt is not None]
        return np.concatenate(felt) if len(felt) == len(self._first) else None

    def step(self, setting: Setting, column: Column, size: float = STEP) -> Pair:
        """Return a coefficient's value at a setting, and the step of a derivative from there: so
        many typical sizes, within the coefficient's limits.
        """
        value = self.value(setting, column)
        delta = size * typical_size(column, self.vehicle)
        if column.effect:
            c = coefficient(column)
            delta = math.copysign(delta, c.typical[0])
            if not c.minimum <= value + delta <= c.maximum:
                delta = -delta
        return value, delta

    def columns(
        self,
        setting: Setting,
        wanted: Iterable[Column],
        residual: _Residual,
        step: float = STEP,
    ) -> dict[Column, Array]:
        """Return the columns of coefficients, for a residual (rows, 6) of these flights.

        So ``residual(setting + d) = residual(setting) - column * d``, by a difference of ``step``
        typical sizes.
        """
        return {column: self._slope(setting, column, residual, step) for column in wanted}

    def _slope(self, setting: Setting, column: Column, residual: _Residual, step: float) -> Array:
        effect = column.effect
        own = self.coefficients(setting, effect)
        value, delta = self.step(setting, column, step)

        def at(moved: float) -> Array:
            return residual({**setting, effect: {**own, column.coefficient: moved}})

        # moving signals in time moves their noise too, and a one-sided step would seem to reduce
        # the noise: the difference is two-sided
        if effect and moves_time(effect) and abs(value) > abs(delta):
            c = coefficient(column)
            if c.minimum <= value - delta <= c.maximum:
                return (at(value - delta) - at(value + delta)) / (2.0 * delta)
        return (residual(setting) - at(value + delta)) / delta


def _kept(memory: dict[str, V], key: str, make: Callable[[], V], most: int) -> V:
    """Return the cached value of a key, or make it; beyond ``most`` values the one unused for
    longest goes.
    """
    memory[key] = memory.pop(key) if key in memory else make()
    if len(memory) > most:
        memory.pop(next(iter(memory)))
    return memory[key]


@lru_cache(maxsize=16)  # for several pieces, and again at each setting of sensing effects
def _accelerometer(log: FlightLog) -> ArrayPair | None:
    """Return times (n,) s, evenly spaced, and the accelerometer's readings (n, 3) m/s2 with the
    pose's low-pass; None unless the readings span the log from beginning to end.
    """
    if log.accelerometer is None:
        return None
    read = finite_rows(log.accelerometer)
    times = log.t[read]
    ends = np.concatenate([log.t[:1], times, log.t[-1:]])
    if np.diff(ends).max() >= LONGEST_GAP:
        return None
    period = median_step(times)
    even = even_times(times, period)
    return even, low_pass(resampled(even, times, log.accelerometer[read]), CUTOFFS.pose_hz, period)


def blocks(t: Array, begins: Mask, seconds: float) -> Index:
    """Return the numbers of blocks of so many seconds (n,), for samples at ``t`` (n,) s. A new
    block begins with each piece.
    """
    since = t - t[begins][np.cumsum(begins) - 1]
    new = begins | (np.diff(since // seconds, prepend=-1.0) != 0.0)
    return np.cumsum(new) - 1


def held_out(number: Index) -> Index:
    """Return the held-out one of each block's four: the last of the first, then as evenly as can
    be. The step is the golden ratio, in step with no flight.
    """
    golden = 0.5 * (5.0**0.5 - 1.0)
    turn = (0.75 + golden * (number // BLOCKS_PER_HELD_OUT)) % 1.0
    return np.asarray(BLOCKS_PER_HELD_OUT * turn, np.int64)


def _rows(signals: Signals) -> Index:
    step = max(1, round(1.0 / (ROWS_PER_CUTOFF * CUTOFFS.residual_hz * signals.period)))
    edge = round(MARGIN / signals.period)
    return np.arange(edge, len(signals.t) - edge, step)
