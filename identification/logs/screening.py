"""Screening of a flight log before a diagnosis, an estimate or a drawing: a wrong column must not
appear as an effect or a force.

A log is refused if too short, too slow, torn, on a jumping clock, or in other units or conventions.
The message states the log's look and the remedy. Every motion of a quadrotor under effects outside
its model passes.

Faults depend on the use. Other units, frames and orders, and a log without a flight, spoil every
number of any answer: refused in every use. A leap or a hold of the pose, a jump of the clock, a
rotor without readings spoil an estimate of the wrench for a known time, so they are notes of an
estimate. A diagnosis fits the whole log at once, and refuses them. A diagnosis also needs length,
rate and even steps as evidence; an estimate does not.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from ..motion.inertial_signals import imu_rows, inertial_pieces, reads_imu
from ..motion.signals import SHORTEST_PIECE, longest_step, pose_pieces
from ..motion.smoothing import CUTOFFS, low_pass, runs_of
from .evidence import remedies
from .flight_log import FORCE_HZ, TORQUE_HZ, FlightLog, NotedLog, SomeVehicle, serves
from .flight_phases import carrying, flying, usual_thrust
from .inertial import LEAST_SAMPLES, gravity_doubt, is_stuck
from .magnitudes import DOUBTFUL, interpolated, motor_doubts, rotor_doubt, time_doubt, within
from .table import Array, Lines, Mask, lengths, median_step

LEAST_SECONDS = 10.0  # s, unbroken pose in flight
_LEAST_RATE_HZ = 50.0
_LEAST_IMU_HZ = 45.0  # without a pose: a quadrotor turns within a tenth of a second
_JUMP = 0.3  # s: a step so long without a move is a jump of the clock
_MANY_LEAPS = 0.05  # share of the steps
_STILL = 0.5  # s of a still channel; a busy link repeats a few samples


class _Refused(str):
    """A reason against any use of the log."""


class _Needed(str):
    """A reason against a diagnosis, without meaning for an estimate."""


class _Fault(str):
    """A reason against a diagnosis, and a warning for an estimate."""


class _Note(str):
    """A note."""


_Findings = Iterable[str]


def screen_log(
    log: FlightLog, vehicle: Vehicle, least_seconds: float | None = LEAST_SECONDS
) -> NotedLog:
    """Return a log for a filter, and doubts, or refuse the log.

    Of equal poses to the last digit only the first is valid in the returned log: the others are no
    measurements. A log too short to tell its conventions (3 s of unbroken pose) is taken at its
    word.

    Args:
        log: the flight as read.
        vehicle: as declared.
        least_seconds: unbroken pose in flight needed for a diagnosis; several short logs of one
            vehicle may add up. None: for an estimate.

    Returns:
        The log, and notes: doubts without harm to a diagnosis; for an estimate, the spoiled parts
            and their causes.

    Raises:
        InputError: the log is too short, sampled too slowly, its pose lost too often, its clock
            jumps, its pose leaps, or nothing flew. The log follows another convention than
            declared. For an estimate: every number would be wrong. The message names the file, the
            fault and the remedy.
    """
    source, by_imu = log.source or log.name or "log", reads_imu(log)
    notes = []

    def hear(findings: _Findings) -> None:
        for text in findings:
            kind = type(text)
            if kind is _Refused or (kind is not _Note and least_seconds is not None):
                raise InputError(f"{source}: {text}")
            if kind is not _Needed:
                notes.append(str(text) if kind is _Note else f"warning: {text}")

    hear(_rotors(log, vehicle, by_imu))
    log = interpolated(log, log.rotor_speeds > _most_rad_s(log, vehicle))
    if by_imu:
        hear(_imu(log, vehicle, least_seconds or 0.0))
    else:
        if least_seconds is not None:  # a filter predicts over steps of any length
            hear(_uneven_steps(log))
        seen, same = np.flatnonzero(log.valid), np.zeros(len(log.t), np.bool_)
        pose = np.column_stack([log.position, log.quaternion])[seen]
        same[seen[1:]] = ~np.diff(pose, axis=0).any(axis=1)
        hear(_new_poses(log, same))
        log = replace(log, valid=log.valid & ~same)
    hear(stuck_channels(log, vehicle))
    delay = check_conventions(log, vehicle)
    if not by_imu:
        hear(_steps(log))
        if least_seconds is not None:
            hear(_length(log, vehicle, least_seconds))
    hear(map(_Fault, delay))
    return log, tuple(notes)


def check_conventions(log: FlightLog, vehicle: SomeVehicle) -> Lines:
    """Return a delay of a log's rotors against its motion, in words; none: no such delay, or
    nothing to tell from.

    Args:
        log: the flight.
        vehicle: as declared; None: four rotors, front-left, rear-left, rear-right, front-right.

    Raises:
        InputError: the pose stands still, or the motion contradicts the rotors in another way; with
            the advice that leaves a consistent log.
    """
    by_imu, source = reads_imu(log), log.source or log.name or "log"
    for text in _held(log) if vehicle is None else ():  # else checked with the poses
        raise InputError(f"{source}: {text}")
    if not log.has_rotor_speeds or not (by_imu or pose_pieces(log)):
        return []
    advice, mends = remedies(log if by_imu else _without_leaps(log), vehicle, by_imu)
    says = "; or ".join(dict.fromkeys(reading.says for reading in advice))
    if all(reading.late and not replace(reading, late=0.0).says for reading in advice):
        return [says] if says else []
    whose = "motion contradicts the rotor speeds and gravity"
    if by_imu:
        whose = "gyro contradicts the rotors' torques"
    unmended = "" if mends else ". No usual convention mends this log; the likeliest is named"
    raise InputError(f"{source}: {says}. As logged, the {whose}{unmended}")


def _rotors(log: FlightLog, vehicle: Vehicle, by_imu: bool) -> _Findings:
    """Check for a motion, the declared vehicle, and four turning rotors at speeds (rad/s) for its
    weight.
    """
    if not by_imu and not log.has_pose:
        yield _Refused(
            "no row has a pose; expected at least one to start from, or gyro and accelerometer "
            "(gx, gy, gz and ax, ay, az)"
        )
    if not log.has_rotor_speeds:
        yield _Refused(
            f"has motor commands and no rotor speeds, and the vehicle {vehicle.name} states no "
            "motor_curve; expected one, to turn commands into thrust"
        )
    # ``identify`` gives a preset's flights a vehicle of their own
    if log.vehicle not in ("", vehicle.name) and not vehicle.status.coefficients:
        yield _Note(
            f"warning: the log names the vehicle {log.vehicle}; it is read as {vehicle.name}"
        )
    speeds = log.rotor_speeds
    with np.errstate(over="ignore"):
        thrust = speeds**2 @ vehicle.k / vehicle.weight
    most = np.quantile(thrust, 0.95)
    hover = f"rotor speeds in rad/s (about {vehicle.hover_rate:.3g} when {vehicle.name} hovers)"
    zero = "is 0 while the other rotors turn{}; expected the rotor speeds of all four"
    # less of the weight is no turning rotor, in whatever unit
    if most < 0.003:
        yield _Refused(
            "omega1..omega4 are at rest all the time, or too slow for the "
            f"{vehicle.mass:g} kg of {vehicle.name}, so nothing flew; expected {hover}"
        )
    if not np.isfinite(most):
        yield _Refused(f"omega1..omega4 are beyond all rotors; expected {hover}")
    for rotor in np.flatnonzero(speeds[thrust > 0.3 * most].max(axis=0) <= 0.0):
        yield _Refused(f"omega{rotor + 1} {zero.format('')}")
    ratio = usual_thrust(thrust)
    if doubt := rotor_doubt(ratio, vehicle):
        yield _Refused(doubt)
    if not within(ratio, DOUBTFUL):
        yield _Note(
            f"the rotor speeds make a median thrust of {ratio:.2g} times the weight of "
            f"{vehicle.name}: is it this vehicle, and did it fly?"
        )
    times = log.t if by_imu or log.valid.sum() < 2 else log.t[log.valid]
    if doubt := time_doubt(median_step(times)):
        yield _Refused(doubt)
    what, least = ("motor commands", FORCE_HZ) if log.commanded else ("rotor speeds", TORQUE_HZ)
    if not serves(log.motor_rate, least):
        yield _Needed(
            f"{what} come {log.motor_rate:.3g} times a second; expected at least {least:g}: what "
            "the rotors do between them is not known"
        )
    carried = carrying((speeds**2).max(axis=1))
    for i, speed in enumerate(speeds.T):
        if stopped := _stretches((speed == 0.0) & carried, log.t, 0.3):
            yield _Fault(f"omega{i + 1} {zero.format(f', for {stopped}')}")
    fastest = _most_rad_s(log, vehicle)
    if (above := np.argwhere(speeds > fastest)).size:
        row, rotor = above[0]
        kind = _Refused if (speeds > fastest).all(axis=0).any() else _Fault
        yield kind(
            f"omega{rotor + 1} reads {speeds[row, rotor]:.4g} rad/s at t = {log.t[row]:.6g} s "
            f"({len(above)} such value(s)), faster than {vehicle.name} turns its rotors; expected "
            f"at most {fastest:.4g} rad/s: an estimate interpolates them"
        )


def _most_rad_s(log: FlightLog, vehicle: Vehicle) -> float:
    """Return a rotor speed in rad/s beyond all rotors."""
    middle = float(np.median(log.rotor_speeds[log.rotor_speeds.max(axis=1) > 0.0]))
    # no rotor turns as fast; the median counts where the vehicle states no fastest
    return min(1.5 * vehicle.omega_max, 20.0 * max(middle, vehicle.hover_rate))


def _imu(log: FlightLog, vehicle: Vehicle, least: float) -> _Findings:
    """Check rate, length, unit and axes of an IMU.

    Gravity shows the accelerometer's unit and axes, and the rotors the gyro's. An accelerometer
    turned about z shows in neither.
    """
    assert log.gyro is not None
    assert log.accelerometer is not None
    rows = imu_rows(log)
    if len(rows) < LEAST_SAMPLES:
        yield _Refused(
            f"ax, ay, az and gx, gy, gz are read together in {len(rows)} row(s); expected them in "
            "the same rows, and a whole flight"
        )
    for names, x in (("ax, ay, az", log.accelerometer), ("gx, gy, gz", log.gyro)):
        if is_stuck(x[rows]):
            yield _Refused(f"{names} never change: the sensor was not read")
    known = (log.rates.get(name, np.inf) for name in ("gyro", "accelerometer"))
    rate = min(1.0 / median_step(log.t[rows]), *known)
    if rate < _LEAST_IMU_HZ:
        yield _Refused(
            f"{rate:.3g} IMU readings a second and no pose as fast; expected at least "
            f"{_LEAST_IMU_HZ:g}: a quadrotor turns within a tenth of a second"
        )
    there = sum(np.ptp(log.t[piece]) for piece in inertial_pieces(log))
    if there < least - 1e-9:
        yield _Needed(
            f"{there:.3g} s of unbroken gyro and accelerometer; expected at least {least:g} s of "
            "flight, in runs of more than 3 s"
        )
    thrust = log.rotor_speeds[rows] ** 2 @ vehicle.k
    if doubt := gravity_doubt(log.accelerometer[rows[flying(thrust)]], vehicle.gravity):
        yield _Refused(f"ax, ay, az {doubt}")


def _held(log: FlightLog) -> _Findings:
    """Check for a position and an attitude that change."""
    kinds = _Refused("position (px, py, pz)"), _Fault("attitude (qw to qz)")
    for name, x in zip(kinds, (log.position, log.quaternion), strict=True):
        if np.ptp(log.t) > 1.0 and is_stuck(x[log.valid]):
            yield type(name)(
                f"the {name} never changes, to the last digit; expected the poses of a flight"
            )


def _new_poses(log: FlightLog, same: Mask) -> _Findings:
    """Check the rate of new poses; ``same`` (N,): the pose is the one before, to the last digit."""
    seen = np.flatnonzero(log.valid)
    yield from _held(log)
    fastest = (log.rotor_speeds**2).max(axis=1)
    # 0.2 s: four of the slowest period
    if held := _stretches((same & carrying(fastest))[seen], log.t[seen], 0.2):
        yield _Note(
            f"warning: the pose is frozen for {held}: it repeats to the last digit while the "
            "rotors turn. These rows count as without a pose"
        )
    times = log.t[log.valid & ~same]
    period = median_step(times) if len(times) > 1 else np.inf
    # with 10 % of jitter
    if period * _LEAST_RATE_HZ > 1.1:
        yield _Needed(
            f"{1 / period:.3g} new poses a second; expected at least {_LEAST_RATE_HZ:g}: "
            "accelerations come from differences of poses that are low-passed at 15 Hz, and a "
            "quadrotor turns within a tenth of a second"
        )


def _uneven_steps(log: FlightLog) -> _Findings:
    """Check for even steps of the clock."""
    step = np.diff(log.t)
    median = np.median(step)
    uneven = ((step < 0.4 * median) | (step > 2.5 * median)).mean()
    words = f"{100 * uneven:.0f} % of them far from the median of {median:.3g} s"
    if uneven > 0.25:
        yield _Refused(
            f"column t: time steps vary wildly, from {step.min():.3g} to {step.max():.3g} s, "
            f"{words}; expected the times at which the poses were taken, not those at which they "
            "arrived"
        )
    if uneven > 0.05:
        yield _Note(f"time steps are uneven: {words}")


def _moves(log: FlightLog) -> tuple[Array, Array, Mask, Mask]:
    """Return the pose's moves (m) and turns (rad) from row to row, and masks of both beyond a
    quadrotor's speed.
    """
    q, step = log.quaternion[log.valid], np.diff(log.t[log.valid])
    way = lengths(np.diff(log.position[log.valid], axis=0))
    angle = 2.0 * np.arccos(np.minimum(abs(np.einsum("ni,ni->n", q[:-1], q[1:])), 1.0))
    # m and rad, and m/s and rad/s over the step
    return way, angle, way > 0.3 + 20.0 * step, angle > 0.8 + 60.0 * step


def _without_leaps(log: FlightLog) -> FlightLog:
    """Return a log without the poses around its leaps: a leap is no acceleration, and tells no
    convention. Many leaps are of another unit.
    """
    leaps = np.logical_or(*_moves(log)[2:])
    at = log.t[log.valid][1:][leaps & (leaps.mean() <= _MANY_LEAPS)]
    reach = longest_step(log)
    near = np.searchsorted(at, log.t - reach) < np.searchsorted(at, log.t + reach)
    return replace(log, valid=log.valid & ~near)


def _steps(log: FlightLog) -> _Findings:
    """Check for leaps of the pose beyond a quadrotor's speed, and for jumps of the clock."""
    t, position = log.t[log.valid], log.position[log.valid]
    step = np.diff(t)
    way, angle, far, turned = _moves(log)
    leaps = far | turned
    if leaps.any():
        first = leaps.argmax()
        what = f"{way[first]:.3g} m" if far[first] else f"{np.degrees(angle[first]):.0f} degrees"
        units = ": are px, py, pz in metres?" if far.mean() > _MANY_LEAPS else ""
        # with more leaps, the rest counts for nothing
        kind = _Refused if leaps.mean() > 0.25 else _Fault
        yield kind(
            f"the pose leaps by {what} within {step[first]:.3g} s at t = {t[first + 1]:.6g} s, "
            f"which no quadrotor flies ({leaps.sum()} such step(s)){units}; expected poses of "
            "one vehicle on one clock: leave the bad rows' pose empty, or cut the log there"
        )
    # two poses as if no time had passed, by velocities over 10 poses on each side
    span = 10
    for i in span + np.flatnonzero(step[span:-span] > _JUMP):
        begins, ends = [i - span, i + 1], [i, i + 1 + span]
        seconds = t[ends] - t[begins]
        before, after = (position[ends] - position[begins]) / seconds[:, None]
        speed = min(np.linalg.norm(before), np.linalg.norm(after))
        is_alike = np.linalg.norm(after - before) < 0.15 * speed + 0.05 and angle[i] < 0.05
        # a quarter of the way at this speed in half the step
        is_close = speed > 0.3 and way[i] < 0.125 * speed * step[i]
        if seconds.max() <= _JUMP and is_alike and is_close:
            yield _Fault(
                f"column t jumps by {step[i]:.3g} s at t = {t[i]:.6g} s, but the pose goes on from "
                f"where it was ({1e3 * way[i]:.0f} mm on at {speed:.2g} m/s); expected one clock "
                "for the whole log: set the clock's jump back, or cut the log there"
            )
            return


def _length(log: FlightLog, vehicle: Vehicle, least: float) -> _Findings:
    """Check for enough flight in unbroken runs, and note large losses."""
    thrust = low_pass(log.rotor_speeds**2 @ vehicle.k, CUTOFFS.flying_hz, log.period)
    step = np.minimum(np.diff(log.t, append=log.t[-1] + log.period), max(0.1, 3.5 * log.period))
    step *= carrying(thrust)
    pieces = pose_pieces(log)
    left, whole = sum(step[piece[0] : piece[-1] + 1].sum() for piece in pieces), step.sum()
    words = (
        f"{left:.3g} of {whole:.3g} s of flight lie in unbroken runs of poses of more than "
        f"{SHORTEST_PIECE:g} s"
    )
    if lost := (~log.valid).sum():
        runs = runs_of(~log.valid)
        words = f"the pose is lost in {len(runs)} run(s), {lost} of {len(log.t)} rows; {words}"
    if not pieces or left < least - 1e-9:
        yield _Refused(f"{words}; expected at least {least:g} s")
    if left < 0.9 * whole:
        yield _Note(words)


def stuck_channels(log: FlightLog, vehicle: Vehicle) -> _Findings:
    """Note hung sensors and repeated columns of rotor speeds. A hung sensor's channel stands still
    to the last digit for half a second or more in flight, while the other channels of its kind
    change.
    """
    rotors, seen = log.rotor_speeds, np.flatnonzero(log.valid)
    aloft = rotors**2 @ vehicle.k > 0.3 * vehicle.weight
    # a rotor at its limit, or at full command, stands still rightly
    most = rotors.max() if log.commanded else 0.99 * vehicle.omega_max or np.inf
    turning = (rotors > 0.0) & (rotors < most)
    place, flown = log.position[seen], aloft[seen]
    for i, rows in enumerate((aloft[:, None] & turning).T):
        yield from _still(f"omega{i + 1}", log.t, rows, rotors, [i], "the other rotor speeds")
    for i, axis in enumerate("xyz"):
        yield from _still(f"p{axis}", log.t[seen], flown, place, [i], "the other coordinates")
    pose = np.hstack([place, log.quaternion[seen]])
    yield from _still("the attitude", log.t[seen], flown, pose, [3, 4, 5, 6], "the coordinates")
    said = (f"warning: {doubt}" for doubt in motor_doubts(log))
    yield from (_Note(text) for text in said if text not in log.notes)


def _still(name: str, t: Array, rows: Mask, x: Array, own: list[int], names: str) -> _Findings:
    """Note the stretches of rows (N,) where a channel's ``own`` columns of x (N, k) stand still and
    the other columns, called ``names``, move.
    """
    still = rows & ~np.diff(x[:, own], axis=0, prepend=np.nan).any(axis=1)
    sisters = np.delete(x, own, axis=1)
    for first, end in runs_of(still):
        lasts = t[end - 1] - t[first] >= _STILL
        # of equally often changing channels, one without a change in 20 has a chance of exp(-20)
        if lasts and np.count_nonzero(np.diff(sisters[first:end], axis=0), axis=0).min() < 20:
            still[first:end] = False
    if stretches := _stretches(still, t, _STILL):
        yield _Note(
            f"warning: {name} stands still for {stretches} while {names} change: what depends on "
            "it there is wrong if its sensor hung"
        )


def _stretches(rows: Mask, t: Array, least: float) -> str:
    """Return the longest run of rows (N,) of at least ``least`` s, and the number of such runs, in
    words, or nothing.
    """
    runs = [(t[end - 1] - t[first], -t[first]) for first, end in runs_of(rows)]
    count = sum(seconds >= least for seconds, _ in runs)
    seconds, begin = max(runs, default=(0.0, 0.0))
    return f"{seconds:.3g} s from t = {-begin:.4g} s ({count} in all)" if count else ""
