"""Is a flight log what it claims to be? Asked before it is diagnosed, estimated or drawn, so that
no effect and no force is found where a column is wrong.

A log that is too short, too slow, torn, from a clock that jumps, or in other units or conventions
is refused with a message that says what it looks like and what to do. Whatever a quadrotor may do
under effects that its model lacks passes.

What is a fault depends on the use. Other units, frames and orders, and a vehicle that did not fly,
spoil every number of any answer: refused in every use. A leap of the pose, a clock that jumps, a
pose that is held, a rotor that was not read for a while spoil an estimate of the wrench for a time
that can be stated, so there they are notes; a diagnosis fits the whole log at once, and refuses
them. Length, rate and even steps are what a diagnosis needs to have evidence; an estimate does not.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from ..motion.inertial_signals import inertial_pieces, reads_imu
from ..motion.signals import SIGNALS
from ..motion.smoothing import CUTOFFS, low_pass, runs_of
from .evidence import Evidence, contradicted, recognise
from .excerpt import excerpt
from .flight_log import FlightLog
from .flight_phases import flying
from .inertial import GYRO_READINGS, INERTIAL
from .readings import DECLARED, rotor_readings
from .stuck_channels import stuck_notes

Array = NDArray[np.float64]

LEAST_SECONDS = 10.0  # of unbroken pose in flight
_LEAST_PIECE = SIGNALS.shortest_piece  # s; a shorter piece is all edge to the filters
_LEAST_RATE_HZ = 50.0
_SLACK = 1.1  # of a period: jitter

_AT_REST = 0.003  # of the weight: thrust below is no turning rotor, in whatever unit
_CARRIES = 0.2, 5.0  # median thrust by weight between which it is this vehicle's
_DOUBTFUL = 0.5, 2.0  # outside it is a note
_UNIT_SLACK = 1.8  # factor that mass and thrust curve may make of a unit's thrust
_RATE_UNITS = {
    "degrees per second": 180.0 / np.pi,
    "revolutions per minute": 30.0 / np.pi,
    "revolutions per second": 0.5 / np.pi,
}  # of 1 rad/s
_TIME_UNITS = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
_PERIODS = 3e-4, 0.022  # s, of a pose once its unit is right

_LEAST_IMU_HZ = 45.0  # without a pose: a quadrotor turns within a tenth of a second
_GRAVITY = 0.6, 1.7  # of gravity, between which the median specific force of a flight lies
_UPRIGHT = 0.7  # cosine of the mean specific force's angle from body z
_FORCE_UNITS = {
    "g": (9.80665, "multiply by 9.80665"),
    "milli-g": (9.80665e-3, "multiply by 0.00980665"),
}

_UNEVEN = 0.4, 2.5  # of the median step: a step outside is uneven
_UNEVEN_SHARE, _UNEVEN_NOTE = 0.25, 0.05
_LEAP = 0.3, 20.0  # m, and m/s over the step: the farthest between two poses
_TURN = 0.8, 60.0  # rad, and rad/s over the step
_JUMP = 0.3  # s: a step so long over which the vehicle did not move is a jump of the clock
_MOVING = 0.3  # m/s
_SAME = 0.25  # of the way that the speed would have taken it in half the step
_LOST_SHARE = 0.1  # of the rows in flight: losing more is a note
_MOST_LEAPS = 0.25  # of the poses: with more, the rest says nothing either
_HELD = (
    0.2  # s in flight that a pose may repeat itself to the last digit: four of the slowest period
)
_NEVER = 1.0  # s of log in which some pose must differ from another
_STOPPED = 0.3  # s that one rotor may read 0 while the others carry the vehicle
_ABOVE_MOST = 1.5  # of the vehicle's fastest rotor speed: no rotor turns that fast
_BEYOND = 20.0  # of the median rotor speed: the same where the vehicle states no fastest


def screen_log(
    log: FlightLog, vehicle: Vehicle, least_seconds: float = LEAST_SECONDS
) -> tuple[str, ...]:
    """Return doubts about a log, or refuse it.

    Args:
        log: the flight as it was read.
        vehicle: as declared.
        least_seconds: of unbroken pose in flight that the log must have; several short logs of one
            vehicle may make up for one another.

    Returns:
        Notes: what is doubtful, but does not spoil a diagnosis.

    Raises:
        InputError: the log is too short, sampled too slowly, its pose lost too often, its clock
            jumps, its pose leaps, nothing flew, or it follows another convention than it declares;
            the message names the file, what was found and what to do.
    """
    return _Screening(log, vehicle, refuses_parts=True).run(least_seconds)[1]


def screen_for_estimate(log: FlightLog, vehicle: Vehicle) -> tuple[FlightLog, tuple[str, ...]]:
    """Return a log as a filter is to see it and doubts about it, or refuse it, in the words of
    ``screen_log``.

    Of a pose that repeats the one before to the last digit only the first is valid in the log that
    comes back: the others are no measurements. A log too short to tell its conventions (3 s of
    unbroken pose) is taken at its word.

    Args:
        log: the flight as it was read.
        vehicle: as declared.

    Returns:
        The log, and notes: what spoils a part of the estimate, and which part.

    Raises:
        InputError: every number of an estimate would be wrong: other units or conventions than the
            log declares, nothing flew, or no pose is another one.
    """
    return _Screening(log, vehicle, refuses_parts=False).run(None)


class _Screening:
    """The checks in their order; a fault of a part of the log is refused or noted."""

    def __init__(self, log: FlightLog, vehicle: Vehicle, refuses_parts: bool) -> None:
        self.log, self.vehicle = log, vehicle
        self.where = log.source or log.name or "log"
        self.refuses_parts = refuses_parts
        self.notes: list[str] = []

    def part(self, check: Callable[..., tuple[str, ...] | None], *arguments: object) -> None:
        """Make a check whose fault spoils a part of the log alone."""
        try:
            self.notes += check(*arguments, self.where) or ()
        except InputError as error:
            if self.refuses_parts:
                raise
            self.notes.append(f"warning: {str(error).removeprefix(f'{self.where}: ')}")

    def turning(self, log: FlightLog) -> FlightLog:
        """Return the log with rotor speeds that no rotor reaches interpolated, where that is only a
        note.
        """
        most, above = _too_fast(log, self.vehicle)
        if not above.any():
            return log
        row, rotor = np.argwhere(above)[0]
        found = (
            f"omega{rotor + 1} reads {log.rotor_speeds[row, rotor]:.4g} rad/s at t = "
            f"{log.t[row]:.6g} s ({int(above.sum())} such value(s)), faster than "
            f"{self.vehicle.name} turns its rotors; expected at most {most:.4g} rad/s"
        )
        if self.refuses_parts:
            raise InputError(f"{self.where}: {found}")
        self.notes.append(f"warning: {found}. They were interpolated")
        speeds = log.rotor_speeds.copy()
        for column, bad in zip(speeds.T, above.T, strict=True):
            column[bad] = np.interp(log.t[bad], log.t[~bad], column[~bad])
        return replace(log, rotor_speeds=speeds)

    def run(self, least_seconds: float | None) -> tuple[FlightLog, tuple[str, ...]]:
        """Return the log without held poses, and the notes."""
        log, vehicle, where = self.log, self.vehicle, self.where
        by_imu = reads_imu(log)
        if not by_imu and not log.valid.any():
            raise InputError(
                f"{where}: no row has a pose; expected at least one to start from, or gyro and "
                "accelerometer (gx, gy, gz and ax, ay, az)"
            )
        if not log.has_rotor_speeds:
            raise InputError(
                f"{where}: has motor commands and no rotor speeds, and the vehicle "
                f"{vehicle.name} states no motor_curve; expected one, to turn commands into thrust"
            )
        if log.vehicle and log.vehicle != vehicle.name:
            self.notes.append(
                f"warning: the log names the vehicle {log.vehicle}; it is read as {vehicle.name}"
            )
        self.notes += _check_rotors(log, vehicle, where)
        if by_imu:
            return self.run_by_imu(least_seconds)
        _check_time_unit(log, where, short=not self.refuses_parts)
        self.part(_check_stopped, log, vehicle)
        log = self.turning(log)
        if self.refuses_parts:  # a filter predicts over steps of any length
            self.notes += _check_steps(log, where)
        _check_moved(log, where)
        log, held = _without_repeats(log), log
        self.notes += _held_notes(held, vehicle)
        self.notes += stuck_notes(log, vehicle)
        if self.refuses_parts:
            _check_pose_rate(log, where)
        pieces = _pieces(log)
        if not pieces and least_seconds is not None:
            longest = max(float(log.t[run[-1]] - log.t[run[0]]) for run in _runs(log))
            raise InputError(
                f"{where}: {_lost_words(log)}the longest unbroken run of poses is {longest:.3g} s; "
                f"expected at "
                f"least {least_seconds:g} s in flight, in runs of more than {_LEAST_PIECE:g} s"
            )
        evidence = Evidence.of_log(excerpt([log])[0], vehicle) if pieces else None
        if evidence is not None:
            _check_conventions(evidence, where)
        _, _, far, turned = _leaps(log)
        if far.size and np.mean(far | turned) > _MOST_LEAPS:
            _check_leaps(log, where)
        self.part(_check_leaps, log)
        self.part(_check_clock, log)
        if least_seconds is not None:
            self.notes += _check_length(log, vehicle, pieces, least_seconds, where)
        if evidence is not None:
            self.part(_check_shift, evidence)
        return log, tuple(self.notes)

    def run_by_imu(self, least_seconds: float | None) -> tuple[FlightLog, tuple[str, ...]]:
        """Return the log and the notes, of one whose motion is that of its IMU."""
        log, vehicle, where = self.log, self.vehicle, self.where
        period = log.period
        for unit, factor in _TIME_UNITS.items():
            if period > _LEAST_PIECE * _PERIODS[1] and _PERIODS[0] <= period / factor <= 0.05:
                raise InputError(
                    f"{where}: t looks like {unit}: its median step is {period:.4g}; expected "
                    f"seconds: divide t by {factor:g}"
                )
        self.part(_check_stopped, log, vehicle)
        log = self.turning(log)
        _check_imu(log, vehicle, least_seconds, where)
        self.notes += stuck_notes(log, vehicle)
        evidence = Evidence.of_log(excerpt([log])[0], vehicle, by_imu=True)
        _check_rotation(evidence, where)
        self.part(_check_shift, evidence)
        return log, tuple(self.notes)


def _check_shift(evidence: Evidence, where: str) -> None:
    """Check that rotor speeds and pose are on one clock."""
    if evidence.shift is not None:
        shift = evidence.shift[0]
        late, sooner = ("late", "earlier") if shift > 0 else ("early", "later")
        raise InputError(
            f"{where}: the rotor speeds come {abs(shift):.2f} s too {late} against the motion; "
            f"expected both on one "
            f"clock: put omega1..omega4 {abs(shift):.2f} s {sooner}"
        )


def _stretches(rows: NDArray[np.bool_], t: Array) -> list[tuple[float, float]]:
    """Return the first and the last time (s) of each run of rows (N,)."""
    return [(float(t[a]), float(t[b - 1])) for a, b in runs_of(rows)]


def _carrying(log: FlightLog, vehicle: Vehicle) -> NDArray[np.bool_]:
    """Return in which rows (N,) the fastest rotors make half of the thrust that they usually
    make.
    """
    fastest = np.square(log.rotor_speeds).max(axis=1) * float(vehicle.k.mean())
    turning = fastest > 0.1 * float(np.quantile(fastest, 0.9))
    level = float(np.median(fastest[turning])) if turning.any() else np.inf
    return np.asarray(fastest > 0.5 * level)


def _check_stopped(log: FlightLog, vehicle: Vehicle, where: str) -> None:
    """Check that no rotor reads 0 for long while the others carry the vehicle."""
    carrying = _carrying(log, vehicle)
    for i, column in enumerate(log.rotor_speeds.T):
        stopped = [
            (a, b) for a, b in _stretches((column == 0.0) & carrying, log.t) if b - a > _STOPPED
        ]
        if stopped:
            begin, end = max(stopped, key=lambda run: run[1] - run[0])
            raise InputError(
                f"{where}: omega{i + 1} is 0 while the other rotors turn, for {end - begin:.3g} s "
                f"from t = {begin:.6g} s ({len(stopped)} such stretch(es)); expected the rotor "
                f"speeds of all four"
            )


def _too_fast(log: FlightLog, vehicle: Vehicle) -> tuple[float, NDArray[np.bool_]]:
    """Return the speed (rad/s) that no rotor reaches, and which values (N, 4) are above it."""
    middle = float(np.median(log.rotor_speeds[log.rotor_speeds.max(axis=1) > 0.0]))
    most = min(_ABOVE_MOST * vehicle.omega_max, _BEYOND * max(middle, vehicle.hover_rate))
    return most, log.rotor_speeds > most


def _check_moved(log: FlightLog, where: str) -> None:
    """Check that some pose differs from another."""
    seen = np.flatnonzero(log.valid)
    pose = np.column_stack([log.position, log.quaternion])[seen]
    if log.t[seen[-1]] - log.t[seen[0]] > _NEVER and np.all(pose == pose[0]):
        raise InputError(
            f"{where}: the pose never changes, to the last digit; expected the poses of a flight"
        )


def _held_notes(log: FlightLog, vehicle: Vehicle) -> tuple[str, ...]:
    """Return a note where a pose is held in flight for longer than a slow motion capture holds
    it.
    """
    seen = np.flatnonzero(log.valid)
    pose = np.column_stack([log.position, log.quaternion])[seen]
    same = np.concatenate([[False], np.all(pose[1:] == pose[:-1], axis=1)])
    same &= _carrying(log, vehicle)[seen]
    held = [(a, b) for a, b in _stretches(same, log.t[seen]) if b - a > _HELD]
    if not held:
        return ()
    begin, end = max(held, key=lambda run: run[1] - run[0])
    return (
        f"warning: the pose is frozen for {end - begin:.3g} s from t = {begin:.6g} s ({len(held)} "
        f"such stretch(es)): it repeats to the last digit while the rotors turn. These rows count "
        f"as without a pose",
    )


def _check_rotors(log: FlightLog, vehicle: Vehicle, where: str) -> tuple[str, ...]:
    """Check that all four rotors turned, at speeds (rad/s) that carry the vehicle."""
    with np.errstate(over="ignore"):
        thrust = np.square(log.rotor_speeds) @ vehicle.k / vehicle.weight
    most = float(np.quantile(thrust, 0.95))
    if most < _AT_REST:
        raise InputError(
            f"{where}: omega1..omega4 are at rest all the time, so nothing flew; expected "
            f"rotor speeds in rad/s "
            f"(about {vehicle.hover_rate:.3g} when {vehicle.name} hovers)"
        )
    if not np.isfinite(most):
        raise InputError(
            f"{where}: omega1..omega4 are beyond all rotors; expected rotor speeds in rad/s (about "
            f"{vehicle.hover_rate:.3g} when {vehicle.name} hovers)"
        )
    turning = thrust > 0.3 * most
    for i, column in enumerate(log.rotor_speeds[turning].T):
        if float(np.max(column)) <= 0.0:
            raise InputError(
                f"{where}: omega{i + 1} is 0 while the other rotors turn; expected the rotor "
                f"speeds of all four"
            )
    ratio = float(np.median(thrust[turning]))
    if _CARRIES[0] <= ratio <= _CARRIES[1]:
        if _DOUBTFUL[0] <= ratio <= _DOUBTFUL[1]:
            return ()
        return (
            f"the rotor speeds make a median thrust of {ratio:.2g} times the weight of "
            f"{vehicle.name}: is it this "
            "vehicle, and did it fly?",
        )
    for unit, factor in _RATE_UNITS.items():
        if 1.0 / _UNIT_SLACK <= ratio / factor**2 <= _UNIT_SLACK:
            what = f"multiply by {1 / factor:.4g}" if factor < 1 else f"divide by {factor:.4g}"
            raise InputError(
                f"{where}: omega1..omega4 look like {unit}: read as rad/s they make {ratio:.3g} "
                f"times the weight "
                f"of {vehicle.name}; expected rad/s: {what}"
            )
    raise InputError(
        f"{where}: the rotor speeds make a median thrust of {ratio:.3g} times the weight of "
        f"{vehicle.name}; "
        f"expected about 1: omega1..omega4 in rad/s, and the vehicle that flew"
    )


def _check_time_unit(log: FlightLog, where: str, short: bool) -> None:
    """Check the unit of time; a log that may be ``short`` need not have a whole piece once it is
    right.
    """
    period = float(np.median(np.diff(log.t[log.valid]))) if log.valid.sum() > 1 else log.period
    if period <= _LEAST_PIECE * _PERIODS[1]:
        return
    for unit, factor in _TIME_UNITS.items():
        if not _PERIODS[0] <= period / factor <= _PERIODS[1]:
            continue
        rescaled = replace(log, t=(log.t - log.t[0]) / factor)
        if not short and not max((len(piece) for piece in _pieces(rescaled)), default=0):
            continue
        raise InputError(
            f"{where}: t looks like {unit}: its median step is {period:.4g}; expected seconds: "
            f"divide t by "
            f"{factor:g}"
        )


def _check_steps(log: FlightLog, where: str) -> tuple[str, ...]:
    step = np.diff(log.t)
    median = float(np.median(step))
    uneven = float(np.mean((step < _UNEVEN[0] * median) | (step > _UNEVEN[1] * median)))
    if uneven > _UNEVEN_SHARE:
        raise InputError(
            f"{where}: column t: time steps vary wildly, from {step.min():.3g} to {step.max():.3g} "
            f"s, "
            f"{100 * uneven:.0f} % of them far from the median of {median:.3g} s; expected the "
            f"times at which the "
            "poses were taken, not those at which they arrived"
        )
    if uneven > _UNEVEN_NOTE:
        return (
            f"time steps are uneven: {100 * uneven:.0f} % are far from the median of {median:.3g} "
            f"s",
        )
    return ()


def _without_repeats(log: FlightLog) -> FlightLog:
    """Return the log with only new poses valid: one that repeats the one before to the last digit
    was held.
    """
    seen = np.flatnonzero(log.valid)
    pose = np.column_stack([log.position, log.quaternion])[seen]
    held = seen[1:][np.all(pose[1:] == pose[:-1], axis=1)]
    if not held.size:
        return log
    valid = log.valid.copy()
    valid[held] = False
    return replace(log, valid=valid)


def _check_pose_rate(log: FlightLog, where: str) -> None:
    seen = log.t[log.valid]
    period = float(np.median(np.diff(seen))) if len(seen) > 1 else np.inf
    if period * _LEAST_RATE_HZ > _SLACK:
        raise InputError(
            f"{where}: {1 / period:.3g} new poses a second; expected at least {_LEAST_RATE_HZ:g}: "
            f"accelerations "
            "come from differences of poses that are low-passed at 15 Hz, and a quadrotor turns "
            "within a tenth "
            "of a second"
        )


def _runs(log: FlightLog) -> list[NDArray[np.intp]]:
    """Return the rows of each unbroken run of poses; a gap of more than 0.1 s breaks it."""
    seen = np.flatnonzero(log.valid)
    breaks = np.flatnonzero(np.diff(log.t[seen]) > max(0.1, 3.5 * log.period)) + 1
    return np.split(seen, breaks)


def _pieces(log: FlightLog) -> list[NDArray[np.intp]]:
    """Return the rows of each unbroken run of poses that is long enough to say something."""
    return [
        run for run in _runs(log) if len(run) > 8 and log.t[run[-1]] - log.t[run[0]] > _LEAST_PIECE
    ]


def _lost_words(log: FlightLog) -> str:
    lost = ~log.valid
    runs = int(np.sum(lost[1:] & ~lost[:-1])) + int(lost[0])
    return (
        f"the pose is lost in {runs} run(s), {int(lost.sum())} of {len(lost)} rows; "
        if runs
        else ""
    )


def _check_conventions(evidence: Evidence, where: str) -> None:
    readings = recognise(evidence)
    if readings:
        says = "; or ".join(dict.fromkeys(reading.says for reading in readings[:3]))
        raise InputError(
            f"{where}: {says}. As logged, the motion contradicts the rotor speeds and gravity"
        )


def _check_imu(log: FlightLog, vehicle: Vehicle, least: float | None, where: str) -> None:
    """Check rate, length, unit and axes of a log's IMU; ``least`` s of it must be unbroken.

    Gravity shows the accelerometer's unit and axes, and the rotors the gyro's. What neither shows
    (an accelerometer turned about z) stays the log's word.
    """
    assert log.gyro is not None
    assert log.accelerometer is not None
    read = np.isfinite(log.gyro[:, 0]) & np.isfinite(log.accelerometer[:, 0])
    rows = np.flatnonzero(read)
    if len(rows) < INERTIAL.samples:
        raise InputError(
            f"{where}: ax, ay, az and gx, gy, gz are read together in {len(rows)} row(s); expected "
            "them in the same rows, and a whole flight"
        )
    for names, x in (("ax, ay, az", log.accelerometer), ("gx, gy, gz", log.gyro)):
        if np.all(np.ptp(x[rows], axis=0) == 0.0):
            raise InputError(f"{where}: {names} never change: the sensor was not read")
    rate = 1.0 / float(np.median(np.diff(log.t[rows])))
    if rate < _LEAST_IMU_HZ:
        raise InputError(
            f"{where}: {rate:.3g} IMU readings a second and no pose as fast; expected at least "
            f"{_LEAST_IMU_HZ:g}: a quadrotor turns within a tenth of a second"
        )
    pieces = inertial_pieces(log)
    if least is not None:
        there = sum(float(log.t[p[-1]] - log.t[p[0]]) for p in pieces)
        if there < least - 1e-9:
            raise InputError(
                f"{where}: {there:.3g} s of unbroken gyro and accelerometer; expected at least "
                f"{least:g} s of flight, in runs of more than 3 s"
            )
    _check_gravity(log.accelerometer[rows], log.rotor_speeds[rows], vehicle, where)


def _check_gravity(force: Array, speeds: Array, vehicle: Vehicle, where: str) -> None:
    """Check that the specific force (n, 3) of a flight is gravity, upwards."""
    thrust = np.square(speeds) @ vehicle.k
    carried = flying(thrust)
    middle = np.median(force[carried], axis=0)
    size = float(np.median(np.linalg.norm(force[carried], axis=1)))
    low, high = _GRAVITY
    if not low <= size / vehicle.gravity <= high:
        for unit, (factor, how) in _FORCE_UNITS.items():
            if low <= size * factor / vehicle.gravity <= high:
                raise InputError(
                    f"{where}: ax, ay, az look like {unit}: in flight they are {size:.3g} in the "
                    f"median; expected m/s2, {vehicle.gravity:.3g} in a hover: {how}"
                )
        raise InputError(
            f"{where}: ax, ay, az are {size:.3g} m/s2 in the median of a flight; expected the "
            f"specific force, which gravity makes about {vehicle.gravity:.3g}"
            + (" (an acceleration without gravity is none)" if size < vehicle.gravity else "")
        )
    upright = float(middle[2] / max(float(np.linalg.norm(middle)), 1e-9))
    if upright < -_UPRIGHT:
        raise InputError(
            f"{where}: az is {middle[2]:.3g} m/s2 in the median of a flight: the axes look like "
            "forward, right, down, or inverted; expected forward, left, up and +9.81 in a hover: "
            "negate ay and az (and gy and gz)"
        )
    if upright < _UPRIGHT:
        axis = "xyz"[int(np.argmax(np.abs(middle)))]
        raise InputError(
            f"{where}: gravity lies along a{axis} in the median of a flight; expected it along az: "
            "axes forward, left, up, of the vehicle and not of the sensor's board"
        )


def _check_rotation(evidence: Evidence, where: str) -> None:
    """Check that the rotors, as logged, turn the body as the gyro shows, or say which reading of
    the columns explains the turning.
    """
    if not evidence.enough or not contradicted(evidence.torques(DECLARED)):
        return
    fits = [
        (evidence.torques(DECLARED, turn), f"gx, gy, gz {words}") for turn, words in GYRO_READINGS
    ]
    fits += [(evidence.torques(reading), reading.says) for reading in rotor_readings()]
    likely = evidence.likelier(fits)
    if likely:
        says = "; or ".join(dict.fromkeys(likely[:3]))
        raise InputError(f"{where}: {says}. As logged, the gyro contradicts the rotors' torques")


def _leaps(log: FlightLog) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return of each step from pose to pose (n,) its way (m) and angle (rad), and whether they are
    farther than a quadrotor gets.
    """
    seen = np.flatnonzero(log.valid)
    step = np.diff(log.t[seen])
    way = np.linalg.norm(np.diff(log.position[seen], axis=0), axis=1)
    q = log.quaternion[seen]
    angle = 2.0 * np.arccos(np.clip(np.abs(np.sum(q[1:] * q[:-1], axis=1)), 0.0, 1.0))
    return way, angle, way > _LEAP[0] + _LEAP[1] * step, angle > _TURN[0] + _TURN[1] * step


def _check_leaps(log: FlightLog, where: str) -> None:
    """Check that no pose is farther from the one before than a quadrotor gets."""
    way, angle, far, turned = _leaps(log)
    if not (far.any() or turned.any()):
        return
    seen = np.flatnonzero(log.valid)
    step = np.diff(log.t[seen])
    i = int(np.argmax(far | turned))
    what = f"{way[i]:.3g} m" if far[i] else f"{np.degrees(angle[i]):.0f} degrees"
    units = ": are px, py, pz in metres?" if far.mean() > 0.05 else ""
    raise InputError(
        f"{where}: the pose leaps by {what} within {step[i]:.3g} s at t = {log.t[seen[i + 1]]:.6g} "
        f"s, which no "
        f"quadrotor flies ({int(np.sum(far | turned))} such step(s)){units}; expected poses of one "
        f"vehicle on one "
        "clock: leave the bad rows' pose empty, or cut the log there"
    )


def _check_clock(log: FlightLog, where: str) -> None:
    """Check that no long step in time lies between two poses that follow one another as if no time
    had passed.
    """
    seen = np.flatnonzero(log.valid)
    t, position = log.t[seen], log.position[seen]
    step = np.diff(t)
    span = 10  # poses on either side, over which velocities are taken
    for i in np.flatnonzero(step > _JUMP):
        a, b = i - span, i + 1 + span
        if a < 0 or b >= len(t) or t[i] - t[a] > _JUMP or t[b] - t[i + 1] > _JUMP:
            continue
        before = (position[i] - position[a]) / (t[i] - t[a])
        after = (position[b] - position[i + 1]) / (t[b] - t[i + 1])
        speed = min(float(np.linalg.norm(before)), float(np.linalg.norm(after)))
        moved = float(np.linalg.norm(position[i + 1] - position[i]))
        alike = float(np.linalg.norm(after - before)) < 0.15 * speed + 0.05
        turned = 2.0 * np.arccos(
            min(1.0, abs(float(log.quaternion[seen[i]] @ log.quaternion[seen[i + 1]])))
        )
        if (
            speed > _MOVING
            and alike
            and turned < 0.05
            and moved < _SAME * speed * 0.5 * float(step[i])
        ):
            raise InputError(
                f"{where}: column t jumps by {step[i]:.3g} s at t = {t[i]:.6g} s, but the pose "
                f"goes on from where "
                f"it was ({1e3 * moved:.0f} mm on at {speed:.2g} m/s); expected one clock for the "
                f"whole log: set "
                "the clock's jump back, or cut the log there"
            )


def _check_length(
    log: FlightLog, vehicle: Vehicle, pieces: list[NDArray[np.intp]], least: float, where: str
) -> tuple[str, ...]:
    """Check that enough is left in unbroken runs in flight, and note where much is not."""
    thrust = (
        low_pass(np.square(log.rotor_speeds) @ vehicle.k, CUTOFFS.flying_hz, log.period)
        if len(log.t) > 30
        else np.zeros(len(log.t))
    )
    flying = thrust > 0.5 * float(
        np.median(thrust[thrust > 0.3 * float(np.quantile(thrust, 0.95))])
    )
    step = np.minimum(np.diff(log.t, append=log.t[-1] + log.period), max(0.1, 3.5 * log.period))
    left = sum(
        float(step[piece[0] : piece[-1] + 1][flying[piece[0] : piece[-1] + 1]].sum())
        for piece in pieces
    )
    whole = float(step[flying].sum())
    if left < least - 1e-9:
        raise InputError(
            f"{where}: {_lost_words(log)}{left:.3g} s of flight in unbroken runs of poses; "
            f"expected at least "
            f"{least:g} s, in runs of more than {_LEAST_PIECE:g} s"
        )
    if left < (1.0 - _LOST_SHARE) * whole:
        return (
            f"{_lost_words(log)}{left:.3g} of {whole:.3g} s of flight lie in runs of poses long "
            f"enough to use",
        )
    return ()
