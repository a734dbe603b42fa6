"""One clock for all sensors of a log, before anything else is asked of the log.

Three comparisons tell three clocks: the gyro against the turns of the attitude, the accelerometer
against the motion of the position, and the rotor speeds against the turns of the attitude
(``pose_delay``). Each offset is searched over +-0.3 s. The scatter between parts of the flight is
its uncertainty.

The IMU's offset beyond noise is corrected. The rotors tell whose clock is wrong: torques turn the
body at once.

An offset between pose and rotor speeds may be a delay of the vehicle. Two facts tell an error of
the clocks: the rotor speeds answer the pose's noise ahead of its rows; or the offset is longer than
any flown vehicle's delay, with and without a lag of the motors. Other offsets are left to the
diagnosis. Rotor speeds from commands have delays of their own, and are left to the diagnosis as
well.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import Akima1DInterpolator
from scipy.spatial.transform import Rotation, Slerp

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import resampled, second_difference
from .evidence import GOOD
from .flight_log import FlightLog, with_rows
from .inertial import (
    STILL,
    WINDOW,
    mean_rate,
    median_square,
    turn_rates,
    unbiased,
    windows,
)
from .pose_delay import FARTHEST, LEAST, SURE, answer_to_noise, pose_delay
from .table import Array, Data, Mask, NamedArrays, Names, Pair, Rows

_COARSE, _FINE = 0.01, 0.001  # s, of the search's steps
# s: between commands and motion lies a motor's lag of about so much. Smaller offsets of an IMU do
# not show whose clock is wrong; for rotor speeds from commands three times as much
_MOTOR_LAG, _TELLING = 0.02, 0.06
# widths of the differences of a pose's noise (10 ms or more): the uncertainty of a loop's answer
# with its reaction, and the smear of its time
_REACTION, _SMEAR = 0.8, 1.5
_PARTS = 4  # of the flight; the scatter of their offsets is the uncertainty
_FEWEST_WINDOWS = 40
_MOVING = 0.3  # m/s2: the acceleration of a hovering vehicle by pose noise
_WHOLE = 2.0  # standard deviations between an offset and whole rows
_GAP = 3.5  # median time steps; rotor speeds are not moved across

_Left = Callable[[float, slice | Rows], float]  # s of delay and windows: a middle squared error


def on_one_clock(log: FlightLog, vehicle: Vehicle | None) -> tuple[FlightLog, Names]:
    """Return a log with IMU, pose and rotor speeds on one clock, and a note on each offset.

    Inertial sensors and poses are moved by whole rows, rotor speeds by interpolation. An IMU beyond
    0.3 s is left out.

    Args:
        log: the flight, as read.
        vehicle: as declared, for the rotors' torques; None: rotors on one side turn the body to the
            other.
    """
    log, of_imu = _with_imu_moved(log, vehicle)
    log, of_rotors = _with_rotors_moved(log, vehicle)
    return log, (*of_imu, *of_rotors)


def _with_imu_moved(log: FlightLog, vehicle: Vehicle | None) -> tuple[FlightLog, Names]:
    """Return a log with IMU and pose on one clock, and a note on an offset beyond 10 ms."""
    late, std = _imu_delay(log)
    if not abs(late) > max(LEAST, SURE * std):
        return log, ()
    if abs(late) > FARTHEST - _COARSE:
        return replace(log, gyro=None, accelerometer=None), (
            f"the IMU's clock is off by more than {FARTHEST:g} s against the pose's: gyro and "
            "accelerometer were left out",
        )
    whose, other = "IMU", "pose"
    rotors = ", by less than the rotor speeds tell whose clock is wrong"
    is_pose = False
    delay = pose_delay(log, vehicle) if log.has_rotor_speeds else None
    lag, least = (_MOTOR_LAG, _TELLING) if log.commanded else (0.0, _MOTOR_LAG)
    if delay is not None and abs(late) > max(least, SURE * delay.std):
        seconds = delay.seconds - lag
        rotors, is_pose = " and the rotor speeds", abs(seconds) > abs(seconds + late)
    if is_pose:  # rotors and IMU share a clock
        whose, other, late = "pose", "IMU", -late
        pose = {"position": log.position, "quaternion": log.quaternion}
        moved = _moved(log.t, log.valid, late, pose)
        log = replace(log, **moved, valid=np.isfinite(moved["position"][:, 0]))
    else:
        for name, x in {"gyro": log.gyro, "accelerometer": log.accelerometer}.items():
            if x is not None:
                log = replace(log, **_moved(log.t, np.isfinite(x[:, 0]), late, {name: x}))
    return log, (_note(whose, late, std, f"{other}{rotors}", f"the {whose} was moved"),)


def _with_rotors_moved(log: FlightLog, vehicle: Vehicle | None) -> tuple[FlightLog, Names]:
    """Return a log with rotor speeds on the clock of its pose, and a note on an offset beyond any
    flown vehicle's delay.
    """
    if log.commanded or not (log.has_rotor_speeds and log.has_pose):
        return log, ()
    delay = pose_delay(log, vehicle)
    if delay is None:
        return log, ()
    late, std, why = delay.seconds, delay.std, "beyond a vehicle's own delay"
    answer = answer_to_noise(log, vehicle, late) if abs(late) > LEAST else None
    if answer is not None:
        ahead, width = answer
        unsure = _REACTION * width
        if abs(ahead - late) < SURE * np.hypot(std, unsure):
            share = unsure**2 / (unsure**2 + std**2)
            late, std = share * late + (1.0 - share) * ahead, float(np.sqrt(share)) * std
            delay = replace(delay, seconds=late, std=std)
            if ahead > _SMEAR * width:
                why = "and the rotor speeds answer the pose's noise ahead of its rows"
                delay = replace(delay, beyond_honest=True)
    # rotor speeds that are held from one measurement to the next are late by as long, at most
    if not (delay.is_clear and delay.beyond_honest) or abs(late) < 1.0 / log.motor_rate:
        return log, ()
    if abs(late) > FARTHEST - LEAST:
        return log, (
            f"the pose is {FARTHEST:g} s or more {'late' if late > 0.0 else 'early'} "
            "against the rotor speeds: the search ends there, and nothing was moved",
        )
    done = "the rotor speeds were moved to the pose's clock"
    return _rotors_later(log, late, std), (_note("pose", late, std, f"rotor speeds, {why}", done),)


def _note(whose: str, late: float, std: float, against: str, done: str) -> str:
    """Return the sentence on a clock ``late`` s behind another."""
    return (
        f"the {whose} is {abs(late):.3f} s {'late' if late > 0.0 else 'early'} against the "
        f"{against} (standard deviation {std:.3f} s); {done}"
    )


def _imu_delay(log: FlightLog) -> Pair:
    """Return the delay in s of the IMU against the pose, and its standard deviation; 0: unknown.

    The gyro tells, else the accelerometer.
    """
    sensors = (log.gyro, 0.0, _turn_errors), (log.accelerometer, WINDOW, _force_errors)
    for measured, before, compared in sensors:
        seen = np.flatnonzero(log.valid)
        if measured is None or not seen.size:
            continue
        read = np.isfinite(measured[:, 0])
        t, pose_times = log.t[read], log.t[seen]
        begins = windows(pose_times, t, before)
        inside = (begins > t[:1] + FARTHEST + before) & (begins < t[-1:] - FARTHEST - WINDOW)
        begins = begins[inside]
        if len(begins) < _FEWEST_WINDOWS:
            continue
        attitude = Rotation.from_quat(log.quaternion[seen], scalar_first=True)
        left, size = compared(begins, t, measured[read], pose_times, attitude, log.position[seen])
        late = _likeliest(left, slice(None))
        if left(late, slice(None)) <= GOOD * size:
            parts = np.array_split(np.arange(len(begins)), _PARTS)
            scatter = np.std([_likeliest(left, part) for part in parts])
            return late, float(scatter / np.sqrt(_PARTS))
    return 0.0, 0.0


def _likeliest(left: _Left, part: slice | Rows) -> float:
    """Return the delay in s with the least error in some windows."""
    found = 0.0
    for reach, step in ((FARTHEST, _COARSE), (_COARSE, _FINE)):
        tried = found + np.arange(-round(reach / step), round(reach / step) + 1) * step
        found = float(tried[np.argmin([left(x, part) for x in tried])])
    return found


def _turn_errors(
    begins: Array, t: Array, gyro: Array, pose_times: Array, attitude: Rotation, position: Array
) -> tuple[_Left, float]:
    """Return the error of a gyro (N, 3) delayed against the attitude, and the turns' own size."""
    turned = turn_rates(begins, pose_times, attitude)
    sum_of = cumulative_trapezoid(gyro, t, axis=0, initial=0.0)

    def left(late: float, part: slice | Rows) -> float:
        return median_square(unbiased(turned[part] - mean_rate(begins[part] + late, t, sum_of)))

    return left, median_square(unbiased(turned)) + STILL**2


def _force_errors(
    begins: Array, t: Array, force: Array, pose_times: Array, attitude: Rotation, position: Array
) -> tuple[_Left, float]:
    """Return the error of an accelerometer (N, 3) delayed against the position's acceleration, and
    the acceleration's own size.
    """
    needed = second_difference(begins, WINDOW, pose_times, position) / WINDOW**2
    at = np.linspace(pose_times[0], pose_times[-1], len(t))
    turn = Slerp(pose_times, attitude)(at)

    def left(late: float, part: slice | Rows) -> float:
        sums = turn.apply(resampled(at + late, t, force))
        for _ in range(2):
            sums = cumulative_trapezoid(sums, at, axis=0, initial=0.0)
        felt = second_difference(begins[part], WINDOW, at, sums) / WINDOW**2
        return median_square(unbiased(needed[part] - felt))

    return left, median_square(unbiased(needed)) + _MOVING**2


def _rotors_later(log: FlightLog, late: float, std: float) -> FlightLog:
    """Return a log with rotor speeds, commands, voltage and truth moved ``late`` s on, to the clock
    of the pose. Rows without a sample on both sides are left out.

    Rotor speeds answer noise from row to row, and an interpolation would smooth the answer. Whole
    rows are taken where the uncertainty ``std`` in s allows.
    """
    whole = round(late / log.period) * log.period
    late = whole if abs(whole - late) < _WHOLE * std else late
    source = log.t - late
    after = np.clip(np.searchsorted(log.t, source), 1, len(log.t) - 1)
    steps = log.t[after] - log.t[after - 1]
    inside = (source >= log.t[0]) & (source <= log.t[-1]) & (steps <= _GAP * log.period)
    moved: Data = {}
    for name in ("rotor_speeds", "command", "voltage", "force", "torque"):
        x = getattr(log, name)
        if x is not None and np.isfinite(x).all():
            moved[name] = Akima1DInterpolator(log.t, x)(np.clip(source, log.t[0], log.t[-1]))
    return with_rows(replace(log, **moved), inside)


def _moved(t: Array, there: Mask, late: float, columns: NamedArrays) -> Data:
    """Return columns (N, k) with the samples ``there`` (N,) moved ``late`` s back in time, to the
    nearest rows; NaN elsewhere.
    """
    source = np.flatnonzero(there)
    when = t[source] - late
    inside = (when >= t[0]) & (when <= t[-1])
    source, when = source[inside], when[inside]
    after = np.clip(np.searchsorted(t, when), 1, len(t) - 1)
    target = after - (when - t[after - 1] < t[after] - when)
    out = {name: np.full_like(x, np.nan) for name, x in columns.items()}
    for name, x in columns.items():
        out[name][target] = x[source]
    return out
