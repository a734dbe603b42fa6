"""Checks of a log's gyro and accelerometer: rad/s and m/s2, body axes forward, left, up.

The pose knows. Over a short window the mean of the gyro is the turn of the attitude, ``log(q(t)^-1
q(t + T)) / T``, but for a bias. The accelerometer in world axes, averaged twice over ``T``, is the
second difference of the position, plus gravity: ``(p(t + T) - 2 p(t) + p(t - T)) / T^2 + g e3``.
Both hold whatever the vehicle's model lacks, on logs of any length. A contradicting sensor is left
out, with a note: the pose and the rotors are enough for everything. Without a pose, gravity alone
is left to show the accelerometer.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from ..motion.smoothing import resampled, running_integral, second_difference
from .evidence import GOOD, likelihood, remedies
from .flight_log import ACCELEROMETER, GYRO, FlightLog, NotedLog, SomeVehicle, excerpt
from .readings import (
    ACCELEROMETER_READINGS,
    AS_DECLARED,
    DECLARED,
    GYRO_READINGS,
    OTHER,
    SensorReading,
    applied,
)
from .table import Array, Data, Lines, SomeArray, finite_rows, lengths

# How inertial sensors are compared.
WINDOW = 0.2  # s: 5 mm of pose noise make 0.3 m/s2 over it
_FEWEST = 10  # comparisons for a decision
LEAST_SAMPLES = 20  # of pose and of sensor, at least
STILL = 0.1  # rad/s: the rate of a standing vehicle by pose noise
_STRONGEST = 300.0  # m/s2 of specific force, above all racers and most sensors' range
_BY_GRAVITY = [reading for reading in ACCELEROMETER_READINGS if not reading.lacks_gravity]


def check_inertial(log: FlightLog, vehicle: SomeVehicle = None) -> NotedLog:
    """Return a log without the inertial sensors contradicting its pose, and a note on each. They
    stay where they agree with the rotors, and the pose in another convention with all of them: the
    note is on the pose.

    Args:
        log: the flight.
        vehicle: as declared; None: unknown.
    """
    gravity = 9.81 if vehicle is None else vehicle.gravity
    checked, notes = _agreeing(log, gravity)
    if not (notes and log.has_pose and log.has_rotor_speeds):
        return checked, notes
    advice, is_whole = remedies(log, vehicle)
    for reading in advice if is_whole else ():
        if reading.moves != DECLARED.moves and not _agreeing(applied(log, reading), gravity)[1]:
            return log, (
                f"the pose contradicts the inertial sensors and the rotors: {reading.says}",
            )
    return checked, notes


def _agreeing(log: FlightLog, gravity: float) -> NotedLog:
    """Return a log without the inertial sensors contradicting its pose, and a note on each. Windows
    of a long flight are asked.
    """
    notes: Lines = []
    part = excerpt(log)
    seen = np.flatnonzero(part.valid)
    pose = part.t[seen], Rotation.from_quat(part.quaternion[seen], scalar_first=True)
    for field, names in (("gyro", GYRO), ("accelerometer", ACCELEROMETER)):
        values, columns = getattr(part, field), ", ".join(names)
        if values is None or not (read := np.isfinite(values[:, 0])).any():
            continue
        t, measured = part.t[read], values[read]
        if field == "gyro":
            shares = gyro_shares(t, measured, *pose, (AS_DECLARED, *GYRO_READINGS))
            doubt = _sensor_doubt(shares, GYRO_READINGS, "contradict the attitude's rate")
            # 70 rad/s (4000 deg/s) is the range of the fastest gyros
            alone = GYRO_READINGS[0].says if np.quantile(abs(measured), 0.99) > 70.0 else ""
        else:
            shares, up = _force_shares(t, measured, *pose, part.position[seen], gravity)
            if up is not None:
                checked, more = _agreeing(_in_body_axes(log, up), gravity)
                notes.append(
                    f"{columns} are an acceleration in world axes, by the position's own: they "
                    "were turned into body axes by the attitude"
                )
                return checked, (*notes, *more)
            otherwise = "contradict the position's acceleration and gravity"
            doubt = _blown_up(measured) or _sensor_doubt(shares, ACCELEROMETER_READINGS, otherwise)
            alone = gravity_doubt(measured, gravity, is_flight=False)
        if is_stuck(measured):
            doubt = f"never change: the {field} was not read"
        if doubt:
            notes.append(f"{columns} {doubt}. They were left out")
            log = replace(log, **Data({field: None}))
        elif shares is None and alone:  # no pose shows the error
            notes.append(f"{columns} {alone}")
    return log, tuple(notes)


def _in_body_axes(log: FlightLog, up: Array) -> FlightLog:
    """Return a log with its accelerometer, in world axes and less ``up`` (3,), in body axes."""
    assert log.accelerometer is not None
    at = Slerp(log.t[log.valid], Rotation.from_quat(log.quaternion[log.valid], scalar_first=True))
    to_body = at(np.clip(log.t, at.times[0], at.times[-1])).inv()
    return replace(log, accelerometer=to_body.apply(log.accelerometer + up))


def is_stuck(measured: Array) -> bool:
    """Return whether the readings (N, 3) of a sensor are all the same."""
    return len(measured) >= LEAST_SAMPLES and not np.ptp(measured, axis=0).any()


def _sensor_doubt(
    shares: Sequence[float] | None, readings: Sequence[SensorReading], otherwise: str
) -> str:
    """Return the words on a wrong sensor, or nothing.

    Args:
        shares: unexplained shares of variance: as declared, then by each reading; None: unknown.
        readings: the other ones.
        otherwise: words for a sensor without an explanation.
    """
    if shares is None or shares[0] <= GOOD:
        return ""
    declared, *others = likelihood(np.array([shares] * 3).T)
    best = max(others)
    if min(shares[1:]) > GOOD or best - declared < OTHER:
        return otherwise
    alike = [r.says for r, score in zip(readings, others, strict=True) if score > best - 1.0]
    return "; or ".join(alike[:3])


def gyro_shares(
    t: Array,
    gyro: Array,
    pose_times: Array,
    attitude: Rotation,
    readings: Sequence[SensorReading],
) -> list[float] | None:
    """Return the share of the attitude's rate left by a gyro, by each of several readings; None:
    too little is measured.

    Args:
        t: (N,) s, of the gyro.
        gyro: (N, 3) as in the columns.
        pose_times: (M,) s.
        attitude: (M) body to world.
        readings: of the gyro's columns.
    """
    read = np.isfinite(t) & finite_rows(gyro)
    t, gyro = t[read], gyro[read]
    begins = windows(pose_times, t, before=0.0)
    if len(begins) < _FEWEST:
        return None
    motion = unbiased(turn_rates(begins, pose_times, attitude))
    seen = unbiased(mean_rate(begins, t, running_integral(gyro, t)))
    size = median_square(motion) + STILL**2
    return [median_square(motion - seen @ reading.turn.T) / size for reading in readings]


def turn_rates(begins: Array, pose_times: Array, attitude: Rotation) -> Array:
    """Return an attitude's mean angular velocity (n, 3) in windows, rad/s."""
    at = Slerp(pose_times, attitude)
    return np.asarray((at(begins).inv() * at(begins + WINDOW)).as_rotvec() / WINDOW)


def mean_rate(begins: Array, t: Array, sum_of: Array) -> Array:
    """Return the mean (n, 3) in windows of a gyro, by its integral over time (N, 3)."""
    return (resampled(begins + WINDOW, t, sum_of) - resampled(begins, t, sum_of)) / WINDOW


def mean_force(middles: Array, t: Array, force: Array) -> Array:
    """Return a force's (N, 3) means (n, 3) over two windows, weighted as by a second difference."""
    for _ in range(2):
        force = running_integral(force, t)
    return second_difference(middles, WINDOW, t, force) / WINDOW**2


def unbiased(rates: Array) -> Array:
    """Return angular velocities or forces (n, 3) less their medians."""
    return rates - np.median(rates, axis=0)


def _force_shares(
    t: Array,
    measured: Array,
    pose_times: Array,
    attitude: Rotation,
    position: Array,
    gravity: float,
) -> tuple[list[float] | None, SomeArray]:
    """Return the shares of acceleration and gravity left by an accelerometer, as declared and by
    each reading; None: too little is measured. For an acceleration in world axes return the rest
    (3,) of the specific force, too, else None.

    Gravity hides the axes: along z both look alike. The horizontal acceleration of the position
    tells them.
    """
    middles = windows(pose_times, t, before=WINDOW)
    if len(middles) < _FEWEST:
        return None, None
    inside = (t >= pose_times[0]) & (t <= pose_times[-1])
    t, measured = t[inside], measured[inside]
    body = Slerp(pose_times, attitude)(t)
    up = np.array([0.0, 0.0, gravity])
    needed = second_difference(middles, WINDOW, pose_times, position) / WINDOW**2
    # far above pose noise
    moves = lengths(needed[:, :2]) > 0.5
    if moves.sum() >= _FEWEST:
        in_body, in_world = (
            median_square((needed - mean_force(middles, t, x))[moves, :2])
            / median_square(needed[moves, :2])
            for x in (body.apply(measured), measured)
        )
        if in_world <= GOOD and likelihood([in_world] * 2) - likelihood([in_body] * 2) >= OTHER:
            return None, up * (np.median(measured[:, 2]) < 0.5 * gravity)
    needed += up
    size = median_square(needed)
    return [
        median_square(
            needed - mean_force(middles, t, body.apply(measured @ r.turn.T)) - r.lacks_gravity * up
        )
        / size
        for r in (AS_DECLARED, *ACCELEROMETER_READINGS)
    ], None


def _blown_up(force: Array) -> str:
    """Return a doubt on a specific force (n, 3) beyond any flight's, or nothing. Gravity in another
    unit has one direction.
    """
    size = np.linalg.norm(force, axis=1, keepdims=True)
    far = size[:, 0] > _STRONGEST
    share = far.mean()
    if len(force) < LEAST_SAMPLES or share <= 0.01:
        return ""
    # the mean direction's length: gravity's is near 1, that of a tumble far below
    if np.linalg.norm((force[far] / size[far]).mean(axis=0)) > 0.8:
        return ""
    return (
        f"are beyond {_STRONGEST:g} m/s2, in changing directions, in {share:.0%} of the "
        "samples: no quadrotor flies so, but a simulation that blew up does"
    )


def gravity_doubt(force: Array, gravity: float, is_flight: bool = True) -> str:
    """Return gravity's objection to the specific force (n, 3), or nothing; ``is_flight``: upright,
    as in a flight.
    """
    median = np.median(force, axis=0)
    length = np.linalg.norm(median)
    otherwise = (
        f"are {length:.3g} m/s2 in the median of a flight, along a"
        f"{'xyz'[abs(median).argmax()]}; expected the specific force, which gravity makes "
        f"about {gravity:.3g} along az: axes forward, left, up, of the vehicle and not of the "
        "sensor's board"
    )
    if length < 0.5 * gravity:
        otherwise += " (an acceleration without gravity is none)"
    shares = [
        (([0.0, 0.0, gravity] - reading.turn @ median) ** 2).sum() / gravity**2
        for reading in (AS_DECLARED, *_BY_GRAVITY)
    ]
    return _sensor_doubt(shares, _BY_GRAVITY, otherwise if is_flight else "")


def median_square(vectors: Array) -> float:
    """Return the median squared length of vectors (n, 3): robust to single leaps of a pose."""
    return float(np.median((vectors**2).sum(axis=1)))


def windows(pose_times: Array, sensor_times: Array, before: float) -> Array:
    """Return times (n,) in s without a gap of pose or sensor, from ``before`` earlier to a window
    later.
    """
    if min(len(pose_times), len(sensor_times)) < LEAST_SAMPLES:
        return np.empty(0)
    first = max(pose_times[0], sensor_times[0]) + before
    last = min(pose_times[-1], sensor_times[-1]) - WINDOW
    if last <= first:
        return np.empty(0)
    times = np.linspace(first, last, min(int((last - first) / 0.05), 100_000) + 1)
    for clock in (pose_times, sensor_times):
        gaps = np.flatnonzero(np.diff(clock) > 0.1)
        begun = np.searchsorted(clock[gaps], times + WINDOW)
        times = times[begun == np.searchsorted(clock[gaps + 1], times - before, "right")]
    return times
