"""A map for a table that brings none: guessed from the columns' names, the size of their numbers,
and the physics that every flight obeys. Each field says whether it is certain, and why.

A unit in a name is taken at its word. What names do not say, the flight does: the specific force
points along the thrust axis, so a horizontal acceleration is gravity times the tilt, which tells
the quaternion's order and sense, frames, degrees and millimetres; rotors turn the body towards the
side that they push up, which tells their order. A flight that hardly moves tells neither, and then
the field is a guess.
"""

import io
import re
import warnings
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .column_names import PLACES, Group, Name, best_group, groups_of, take_apart
from .evidence import EVIDENCE, Evidence, Ranking, ratio
from .inertial import gyro_shares
from .log_map import (
    ACCELERATION_UNITS,
    ANGLE_UNITS,
    COMMAND_UNITS,
    LENGTH_UNITS,
    RATE_UNITS,
    ROTOR_UNITS,
    TIME_UNITS,
    VOLTAGE_UNITS,
    Attitude,
    Battery,
    Columns,
    Commands,
    LogMap,
    Rotors,
    Sensor,
    TimeColumn,
)
from .magnitudes import MAGNITUDES, carrying_units, thrust_by_weight, time_unit, within
from .readings import BODY_AXES, DECLARED, ROTORS, rotations, table_readings
from .rotor_orders import ORDERS, Order, order_names, order_words
from .table import Table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GuessSettings:
    """When a field is certain."""

    rpm: float = 4500.0  # median above which no unit but rpm is left: no propeller turns at that
    # rate in rad/s
    counts: float = 20_000.0  # median above which rpm may also be a command of 16 bits
    fast_gyro: float = 35.0  # beyond the range of gyros in rad/s (2000 deg/s)
    slow_gyro: float = 6.0  # below which 99.5 % of a flight's angular velocities lie in rad/s
    longest: float = 480.0  # s of the flight that are looked at, its middle


GUESS = GuessSettings()
_Choice = tuple[str, bool, str]  # what is taken, whether it is certain, and why
_G = ACCELERATION_UNITS["g"]


@dataclass(frozen=True)
class Reason:
    """Why a field is what it is."""

    section: str
    field: str
    certain: bool
    why: str


@dataclass(frozen=True)
class Guess:
    """A map that was guessed."""

    log_map: LogMap
    reasons: tuple[Reason, ...]
    unused: tuple[str, ...] = ()  # columns

    @property
    def doubts(self) -> tuple[Reason, ...]:
        """The fields that are not certain."""
        return tuple(reason for reason in self.reasons if not reason.certain)


@dataclass
class _Found:
    """What was found so far."""

    table: Table
    vehicle: Vehicle | None
    data: dict[str, Array] = field(default_factory=dict)
    reasons: list[Reason] = field(default_factory=list)

    def say(self, section: str, name: str, certain: bool, why: str) -> None:
        self.reasons.append(Reason(section, name, certain, why))

    def values(self, group: Group | Columns) -> Array:
        return np.column_stack([self.data[name] for name in group.columns])

    def unit(
        self, section: str, named: str, known: Container[str], guess: Callable[[], _Choice]
    ) -> str:
        """Return a section's unit: as its columns' names say, or as guessed."""
        unit, sure, why = (named, True, "by the columns' names") if named in known else guess()
        self.say(section, "unit", sure, f"{unit}: {why}")
        return unit


_POSITION = (
    r"p|pos|position|pose_position|local_position|location|loc",
    r"(mocap|vicon|optitrack|opti|qualisys|gt|ground_truth|body|rigid_body|drone|quad|uav)"
    r"(_(p|pos|position))?",
    r"(stateestimate|state_estimate|state|est|estimate|odom|odometry|ekf|local|world|pose)"
    r"(_(p|pos|position))?",
    r"p_.*|pos_.*|position_.*|.*_pos|.*_position|.*_p|translation.*",
    r"",
)
_QUATERNION = (
    r"q|quat|quaternion|attitude_q|orientation|pose_orientation|rot|rotation|att|attitude",
    r".*(_|^)(q|quat|quaternion|orientation|rotation|att|attitude)",
    r".*quat.*|.*orient.*|(stateestimate|est)_q",
)
_ANGLES = (
    r"",
    r"mocap|vicon|stateestimate|est|att|attitude|euler|angle|angles|orientation|rpy|pose",
    r"(?!.*(rate|vel|gyro|omega|speed)).*",
)
_ACCELEROMETER = (
    r"a|acc|accel|accelerometer|imu_a|imu_acc|imu_accel|linear_acceleration|imu_linear_acceleration",
    r"spec_force|specific_force|accsmooth|imu_accelerometer|.*accelerometer.*|a_imu|acc_.*|.*_acc",
)
_GYRO = (
    r"g|gyr|gyro|gyroscope|imu_g|imu_gyr|imu_gyro|angular_velocity|imu_angular_velocity|gyroadc",
    r"w|omega|rate|rates|ang_vel|angvel|body_rate|body_rates|.*gyro.*|w_imu|.*angular_velocity.*",
)
_ROTORS = (
    r"e?rpm|rotor_rpm|motor_rpm|esc_rpm|m_rpm|motor_e?rpm",
    r"omega|w|rotor|rotor_speed|rotor_speeds|motor_speed|motor_speeds|rotor_velocity|n|speed|prop",
    r".*(rpm|omega|rotor|speed).*",
)
_COMMANDS = (
    r"cmd|command|pwm|motor_pwm|pwm_m|motor_cmd|throttle|duty|u|act|actuator|output|out|thr",
    r"rcou_c|servo|servo_output|control|motor_m|motors?|m|motor_output|c",
    r".*(pwm|cmd|command|duty|throttle|output|motor|actuator).*",
)
_VOLTAGE = ("vbat", "battery", "voltage", "vbatlatest", "bat", "batt", "pm_vbat", "battery_voltage")
_TIMES = ("t", "time", "timestamp", "stamp", "timestamps", "clock", "times", "timeus", "elapsed")


# a part of the table, and the field of the map that names its columns
_COLUMN_FIELDS = {
    "position": ("position", "columns"),
    "quaternion": ("attitude", "order"),
    "angles": ("attitude", "columns"),
    "accelerometer": ("accelerometer", "columns"),
    "gyro": ("gyro", "columns"),
}


def guess_map(table: Table, vehicle: Vehicle | None = None, name: str = "guess") -> Guess:
    """Return a guessed map of a table.

    Args:
        table: of any columns, with a line of units where it has one.
        vehicle: that flew, whose weight and rotors tell the rotors' unit; None: not known.
        name: of the map.

    Raises:
        InputError: no columns look like a time, a pose or an IMU, and motors; the message says
            which are missing.
    """
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # columns that hold nothing, or the absurd
        return _guess(table, take_apart(table.header, table.units), vehicle, name)


def _guess(table: Table, names: list[Name], vehicle: Vehicle | None, name: str) -> Guess:
    clock = _time_column(table, names)
    parts, rivals = _groups([n for n in names if n.column != clock.column])
    if parts["position"] is None or not (parts["quaternion"] or parts["angles"]):
        parts["position"] = parts["quaternion"] = parts["angles"] = None
    _check_enough(table, parts)
    wanted = [clock.column, *(c for group in parts.values() if group for c in group.columns)]
    found = _Found(table, vehicle, table.read(list(dict.fromkeys(wanted))))
    t, time = _time(found, clock)
    for part, (section, name_of_field) in _COLUMN_FIELDS.items():
        group = parts[part]
        if group is not None and rivals[part] > 1:
            why = f"{rivals[part]} groups of columns look like it; taken: {group.columns[0]} ..."
            found.say(section, name_of_field, False, why)
    given: dict[str, Any] = {"time": time, "name": name}
    pose = None
    if parts["position"] is not None:
        pose = _pose(found, parts, t)
        given |= pose.sections
    given |= _imu(found, parts, t, pose)
    for kind in ("motors", "commands"):
        if parts[kind] is not None:
            given |= _motors(found, parts[kind], t, pose, given)
    given |= _battery(found, parts["battery"])
    unused = tuple(c for c in table.header if c not in wanted)
    return Guess(LogMap(**given), tuple(found.reasons), unused)


def _time_column(table: Table, names: list[Name]) -> Name:
    for word in _TIMES:
        for name in names:
            if name.base == word:
                return name
    for name in names:
        if name.base.startswith(("time", "timestamp")) or name.base.endswith(("time", "timestamp")):
            return name
    first = names[0]
    try:
        values = table.read([first.column])[first.column]
    except InputError:
        values = np.zeros(2)
    if len(values) > 2 and np.all(np.diff(values) > 0.0):
        return first
    raise InputError(
        f"{table.path}: no column looks like a time; expected one such as t, time or timestamp, "
        f"found {', '.join(table.header[:20])}"
    )


def _groups(names: list[Name]) -> tuple[dict[str, Group | None], dict[str, int]]:
    """Return the columns of each kind, by their names, and how many groups look like each."""
    rivals = dict.fromkeys(_COLUMN_FIELDS, 1)
    triples = [*groups_of(names, "xyz"), *groups_of(names, ("north", "east", "down"))]
    threes = groups_of(names, "012", numbered=True)
    fours = [g for ends in ("1234", "0123") for g in groups_of(names, ends, numbered=True)]
    quaternion, rivals["quaternion"] = best_group(groups_of(names, "wxyz"), _QUATERNION)
    if quaternion is None:
        quaternion, _ = best_group(fours, _QUATERNION[:2])
    taken = set(quaternion.columns) if quaternion else set()
    triples = [g for g in triples if not taken & set(g.columns)]
    angles, rivals["angles"] = best_group(groups_of(names, ("roll", "pitch", "yaw")), _ANGLES)
    if angles is None:
        angles, _ = best_group(groups_of(names, ("phi", "theta", "psi")), _ANGLES)
    accelerometer, rivals["accelerometer"] = best_group([*triples, *threes], _ACCELEROMETER)
    gyro, rivals["gyro"] = best_group([*triples, *threes], _GYRO)
    if gyro is None:
        gyro = next((g for g in groups_of(names, "pqr") if g.key in ("", "rate", "body")), None)
    placed = [group for endings in PLACES for group in groups_of(names, endings)]
    free = [g for g in fours if not taken & set(g.columns)]
    motors, _ = best_group(free, _ROTORS)
    commands, _ = best_group([g for g in free if g != motors], _COMMANDS)
    for sensor in (accelerometer, gyro):
        triples = [g for g in triples if sensor is None or g.columns != sensor.columns]
    position, rivals["position"] = best_group(triples, _POSITION)
    battery = next(
        (
            Group((n.column,), n.base, n.unit)
            for word in _VOLTAGE
            for n in names
            if n.base == word or n.base.endswith(f"_{word}")
        ),
        None,
    )
    parts: dict[str, Group | None] = {
        "position": position,
        "quaternion": quaternion,
        "angles": None if quaternion else angles,
        "accelerometer": accelerometer,
        "gyro": gyro,
        "motors": placed[0] if placed else motors,
        "commands": commands,
        "battery": battery,
    }
    return parts, rivals


def _check_enough(table: Table, parts: Mapping[str, Group | None]) -> None:
    missing = []
    if parts["position"] is None and not (parts["accelerometer"] and parts["gyro"]):
        missing.append(
            "a pose (such as x, y, z, qw, qx, qy, qz or roll, pitch, yaw) or an IMU (such as ax, "
            "ay, az, gx, gy, gz)"
        )
    if parts["motors"] is None and parts["commands"] is None:
        missing.append("four motors (such as rpm1 to rpm4, motor[0] to motor[3])")
    if missing:
        raise InputError(
            f"{table.path}: no columns look like {' or like '.join(missing)}; found "
            f"{', '.join(table.header[:40])}. Write a map by hand"
        )


def _time(found: _Found, name: Name) -> tuple[Array, TimeColumn]:
    raw = found.data[name.column]
    steps = np.diff(raw[np.isfinite(raw)])
    steps = steps[steps > 0.0]
    if not steps.size:
        raise InputError(
            f"{found.table.path}: column {name.column}: no increasing times; expected a time"
        )
    step = float(np.median(steps))

    def guess() -> _Choice:
        unit, sure = time_unit(step)
        return unit, sure, f"{1.0 / max(step * TIME_UNITS[unit], 1e-300):.4g} rows a second"

    unit = found.unit("time", name.unit, TIME_UNITS, guess)
    t = (raw - raw[np.isfinite(raw)][0]) * TIME_UNITS[unit]
    middle = 0.5 * (np.nanmin(t) + np.nanmax(t))
    t[~(np.abs(t - middle) <= 0.5 * GUESS.longest)] = np.nan
    return t, TimeColumn(name.column, unit)


@dataclass(frozen=True, eq=False)
class _Pose:
    """How a table's pose is read, the evidence, and the sections of the map."""

    ranking: Ranking
    position: Array  # columns (N, 3)
    attitude: Array  # columns (N, 3 or 4)
    sections: dict[str, Any]

    @property
    def is_sure(self) -> bool:
        """Whether the body's turning is known."""
        return self.ranking.certain("world", "body", "sense", "order", "pitch_sign", "unit")


def _pose(found: _Found, parts: Mapping[str, Group | None], t: Array) -> _Pose:
    """Return what a table's pose makes of the map."""
    place, quaternion, angles = parts["position"], parts["quaternion"], parts["angles"]
    group, motors = quaternion or angles, parts["motors"] or parts["commands"]
    assert place is not None
    assert group is not None
    assert motors is not None
    position, attitude = found.values(place), found.values(group)
    units: tuple[str, ...] = ("deg", "rad")
    if group.unit in units:
        units = (group.unit,)
    elif np.nanmax(np.abs(attitude[:, :2]), initial=0.0) > np.pi:
        units = ("deg",)
    orders = () if quaternion is None else ("wxyz", "xyzw") if quaternion.numbered else ("wxyz",)
    readings = table_readings(
        orders,
        units,
        lengths=(place.unit,) if place.unit in LENGTH_UNITS else ("m", "cm", "mm"),
        hint="ned" if re.search("ned|down", "".join(place.columns).lower()) else "",
    )
    evidence = Evidence(t, np.square(found.values(motors)), position, attitude)
    ranking = Ranking.of(evidence, readings)
    best = ranking.best

    def by_motion(prop: str) -> _Choice:
        value, (other, lead) = getattr(best, prop), ranking.other(prop)
        why = f"{ranking.fit.horizontal:.0%} of the horizontal acceleration is left by the tilt"
        if other is not None and lead > 0.0:
            why += f", and {other} is less likely by a log-likelihood ratio of {lead:.3g}"
        return value, ranking.certain(prop), why

    told = [("world", "", "world"), ("body", "", "body"), ("attitude", "sense", "sense")]
    found.unit("position", place.unit, LENGTH_UNITS, lambda: by_motion("length"))
    if quaternion is None:
        signs = (1, best.pitch_sign, 1) if best.pitch_sign < 0 else ()
        made = Attitude(
            group.columns, unit=best.unit, euler=best.euler, sense=best.sense, signs=signs
        )
        found.unit(
            "attitude",
            group.unit,
            ANGLE_UNITS,
            lambda: by_motion("unit") if len(units) > 1 else (best.unit, True, "angles beyond pi"),
        )
        told += [("attitude", "euler", "euler"), ("attitude", "signs", "pitch_sign")]
    else:
        made = Attitude(group.columns, order=best.order, sense=best.sense)
        if quaternion.numbered:
            told.append(("attitude", "order", "order"))
        else:
            found.say("attitude", "order", True, "by the columns' names")
    for section, name, prop in told:
        value, sure, why = by_motion(prop)
        found.say(section, name, sure, f"{value}: {why}")
    sections = {
        "world": best.world,
        "body": best.body,
        "position": Columns(place.columns, best.length),
        "attitude": made,
    }
    return _Pose(ranking, position, attitude, sections)


def _imu(
    found: _Found, parts: Mapping[str, Group | None], t: Array, pose: _Pose | None
) -> dict[str, Any]:
    """Return the sections of the inertial sensors."""
    out: dict[str, Any] = {}
    acc, gyro = parts["accelerometer"], parts["gyro"]
    axes, sure_axes = "flu", False
    if acc is not None:
        values = found.values(acc)
        size = float(np.nanmedian(np.linalg.norm(values, axis=1)))
        z = float(np.nanmean(values[:, 2])) / max(size, 1e-12)
        axes = "flu" if z > 0.0 else "frd"
        # without a pose, turned over may also be gravity in place of the specific force
        sure_axes = abs(z) > 0.8 and (z > 0.0 or pose is not None)
        unit, scale = _acceleration_unit(found, acc.unit, size)
        why = f"{axes}: along z it reads {'+' if z > 0 else '-'}{abs(z):.2f} of its size"
        found.say("accelerometer", "body", sure_axes, why)
        out["accelerometer"] = Sensor(acc.columns, unit, scale=scale, body=axes)
        if pose is None:
            out["body"] = axes
    if gyro is not None:
        values = found.values(gyro)
        units = (gyro.unit,) if gyro.unit in ("rad/s", "deg/s") else ("rad/s", "deg/s")
        if pose is None:
            high = float(np.nanquantile(np.abs(values), 0.995))
            guessed = "deg/s" if high > GUESS.slow_gyro else "rad/s"
            by_size = guessed, high > GUESS.fast_gyro, f"its fast values are {high:.3g}"
            found.say("gyro", "body", sure_axes, "as the accelerometer's")
        else:
            guessed, axes, sure, why = _gyro_by_pose(t, values, pose, units)
            by_size = guessed, sure, why
            found.say("gyro", "body", sure, f"{axes}: {why}")
        unit = found.unit("gyro", gyro.unit, RATE_UNITS, lambda: by_size)
        out["gyro"] = Sensor(gyro.columns, unit, body=axes)
    return out


def _gyro_by_pose(
    t: Array, values: Array, pose: _Pose, units: Sequence[str]
) -> tuple[str, str, bool, str]:
    """Return a gyro's unit and body axes, whether they are sure, and why."""
    good, rotation = rotations(pose.attitude, pose.ranking.best)
    rows = np.flatnonzero(good)
    rows = rows[np.isfinite(t[rows])]
    ways = list(product(units, BODY_AXES))
    turns = [RATE_UNITS[unit] * BODY_AXES[body] for unit, body in ways]
    shares = gyro_shares(t, values, t[rows], rotation[np.isfinite(t[good])], turns)
    if shares is None:
        return *ways[0], False, "the log is too short"
    first, second = np.argsort(shares)[:2]
    clear = ratio(shares[second], shares[first], 3) >= EVIDENCE.certain
    sure = pose.is_sure and shares[first] <= EVIDENCE.good and clear
    return *ways[first], sure, f"{shares[first]:.0%} of the attitude's rate is left unexplained"


def _acceleration_unit(found: _Found, named: str, size: float) -> tuple[str, float]:
    """Return an accelerometer's unit, and its scale to m/s2 where the unit is raw."""
    likely = [
        u for u in ("m/s2", "g") if within(size * ACCELERATION_UNITS[u] / _G, MAGNITUDES.gravity)
    ]
    why = f"its median size is {size:.4g}"
    if named in ("m/s2", "g") or likely:
        return found.unit(
            "accelerometer", named, ("m/s2", "g"), lambda: (likely[0], True, why)
        ), 1.0
    why = f"raw: {why}, which is taken for the 9.81 m/s2 of a hover"
    found.say("accelerometer", "scale", False, why)
    return "raw", float(f"{_G / max(size, 1e-12):.6g}")


def _motors(
    found: _Found,
    group: Group | None,
    t: Array,
    pose: _Pose | None,
    given: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the section of rotor speeds or commands; nothing where the map has it already."""
    assert group is not None
    values = found.values(group)
    kind, unit, sure, why = motor_unit(group, values, found.vehicle)
    if kind in given:
        return {}
    found.say(kind, "unit", sure, f"{unit}: {why}")
    order, sure, why = _order(found, group, values, t, pose, given.get("gyro"))
    found.say(kind, "order", sure, why)
    if kind == "rotors":
        if unit == "eRPM":
            found.say(kind, "pole_pairs", False, "7, of most motors of small racers")
        pairs = 7 if unit == "eRPM" else 1
        return {kind: Rotors(group.columns, unit, order=order, pole_pairs=pairs)}
    limits = COMMAND_UNITS[unit] or (0.0, 65535.0)
    if unit in ("us", "counts", "dshot"):
        found.say(kind, "range", False, f"{limits[0]:g} to {limits[1]:g}, the usual one")
    return {kind: Commands(group.columns, unit, order=order, range=limits)}


def motor_unit(group: Group, values: Array, vehicle: Vehicle | None) -> tuple[str, str, bool, str]:
    """Return whether columns are rotors or commands, their unit, if that is certain, and why."""
    names = " ".join(group.columns).lower()
    turning = values[np.isfinite(values)]
    turning = np.abs(turning[turning != 0.0])
    if not turning.size:
        return "commands", "normalised", False, "all are zero"
    low, middle, high = (float(x) for x in np.quantile(turning, [0.01, 0.5, 1.0]))
    if group.unit in ROTOR_UNITS:
        return "rotors", group.unit, True, "by the columns' names"
    if "erpm" in names:
        return "rotors", "eRPM", True, "by the columns' names"
    if "rpm" in names:
        return "rotors", "rpm", True, "by the columns' names"
    if high <= 1.0:
        sure = "omega" not in names and "rpm" not in names
        return "commands", "normalised", sure, f"values up to {high:.3g}"
    if group.unit == "us":
        return "commands", "us", True, "by the columns' names"
    if group.unit == "percent":
        return "commands", "percent", True, "by the columns' names"
    is_command = any(word in names for word in _COMMAND_WORDS)
    pulses = low >= 850.0 and high <= 2250.0
    if is_command and pulses:
        return "commands", "us", True, f"values from {low:.4g} to {high:.4g}"
    if is_command and high <= 100.0:
        return "commands", "percent", False, f"values up to {high:.3g}"
    if is_command and high <= 65535.0 and middle > 4000.0:
        return "commands", "counts", False, f"values up to {high:.6g}"
    if vehicle is not None and not is_command:
        there = values[np.isfinite(values).all(axis=1)]
        fitting = [u for u in carrying_units(thrust_by_weight(there, vehicle)) if u in ROTOR_UNITS]
        if len(fitting) == 1:
            why = f"in it the rotors carry the weight of {vehicle.name}"
            # numbers of 1000 to 2000 may be pulses as well, whatever they would carry
            named = any(w in names for w in ("omega", "speed", "rotor"))
            doubt = "pulses in us" if pulses else "percents" if high <= 100.0 else ""
            if doubt and not named:
                why += f", though they may be {doubt}"
            return "rotors", fitting[0], named or not doubt, why
    if middle > GUESS.counts and high <= 65535.5 and not is_command:
        why = f"values up to {high:.6g}, which may be 16 bits of a command, or rpm"
        return "commands", "counts", False, why
    if middle > GUESS.rpm and not is_command:
        return "rotors", "rpm", True, f"the median is {middle:.5g}, too fast for rad/s"
    if pulses and "omega" not in names:
        return "commands", "us", False, f"values from {low:.4g} to {high:.4g}"
    return "rotors", "rad/s", False, f"the median is {middle:.4g}; it might be rpm or Hz"


_COMMAND_WORDS = ("pwm", "cmd", "command", "servo", "out", "throttle", "duty", "actuator")
_HINTS = {  # words in names, and whose order they speak for
    "motor[0]": "betaflight",
    "motor.m1": "crazyflie",
    "motor_m1": "crazyflie",
    "output[0]": "px4-x",
    "rcou": "ardupilot-x",
}


def _order(
    found: _Found,
    group: Group,
    values: Array,
    t: Array,
    pose: _Pose | None,
    gyro: Sensor | None,
) -> tuple[Order, bool, str]:
    """Return the order of the rotors, whether it is certain, and why."""
    if not group.numbered:
        return ORDERS["windwrench"], True, "the columns are named by the rotors' places"
    text = " ".join(group.columns).lower()
    hint = next((name for word, name in _HINTS.items() if word in text), "windwrench")
    evidence, best = None, DECLARED
    if gyro is not None:
        rates = found.values(gyro) * RATE_UNITS[gyro.unit] @ BODY_AXES[gyro.body]
        evidence = Evidence(t, np.square(values), gyro=rates)
    elif pose is not None and pose.is_sure:
        best = pose.ranking.best
        evidence = Evidence(t, np.square(values), pose.position, pose.attitude)
    if evidence is None or not evidence.enough:
        return ORDERS[hint], False, f"{hint}: the log does not show how the body turns"
    ways = [replace(best, rotors=(a, b, c, d)) for a, b, c, d in permutations(ROTORS)]
    ranking = Ranking.of(evidence, ways, torques=True)
    left, lead = ranking.fit.torque, ranking.other("rotors")[1]
    order = ranking.best.motors
    names = order_names(order)
    why = (
        f"{names[0] if names else order_words(order)}: {left:.0%} of the angular acceleration is "
        f"left, and the next best is less likely by a log-likelihood ratio of {lead:.3g}"
    )
    turns = evidence.turns(best) >= EVIDENCE.turning
    if left <= EVIDENCE.good_torque and ranking.certain("rotors") and turns:
        return order, True, why
    if names and left <= 0.9 and lead >= EVIDENCE.unusual:
        return order, False, why
    return ORDERS[hint], False, f"{hint}: no order is much likelier than all others"


def _battery(found: _Found, group: Group | None) -> dict[str, Any]:
    if group is None:
        return {}
    values = found.values(group)
    values = values[np.isfinite(values) & (values > 0.0)]
    if not values.size:
        return {}
    middle = float(np.median(values))
    guess = "V" if middle < 100.0 else "cV" if middle < 2700.0 else "mV"
    sure = middle < 60.0 or 2700.0 < middle < 60_000.0
    why = f"its median is {middle:.4g}"
    unit = found.unit("battery", group.unit, VOLTAGE_UNITS, lambda: (guess, sure, why))
    return {"battery": Battery(group.columns, unit)}


def map_yaml(guess: Guess) -> str:
    """Return a guessed map as a YAML file; comments say what is certain and what is a guess."""
    m = guess.log_map
    said: dict[str, list[Reason]] = {}
    for reason in guess.reasons:
        said.setdefault(reason.section, []).append(reason)
    out = io.StringIO()
    out.write("# A map of this table's columns. What is marked GUESS: check it.\n")

    def section(name: str, value: object) -> None:
        for reason in said.get(name, []):
            mark = "certain" if reason.certain else "GUESS"
            out.write(f"# {mark}: {f'{reason.field}: ' if reason.field else ''}{reason.why}\n")
        if isinstance(value, str):
            out.write(f"{name}: {value}\n")
            return
        text = yaml.safe_dump(
            {name: value}, default_flow_style=None, sort_keys=False, width=1000, allow_unicode=True
        )
        out.write(text)

    if m.vehicle:
        section("vehicle", m.vehicle)
    section("time", {"column": m.time.column, "unit": m.time.unit})
    section("world", m.world)
    section("body", m.body)
    for name, part in m.sections.items():
        section(name, _fields(part))
    if guess.unused:
        out.write(f"# columns that are not used: {', '.join(guess.unused)}\n")
    return out.getvalue()


def _fields(part: Columns) -> dict[str, Any]:
    """Return a section as its fields stand in the file: those that are not as usual."""
    fields = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in vars(part).items()
        if value not in ("", (), None, False, 1)
    }
    if isinstance(part, Battery):
        fields = {"column": fields.pop("columns")[0], **fields}
    if isinstance(part, Rotors | Commands):
        fields["order"] = [*order_names(part.order), list(part.order)][0]
    if fields.get("euler"):
        del fields["order"]  # of a quaternion
    return fields
