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
from scipy.spatial.transform import Rotation, Slerp

from ..motion.smoothing import resampled, running_integral, second_difference
from .evidence import GOOD
from .flight_log import FlightLog, NotedLog, SomeVehicle, excerpt, with_rows
from .inertial import (
    STILL,
    WINDOW,
    mean_force,
    mean_rate,
    median_square,
    turn_rates,
    unbiased,
    windows,
)
from .pose_delay import FARTHEST, LEAST, SURE, answer_to_noise, pose_delay
from .table import Array, Data, Pair

_COARSE = 0.01  # s, of the search's first steps
_PARTS = 4  # of the flight; the scatter of their offsets is the uncertainty

_Felt = Callable[[float, Array], Array]  # s of delay and windows (n,): a sensor's means (n, 3)


def on_one_clock(log: FlightLog, vehicle: SomeVehicle) -> NotedLog:
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


def _with_imu_moved(log: FlightLog, vehicle: SomeVehicle) -> NotedLog:
    """Return a log with IMU and pose on one clock, and a note on an offset beyond 10 ms."""
    late, std, changes = _imu_delay(log)
    if not (changes or abs(late) > max(LEAST, SURE * std)):
        return log, ()
    if changes or abs(late) > FARTHEST - _COARSE:
        return replace(log, gyro=None, accelerometer=None), (
            f"the IMU's clock is off by {changes or f'more than {FARTHEST:g} s'} against the "
            "pose's: gyro and accelerometer were left out",
        )
    whose, other = "IMU", "pose"
    rotors = ", by less than the rotor speeds tell whose clock is wrong"
    delay = pose_delay(log, vehicle) if log.has_rotor_speeds else None
    # s: between commands and motion lies a motor's lag of about 0.02. Smaller offsets of an IMU do
    # not show whose clock is wrong; for rotor speeds from commands three times as much
    lag, least = (0.02, 0.06) if log.commanded else (0.0, 0.02)
    if delay is not None and abs(late) > max(least, SURE * delay.std):
        rotors = " and the rotor speeds"
        if abs(delay.seconds - lag) > abs(delay.seconds - lag + late):
            whose, other, late = "pose", "IMU", -late  # rotors and IMU share a clock
    names = ("position", "quaternion") if whose == "pose" else ("gyro", "accelerometer")
    moved: Data = {
        name: _moved(log.t, x, late) for name in names if (x := getattr(log, name)) is not None
    }
    log = replace(log, **moved, valid=np.empty(0, np.bool_))
    return log, (_note(whose, late, std, f"{other}{rotors}", f"the {whose} was moved"),)


def _with_rotors_moved(log: FlightLog, vehicle: SomeVehicle) -> NotedLog:
    """Return a log with rotor speeds on the clock of its pose, and a note on an offset beyond any
    flown vehicle's delay.
    """
    if log.commanded or not (log.has_rotor_speeds and log.has_pose):
        return log, ()
    delay = pose_delay(log, vehicle)
    if delay is None:
        return log, ()
    late, std, is_clock = delay
    why = "beyond a vehicle's own delay"
    answer = answer_to_noise(log, vehicle, late) if abs(late) > LEAST else None
    if answer is not None:
        ahead, width = answer
        unsure = 0.8 * width  # of a loop's answer with its reaction
        if abs(ahead - late) < SURE * np.hypot(std, unsure):
            share = unsure**2 / (unsure**2 + std**2)
            late, std = share * late + (1.0 - share) * ahead, float(np.sqrt(share)) * std
            if ahead > 1.5 * width:  # beyond the smear of its time
                why = "and the rotor speeds answer the pose's noise ahead of its rows"
                is_clock = True
    # rotor speeds that are held from one measurement to the next are late by as long, at most
    if not is_clock or abs(late) <= max(LEAST, SURE * std, 1.0 / log.motor_rate):
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


def _imu_delay(log: FlightLog) -> tuple[float, float, str]:
    """Return the delay in s of the IMU against the pose, and its standard deviation; 0: unknown.
    And the delays of the parts, in words, where one delay leaves twice the error of a part's own.

    The gyro tells, else the accelerometer; of a long flight, in windows spread over it.
    """
    log = excerpt(log)
    seen = np.flatnonzero(log.valid)
    for measured, before, least in (
        (log.gyro, 0.0, STILL),
        # m/s2: the acceleration of a hovering vehicle by pose noise
        (log.accelerometer, WINDOW, 0.3),
    ):
        if measured is None or not seen.size:
            continue
        read = np.isfinite(measured[:, 0])
        t, pose_times = log.t[read], log.t[seen]
        begins = windows(pose_times, t, before)
        inside = (begins > t[:1] + FARTHEST + before) & (begins < t[-1:] - FARTHEST - WINDOW)
        begins = begins[inside]
        if len(begins) < 40:
            continue
        attitude = Rotation.from_quat(log.quaternion[seen], scalar_first=True)
        if measured is log.gyro:
            needed = turn_rates(begins, pose_times, attitude)
        else:
            needed = second_difference(begins, WINDOW, pose_times, log.position[seen]) / WINDOW**2
        felt = _felt(t, measured[read], pose_times, attitude, measured is log.gyro)
        late, left = _likeliest(felt, begins, needed)
        if left <= GOOD * (median_square(unbiased(needed)) + least**2):
            parts = [*zip(*(np.array_split(x, _PARTS) for x in (begins, needed)), strict=True)]
            delays, own = zip(*(_likeliest(felt, *part) for part in parts), strict=True)
            common = [GOOD * median_square(unbiased(y - felt(late, x))) for x, y in parts]
            # at most 0.018 s on 34 measured flights
            changes = np.less(own, common).any() and np.ptp(delays) > 0.025
            said = f"{', '.join(f'{x:.3f}' for x in delays)} s in turn" if changes else ""
            return late, float(np.std(delays) / np.sqrt(_PARTS)), said
    return 0.0, 0.0, ""


def _likeliest(felt: _Felt, begins: Array, needed: Array) -> Pair:
    """Return the delay in s with the least error in some windows, and its middle squared error."""
    found = left = 0.0
    for reach, step in ((FARTHEST, _COARSE), (_COARSE, 0.001)):
        tried = found + np.arange(-round(reach / step), round(reach / step) + 1) * step
        left, found = min(
            (median_square(unbiased(needed - felt(x, begins))), x) for x in tried.tolist()
        )
    return found, left


def _felt(t: Array, x: Array, pose_times: Array, attitude: Rotation, is_gyro: bool) -> _Felt:
    """Return a gyro's angular velocity in windows, or an accelerometer's acceleration around times,
    by its samples (N, 3).
    """
    if is_gyro:
        sum_of = running_integral(x, t)
        return lambda late, at: mean_rate(at + late, t, sum_of)
    times = t[(t >= pose_times[0]) & (t <= pose_times[-1])]
    turn = Slerp(pose_times, attitude)(times)
    return lambda late, at: mean_force(at, times, turn.apply(resampled(times + late, t, x)))


def _rotors_later(log: FlightLog, late: float, std: float) -> FlightLog:
    """Return a log with rotor speeds, commands, voltage and truth moved ``late`` s on, to the clock
    of the pose. Rows without a sample on both sides are left out.

    Rotor speeds answer noise from row to row, and an interpolation would smooth the answer. Whole
    rows are taken where the uncertainty ``std`` in s allows.
    """
    from scipy.interpolate import Akima1DInterpolator  # few logs need one

    whole = round(late / log.period) * log.period
    late = whole if abs(whole - late) < 2.0 * std else late
    source = log.t - late
    steps = np.diff(log.t, prepend=-np.inf, append=np.inf)
    # speeds are not moved across a gap
    inside = steps[np.searchsorted(log.t, source, side="right")] <= 3.5 * log.period
    moved: Data = {}
    for name in ("rotor_speeds", "command", "voltage", "force", "torque"):
        x = getattr(log, name)
        if x is not None and np.isfinite(x).all():
            moved[name] = Akima1DInterpolator(log.t, x)(source)
    return with_rows(replace(log, **moved), inside)


def _moved(t: Array, x: Array, late: float) -> Array:
    """Return samples (N, k) moved ``late`` s back in time, to the nearest rows; NaN elsewhere."""
    source = np.flatnonzero(np.isfinite(x[:, 0]) & (t >= t[0] + late) & (t <= t[-1] + late))
    target = np.interp(t[source] - late, t, np.arange(len(t)))
    out = np.full_like(x, np.nan)
    out[np.floor(target + 0.5).astype(int)] = x[source]
    return out
