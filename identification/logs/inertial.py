"""Are a log's gyro and accelerometer what their columns claim: rad/s and m/s2, body axes forward,
left, up?

The pose knows. Over a short window the mean of the gyro is the turn of the
attitude, ``log(q(t)^-1 q(t + T)) / T``, but for a bias; and the accelerometer turned into the
world, averaged twice over ``T``, is the second difference of the position, plus gravity:
``(p(t + T) - 2 p(t) + p(t - T)) / T^2 + g e3``. Both hold whatever the vehicle's model lacks, on
logs of any length. A sensor that contradicts them is left out, with a note: the pose and the rotors
are enough for everything.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation, Slerp

from .evidence import EVIDENCE, ratio
from .flight_log import ACCELEROMETER, GYRO, FlightLog

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InertialSettings:
    """How inertial sensors are compared."""

    window: float = 0.2  # s: 5 mm of pose noise make 0.3 m/s2 over it
    step: float = 0.05  # s between two comparisons
    gap: float = 0.1  # s without a sample, across which nothing is compared
    fewest: int = 10  # comparisons that decide something
    samples: int = 20  # of pose and of sensor that do
    still: float = 0.1  # rad/s: what pose noise makes of the rate of a vehicle that stands still


INERTIAL = InertialSettings()
AXES = {"flu": np.eye(3), "frd": np.diag([1.0, -1.0, -1.0])}  # by which readings are multiplied
_G = 9.80665  # m/s2 in one g
_DEGREES = np.pi / 180.0
_FRD_WORDS = "those of body axes forward, right, down; expected forward, left, up: negate y and z"


def _readings(unit: float, unit_words: str, inverted: str) -> tuple[tuple[Array, str], ...]:
    """Return other readings of a sensor: by what columns are multiplied, and in words."""
    frd = AXES["frd"]
    return (
        (unit * np.eye(3), f"look like {unit_words}"),
        (frd, f"look like {_FRD_WORDS}"),
        (unit * frd, f"look like {unit_words}, and like {_FRD_WORDS}"),
        (-np.eye(3), f"look inverted{inverted}: negate all three"),
    )


GYRO_READINGS = _readings(_DEGREES, "degrees per second; expected rad/s: multiply by 0.0174533", "")
_ACCELEROMETER_READINGS = _readings(
    _G, "g; expected m/s2: multiply by 9.80665", " (gravity, not specific force)"
)
_GRAVITY_LEFT_OUT = (
    "look like an acceleration without gravity; expected the specific force that an accelerometer "
    "measures, 9.81 m/s2 along z in a hover"
)


def check_inertial(log: FlightLog, gravity: float = 9.81) -> tuple[FlightLog, tuple[str, ...]]:
    """Return a log without inertial sensors that contradict its pose, and a note on each.

    Args:
        log: the flight.
        gravity: m/s2, of the vehicle that flew.
    """
    notes = []
    if log.gyro is not None and (doubt := _gyro_doubt(log, log.gyro)):
        notes.append(f"{', '.join(GYRO)} {doubt}. They were left out")
        log = replace(log, gyro=None)
    if log.accelerometer is not None:
        doubt = _accelerometer_doubt(log, log.accelerometer, gravity)
        if doubt:
            notes.append(f"{', '.join(ACCELEROMETER)} {doubt}. They were left out")
            log = replace(log, accelerometer=None)
    return log, tuple(notes)


def _gyro_doubt(log: FlightLog, gyro: Array) -> str:
    """Return what is wrong with a gyro (N, 3), or nothing."""
    read = np.isfinite(gyro[:, 0])
    t, measured = log.t[read], gyro[read]
    if _stuck(measured):
        return "never change: the gyro was not read"
    turns = [np.eye(3), *(A for A, _ in GYRO_READINGS)]
    seen = np.flatnonzero(log.valid)
    rotation = Rotation.from_quat(log.quaternion[seen], scalar_first=True)
    shares = gyro_shares(t, measured, log.t[seen], rotation, turns)
    if shares is None or shares[0] <= EVIDENCE.good:
        return ""
    readings = [
        (float(left), words) for left, (_, words) in zip(shares[1:], GYRO_READINGS, strict=True)
    ]
    return _words(float(shares[0]), readings, "contradict the attitude's rate")


def gyro_shares(
    t: Array, gyro: Array, pose_times: Array, attitude: Rotation, turns: Sequence[Array]
) -> Array | None:
    """Return which share of the attitude's rate a gyro leaves, by each of several readings; None
    where too little is measured.

    Args:
        t: (N,) s, of the gyro.
        gyro: (N, 3) as it stands.
        pose_times: (M,) s.
        attitude: (M) body to world.
        turns: (3, 3) each, by which a reading multiplies the gyro.
    """
    read = np.isfinite(t) & np.isfinite(gyro).all(axis=1)
    t, gyro = t[read], gyro[read]
    begins = _windows(pose_times, t, before=0.0)
    if len(begins) < INERTIAL.fewest:
        return None
    at, ends = Slerp(pose_times, attitude), begins + INERTIAL.window
    turned = (at(begins).inv() * at(ends)).as_rotvec() / INERTIAL.window
    sum_of = cumulative_trapezoid(gyro, t, axis=0, initial=0.0)
    mean = (_at(t, sum_of, ends) - _at(t, sum_of, begins)) / INERTIAL.window
    motion, seen = turned - np.median(turned, axis=0), mean - np.median(mean, axis=0)  # a bias
    size = _middle(motion) + INERTIAL.still**2
    return np.array([_middle(motion - seen @ A.T) / size for A in turns])


def _accelerometer_doubt(log: FlightLog, accelerometer: Array, gravity: float) -> str:
    """Return what is wrong with an accelerometer (N, 3), or nothing."""
    read = np.isfinite(accelerometer[:, 0])
    t, measured = log.t[read], accelerometer[read]
    if _stuck(measured):
        return "never change: the accelerometer was not read"
    middles = _windows(log.t[log.valid], t, before=INERTIAL.window)
    if len(middles) < INERTIAL.fewest:
        return ""
    seen, T = np.flatnonzero(log.valid), INERTIAL.window
    place = [_at(log.t[seen], log.position[seen], middles + k * T) for k in (-1, 0, 1)]
    needed = (place[2] - 2.0 * place[1] + place[0]) / T**2 + np.array([0.0, 0.0, gravity])
    inside = (t >= log.t[seen[0]]) & (t <= log.t[seen[-1]])
    t, measured = t[inside], measured[inside]
    attitude = _attitude(log)(t)

    def mean(readings: Array) -> Array:
        world = attitude.apply(readings)
        speed = cumulative_trapezoid(world, t, axis=0, initial=0.0)
        way = cumulative_trapezoid(speed, t, axis=0, initial=0.0)
        a, b, c = (_at(t, way, middles + k * T) for k in (-1, 0, 1))
        out: Array = (c - 2.0 * b + a) / T**2
        return out

    size = _middle(needed)
    left = _middle(needed - mean(measured)) / size
    if left <= EVIDENCE.good:
        return ""
    readings = [
        (_middle(needed - mean(measured @ A.T)) / size, words)
        for A, words in _ACCELEROMETER_READINGS
    ]
    without = mean(measured) + np.array([0.0, 0.0, gravity])
    readings.append((_middle(needed - without) / size, _GRAVITY_LEFT_OUT))
    return _words(left, readings, "contradict the position's acceleration and gravity")


def _words(left: float, readings: list[tuple[float, str]], else_words: str) -> str:
    best, words = min(readings)
    clear = best <= EVIDENCE.good and ratio(left, best, 3) >= EVIDENCE.refused
    return words if clear else else_words


def _stuck(measured: Array) -> bool:
    return len(measured) >= INERTIAL.samples and bool(np.all(np.ptp(measured, axis=0) == 0.0))


def _middle(vectors: Array) -> float:
    """Return the median squared length of vectors (n, 3): single leaps of a pose do not move it."""
    return float(np.median(np.sum(np.square(vectors), axis=1)))


def _windows(pose_times: Array, sensor_times: Array, before: float) -> Array:
    """Return times (n,) in s around which, from ``before`` before to a window after, neither pose
    nor sensor has a gap.
    """
    if min(len(pose_times), len(sensor_times)) < INERTIAL.samples:
        return np.empty(0)
    first = max(pose_times[0], sensor_times[0]) + before
    last = min(pose_times[-1], sensor_times[-1]) - INERTIAL.window
    if last <= first:
        return np.empty(0)
    count = min(int((last - first) / INERTIAL.step), 100_000)
    times: Array = np.linspace(first, last, count + 1)
    for clock in (pose_times, sensor_times):
        gaps = np.flatnonzero(np.diff(clock) > INERTIAL.gap)
        for a, b in ((clock[i], clock[i + 1]) for i in gaps[:1000]):
            times = times[(times - before >= b) | (times + INERTIAL.window <= a)]
    return times


def _attitude(log: FlightLog) -> Slerp:
    seen = np.flatnonzero(log.valid)
    return Slerp(log.t[seen], Rotation.from_quat(log.quaternion[seen], scalar_first=True))


def _at(t: Array, values: Array, times: Array) -> Array:
    return np.column_stack([np.interp(times, t, column) for column in values.T])
