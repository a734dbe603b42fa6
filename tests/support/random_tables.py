"""Known flights written as tables in random conventions: names, separators, units, frames, orders.

The writing shares no code with the reading: what it writes comes from the map's words alone.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.identification.logs.log_map import (
    Attitude,
    Battery,
    Columns,
    Commands,
    LogMap,
    Rotors,
    Sensor,
    TimeColumn,
)
from windwrench.identification.logs.what_flew import ORDERS

_TIMES = ("t", "time", "timestamp", "Time", "timestamp_{u}", "time ({u})", "Time [{u}]")
_PLACES = ("{a}", "p{a}", "pos_{a}", "position.{a}", "mocap_{a}", "Position {A} [{u}]", "{a}_{u}")
_QUATERNIONS = ("q{a}", "quat_{a}", "orientation.{a}", "q.{a}", "pose.orientation.{a}")
_NUMBERED = ("q[{n}]", "q{n}", "quat_{n}")
_ANGLES = ("{a}", "{A}", "{a}_{u}", "att.{a}", "{a} [{u}]")
_GYROS = ("g{a}", "gyro_{a}", "gyro.{a}", "angular_velocity.{a}", "w{a}", "gyro_{a} [{u}]")
_ACCELEROMETERS = ("a{a}", "acc_{a}", "acc.{a}", "linear_acceleration.{a}", "accel_{a} [{u}]")
_SPEEDS = ("m{i}", "omega{i}", "rotor_speed_{i}", "w{i}", "motor[{n}]", "motor_{i}", "prop{i}")
_COMMANDS = ("cmd{i}", "motor[{n}]", "m{i}", "output[{n}]", "throttle_{i}", "u{i}")
_PULSES = ("pwm{i}", "motor_pwm_{i}", "servo{i}", "motor[{n}]", "pwm[{n}]")
_VOLTS = ("vbat", "battery", "voltage", "battery_voltage", "vbat [{u}]")

_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_LENGTH = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
_SPEED = {"rad/s": 1.0, "rpm": pi / 30.0, "Hz": 2.0 * pi}
_SPEED_NAMES = {"rpm": "rpm{i}", "eRPM": "eRPM[{n}]"}


@dataclass(frozen=True, eq=False)
class Written:
    """A table that was written: the flight, what its columns mean, and its text."""

    log: FlightLog
    log_map: LogMap
    text: str


def flight(vehicle, trajectory, seed, seconds=20.0):
    """Return a simulated flight with an IMU and motor commands (rotor speed by 1.25 times the
    fastest).
    """
    c = record_flight(load_vehicle(vehicle), (), trajectory, seconds, seed, imu=True)
    rng = default_rng(seed)
    c["accelerometer"] += 0.1 * rng.standard_normal(c["accelerometer"].shape)
    c["gyro"] += 0.01 * rng.standard_normal(c["gyro"].shape)
    return FlightLog(
        **{"voltage": np.full(len(c["t"]), 11.1)} | c,
        command=np.clip(c["rotor_speeds"] / (1.25 * c["rotor_speeds"].max()), 0.0, 1.0),
        name=f"{vehicle}_{trajectory}_{seed}",
        vehicle=vehicle,
    )


def random_table(log, rng, imu_only=0.15):
    """Return a flight as a table in a random convention.

    Args:
        log: the flight.
        rng: draws the convention.
        imu_only: share of tables without a pose.
    """

    def pick(items):
        return items[int(rng.integers(len(items)))]

    has_pose = bool(rng.random() >= imu_only)
    has_imu = not has_pose or bool(rng.random() < 0.4)
    world, body = pick((("enu", "flu"), ("ned", "frd"), ("enu", "flu"), ("enu", "frd")))
    columns = {}

    unit = pick(tuple(_TIME))
    begin = pick((0.0, 12.5, 1.7e9 if unit == "s" else 50.0))
    name = pick(_TIMES).format(u=unit)
    columns[name] = (log.t + begin) / _TIME[unit]
    parts = {"time": TimeColumn(name, unit), "world": world, "body": body}

    turn = np.array([1.0, -1.0, -1.0])
    world_turn = turn if world == "ned" else np.ones(3)
    body_turn = turn if body == "frd" else np.ones(3)
    if has_pose:
        parts |= _pose(log, columns, world_turn, body_turn, pick)
    if has_imu:
        parts |= _imu(log, columns, body_turn, body, pick)
    parts |= _motors(log, columns, pick)
    if rng.random() < 0.5 and log.voltage is not None:
        unit = pick(("V", "mV"))
        name = pick(_VOLTS).format(u=unit)
        columns[name] = log.voltage / (1.0 if unit == "V" else 1e-3)
        parts["battery"] = Battery((name,), unit)
    _distract(log, columns, rng, pick)
    separator = pick((",", ";", "\t", " "))
    if separator == " " and any(" " in name for name in columns):
        separator = ";"
    decimal = pick((".", ",")) if separator != "," else "."
    text = _text(columns, separator, decimal, int(rng.integers(0, 4)))
    return Written(log, LogMap(name="truth", **parts), text)


def _distract(log, columns, rng, pick):
    """Add columns that a flight log needs not: velocities, set points, a magnetometer, a mode."""
    noise = rng.standard_normal((len(log.t), 3))
    for templates, values in (
        (("v{a}", "vel_{a}", "velocity.{a}", "est_v{a}"), np.gradient(log.position, axis=0)),
        (("{a}_setpoint", "target_{a}", "pos_sp_{a}", "ref.{a}"), np.round(log.position, 1)),
        (("mag_{a}", "mag.{a}"), 0.3 + 0.01 * noise),
    ):
        if rng.random() < 0.3:
            template = pick(templates)
            for a, column in zip("xyz", values.T, strict=True):
                columns.setdefault(template.format(a=a), column)
    if rng.random() < 0.3:
        columns["mode"] = np.floor(log.t / 7.0)
        columns["temperature"] = 30.0 + 0.01 * log.t


def _add(columns, template, values, axes="xyz", unit=""):
    """Add columns (N, k) under a template's names of axes or numbers; return the names."""
    names = tuple(
        template.format(a=a, A=a.capitalize(), i=i + 1, n=i, u=unit) for i, a in enumerate(axes)
    )
    columns |= dict(zip(names, values.T, strict=True))
    return names


def _pose(log, columns, world, body, pick):
    unit = pick(tuple(_LENGTH))
    position = log.position * world / _LENGTH[unit]
    out = {"position": Columns(_add(columns, pick(_PLACES), position, unit=unit), unit)}
    rotation = Rotation.from_matrix(
        world[:, None]
        * Rotation.from_quat(log.quaternion, scalar_first=True).as_matrix()
        * body[None, :]
    )
    sense = pick(("body_to_world", "body_to_world", "world_to_body"))
    if sense == "world_to_body":
        rotation = rotation.inv()
    if pick((True, True, False)):
        order = pick(("wxyz", "xyzw"))
        q = rotation.as_quat(scalar_first=order == "wxyz")
        template = pick(_QUATERNIONS if pick((True, True, False)) else _NUMBERED)
        out["attitude"] = Attitude(_add(columns, template, q, order), order=order, sense=sense)
        return out
    euler = pick(("zyx", "zyx", "xyz"))
    unit = pick(("deg", "rad"))
    angles = rotation.as_euler(euler.upper())[:, [euler.index(axis) for axis in "xyz"]]
    angles *= 1.0 if unit == "rad" else 180.0 / pi
    names = _add(columns, pick(_ANGLES), angles, ("roll", "pitch", "yaw"), unit)
    out["attitude"] = Attitude(names, euler=euler, unit=unit, sense=sense)
    return out


def _imu(log, columns, body, axes, pick):
    out = {}
    for section, templates, values, units in (
        ("accelerometer", _ACCELEROMETERS, log.accelerometer, {"m/s2": 1.0, "g": 9.80665}),
        ("gyro", _GYROS, log.gyro, {"rad/s": 1.0, "deg/s": pi / 180.0}),
    ):
        unit = pick(tuple(units))
        names = _add(columns, pick(templates), values * body / units[unit], unit=unit)
        out[section] = Sensor(names, unit, body=axes)
    return out


def _motors(log, columns, pick):
    order = pick((*ORDERS.values(), tuple(int(i) for i in pick(((1, 3, 2, 4), (2, 1, 4, 3))))))
    # motor m stands at the kit's place order.index(m)
    at = [order.index(m) for m in (1, 2, 3, 4)]
    kind = pick(("speed", "speed", "us", "normalised"))
    if kind == "speed":
        unit = pick(("rad/s", "rpm", "rpm", "Hz", "eRPM"))
        pairs = 7 if unit == "eRPM" else 1
        scale = _SPEED["rpm"] / pairs if unit == "eRPM" else _SPEED[unit]
        template = _SPEED_NAMES.get(unit, "") if pick((True, unit == "eRPM")) else ""
        names = _add(columns, template or pick(_SPEEDS), log.rotor_speeds[:, at] / scale, "1234")
        return {"rotors": Rotors(names, unit, order=order, pole_pairs=pairs)}
    low, high = (1000.0, 2000.0) if kind == "us" else (0.0, 1.0)
    template = pick(_PULSES if kind == "us" else _COMMANDS)
    names = _add(columns, template, low + (high - low) * log.command[:, at], "1234")
    return {"commands": Commands(names, kind, order=order, range=(low, high))}


def _text(columns, separator, decimal, comments):
    lines = [f"# exported by a program, line {i + 1}" for i in range(comments)]
    lines.append(separator.join(columns))
    texts = [[f"{x:.17g}" for x in column.tolist()] for column in columns.values()]
    if decimal == ",":
        texts = [[x.replace(".", ",") for x in column] for column in texts]
    lines += [separator.join(row) for row in zip(*texts, strict=True)]
    return "\n".join(lines) + "\n"


def save(written, path):
    """Write a table's text to a file."""
    path.write_text(written.text, encoding="utf-8")
    return path


def fields_of(m):
    """Return what a map's fields mean, each once, however they are written."""
    out = {("time", "column"): m.time.column, ("time", "unit"): m.time.unit}
    if m.position is not None:
        out |= {("world", ""): m.world, ("body", ""): m.body}
    for section, *names in (
        ("position", "columns", "unit"),
        ("rotors", "unit", "pole_pairs"),
        ("commands", "unit", "range"),
        ("accelerometer", "columns", "unit"),
        ("gyro", "columns", "unit"),
    ):
        part = getattr(m, section)
        if part is None:
            continue
        out |= {(section, name): getattr(part, name) for name in names}
        if isinstance(part, Rotors | Commands):
            out[section, "columns"] = tuple(sorted(part.columns))
            out[section, "order"] = tuple(part.columns[i - 1] for i in part.order)
        if isinstance(part, Sensor):
            out[section, "body"] = part.body or m.body
    if (a := m.attitude) is not None:
        out["attitude", "sense"] = a.sense
        if a.euler:
            out |= {("attitude", name): getattr(a, name) for name in ("columns", "euler", "unit")}
            out["attitude", "signs"] = a.signs or (1, 1, 1)
        else:
            out["attitude", "order"] = tuple(a.columns[a.order.index(x)] for x in "wxyz")
    if m.battery is not None:
        out |= {("battery", "column"): m.battery.columns, ("battery", "unit"): m.battery.unit}
    return out
