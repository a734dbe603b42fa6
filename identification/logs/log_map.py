"""What the columns of somebody's table mean: a map from them to a flight log, in a YAML file.

Every section but ``time`` may be left out; the log must come to have a pose or an IMU, and rotor
speeds or motor commands. ``optional: true`` in a section skips it where none of its columns is
there. ``signs: [1, -1, 1]`` in a section of several columns turns single ones over; ``scale``
multiplies what the column holds before its unit is applied.

* ``about``: what kind of table it is, for people
* ``vehicle``: name of the vehicle that flew
* ``recognise``: columns by which a table of this kind is known without being told
* ``world``: enu (z up; also nwu, flu), ned (z down; also frd), y_up (motion capture)
* ``body``: flu (forward, left, up) or frd (forward, right, down)
* ``time``: column, unit (s, ms, us, ns, min), offset (s; default: the flight begins at 0); or
  rate_hz alone, where the table has no time
* ``position``: columns (x, y, z), unit (m, mm, cm, ft)
* ``attitude``: columns, and order (wxyz or xyzw); or columns (roll, pitch, yaw: about x, y, z),
  euler (order of the turns, each about the axis that the last has moved: zyx is yaw, pitch, roll)
  and unit (deg, rad). A column ``=0`` stands for an angle that is not in the table. sense:
  body_to_world or world_to_body
* ``rotors``: measured speeds: columns, order (a name of ``rotor_orders`` or four motors' numbers:
  those at front-left, rear-left, rear-right, front-right), unit (rad/s, rpm, Hz, eRPM with
  pole_pairs)
* ``commands``: columns, order, unit (us, normalised, duty, percent, dshot, counts), range (what
  stands for 0 and for full command), thrust_factor (f of the relative thrust f u^2 + (1 - f) u that
  is assumed where the vehicle states no motor curve)
* ``battery``: column, unit (V, mV, cV), cells (where the voltage is that of one cell)
* ``accelerometer``: columns, unit (m/s2, g, raw with scale in m/s2), body (where another than
  above)
* ``gyro``: columns, unit (rad/s, deg/s, raw with scale in rad/s), body
* ``force, torque``: true external wrench in the world, N and Nm
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...runtime.errors import InputError, unknown_name
from ...runtime.yaml_file import read_yaml
from .rotor_orders import ORDERS, Order, rotor_order

MAPS = Path(__file__).parent / "maps"  # those that ship with the kit

WORLDS = {"enu": "enu", "nwu": "enu", "flu": "enu", "ned": "ned", "frd": "ned", "y_up": "y_up"}
BODIES = {"flu": "flu", "frd": "frd"}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048}
ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180.0}
# a rotor's unit in rad/s; that of eRPM is divided by the pairs of poles
ROTOR_UNITS = {
    "rad/s": 1.0,
    "rpm": math.pi / 30.0,
    "Hz": 2.0 * math.pi,
    "eRPM": math.pi / 30.0,
}
# what stands for no and for full command; None: must be said
COMMAND_UNITS: dict[str, tuple[float, float] | None] = {
    "us": (1000.0, 2000.0),
    "normalised": (0.0, 1.0),
    "duty": (0.0, 1.0),
    "percent": (0.0, 100.0),
    "dshot": (48.0, 2047.0),
    "counts": None,
}
VOLTAGE_UNITS = {"V": 1.0, "mV": 1e-3, "cV": 1e-2}
ACCELERATION_UNITS = {"m/s2": 1.0, "g": 9.80665, "raw": 1.0}
RATE_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "raw": 1.0}
SENSES = ("body_to_world", "world_to_body")
QUATERNIONS = ("wxyz", "xyzw")
EULER_ORDERS = ("xyz", "xzy", "yxz", "yzx", "zxy", "zyx")

# other spellings of units
_SPELLINGS = {
    "rad/sec": "rad/s",
    "radps": "rad/s",
    "rad_s": "rad/s",
    "deg/sec": "deg/s",
    "dps": "deg/s",
    "degps": "deg/s",
    "m/s^2": "m/s2",
    "m/s/s": "m/s2",
    "mps2": "m/s2",
    "pwm": "us",
    "µs": "us",
    "normalized": "normalised",
    "%": "percent",
    "degrees": "deg",
    "radians": "rad",
}


@dataclass(frozen=True)
class Columns:
    """Columns of one kind, and what they are in."""

    columns: tuple[str, ...]
    unit: str = ""
    scale: float = 1.0
    signs: tuple[int, ...] = ()  # one a column; empty: all as they stand
    optional: bool = False


@dataclass(frozen=True)
class TimeColumn:
    """The clock."""

    column: str = ""
    unit: str = "s"
    offset: float | None = None  # s, added; None: so that the flight begins at 0
    rate_hz: float = 0.0  # of rows, where there is no column


@dataclass(frozen=True)
class Attitude(Columns):
    """A quaternion, or Euler angles about x, y and z."""

    order: str = "wxyz"  # of the columns of a quaternion
    euler: str = ""  # order of turns; empty: a quaternion
    sense: str = "body_to_world"


@dataclass(frozen=True)
class Rotors(Columns):
    """Measured rotor speeds."""

    order: Order = ORDERS["windwrench"]
    pole_pairs: int = 1


@dataclass(frozen=True)
class Commands(Columns):
    """Motor commands."""

    order: Order = ORDERS["windwrench"]
    range: tuple[float, float] | None = None  # None: the vehicle's motor curve states it
    thrust_factor: float = 1.0


@dataclass(frozen=True)
class Battery(Columns):
    """The battery's voltage."""

    cells: int = 1


@dataclass(frozen=True)
class Sensor(Columns):
    """An inertial sensor of three axes."""

    body: str = ""  # empty: the map's


@dataclass(frozen=True)
class LogMap:
    """What the columns of a table mean."""

    time: TimeColumn
    world: str = "enu"
    body: str = "flu"
    position: Columns | None = None
    attitude: Attitude | None = None
    rotors: Rotors | None = None
    commands: Commands | None = None
    battery: Battery | None = None
    accelerometer: Sensor | None = None
    gyro: Sensor | None = None
    force: Columns | None = None
    torque: Columns | None = None
    about: str = ""
    vehicle: str = ""
    recognise: tuple[str, ...] = ()
    name: str = ""  # where it comes from: a shipped map's name or a file

    @property
    def sections(self) -> dict[str, Columns]:
        """The sections that the map has, but the time."""
        found = {name: getattr(self, name) for name in SECTIONS}
        return {name: part for name, part in found.items() if part is not None}


SECTIONS = (
    "position",
    "attitude",
    "rotors",
    "commands",
    "battery",
    "accelerometer",
    "gyro",
    "force",
    "torque",
)


def map_names() -> list[str]:
    """Return the names of the maps that ship with the kit."""
    return sorted(path.stem for path in MAPS.glob("*.yaml"))


def load_map(name: str | Path) -> LogMap:
    """Return a map: one that ships with the kit, by its name, or that of a YAML file.

    Raises:
        InputError: there is none of that name, or it is no map; the message says where and what was
            expected.
    """
    path = Path(name)
    if str(name) in map_names():
        path = MAPS / f"{name}.yaml"
        return parse_map(read_yaml(path, "a map"), f"map {name}", str(name))
    if path.suffix.lower() not in (".yaml", ".yml") and not path.exists():
        raise unknown_name("map", str(name), [*map_names(), "the path of a YAML file"])
    return parse_map(read_yaml(path, "a map file"), str(path), str(path))


class _Section:
    """A mapping of the file, whose fields are taken one by one."""

    def __init__(self, value: object, where: str) -> None:
        if not isinstance(value, dict):
            raise InputError(f"{where}: {_shown(value)}; expected a mapping of fields")
        self.fields: dict[str, Any] = {str(key): item for key, item in value.items()}
        self.where, self.known = where, list[str]()

    def take(self, name: str, default: object = None) -> Any:
        self.known.append(name)
        value = self.fields.get(name)
        return default if value is None else value

    def end(self) -> None:
        for name in self.fields:
            if name not in self.known:
                raise unknown_name("field", name, self.known, self.where)

    def text(self, name: str, default: str = "") -> str:
        value = self.take(name, default)
        if not isinstance(value, str):
            raise InputError(f"{self.where}: {name}: {_shown(value)}; expected a text")
        return value

    def number(self, name: str, default: float | None) -> float | None:
        value = self.take(name, default)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
            raise InputError(f"{self.where}: {name}: {_shown(value)}; expected a finite number")
        return float(value)

    def factor(self, name: str, default: float) -> float:
        value = self.number(name, default)
        if value is None or value == 0.0:
            raise InputError(f"{self.where}: {name}: 0; expected a factor that is not zero")
        return value

    def count(self, name: str, default: int) -> int:
        value = self.take(name, default)
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 1000:
            raise InputError(
                f"{self.where}: {name}: {_shown(value)}; expected a whole number from 1"
            )
        return value

    def truth(self, name: str) -> bool:
        value = self.take(name, False)
        if not isinstance(value, bool):
            raise InputError(f"{self.where}: {name}: {_shown(value)}; expected true or false")
        return value

    def choice(self, name: str, known: Mapping[str, object] | tuple[str, ...], default: str) -> str:
        value = self.take(name, default)
        text = str(value)
        lower = {str(key).lower(): str(key) for key in known}
        found = lower.get(text.lower()) or lower.get(_SPELLINGS.get(text.lower(), "").lower())
        if found is None:
            raise unknown_name(name, text, known, self.where)
        return found

    def columns(self, name: str, count: int) -> tuple[str, ...]:
        value = self.take(name)
        items = [value] if count == 1 and isinstance(value, str | int) else value
        if not isinstance(items, list) or len(items) != count:
            what = "one column" if count == 1 else f"a list of {count} columns"
            raise InputError(f"{self.where}: {name}: {_shown(value)}; expected {what} of the table")
        for item in items:
            if isinstance(item, bool) or not isinstance(item, str | int) or item == "":
                raise InputError(
                    f"{self.where}: {name}: {_shown(item)}; expected the name of a column"
                )
        return tuple(str(item).strip() for item in items)

    def shared(self, count: int, name: str = "columns") -> dict[str, Any]:
        """Take what every section has: columns, scale, signs and whether it is optional."""
        signs = self.take("signs", [])
        if signs and (
            not isinstance(signs, list)
            or len(signs) != count
            or any(s not in (1, -1) or isinstance(s, bool) for s in signs)
        ):
            raise InputError(
                f"{self.where}: signs: {_shown(signs)}; expected {count} times 1 or -1, such as "
                f"{[1, -1, 1, 1][:count]}"
            )
        return {
            "columns": self.columns(name, count),
            "scale": self.factor("scale", 1.0),
            "signs": tuple(int(s) for s in signs),
            "optional": self.truth("optional"),
        }


def _finite(value: int | float) -> bool:
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _shown(value: object) -> str:
    return "missing" if value is None else repr(value)[:100]


def parse_map(value: object, where: str, name: str = "") -> LogMap:
    """Return the map that a YAML file's value states.

    Args:
        value: of the file.
        where: it comes from, for errors.
        name: of the map.

    Raises:
        InputError: a field is unknown, missing, or of another kind.
    """
    top = _Section(value, where)
    about, vehicle = top.text("about"), top.text("vehicle")
    recognise = top.take("recognise", [])
    if not isinstance(recognise, list) or not all(isinstance(x, str) for x in recognise):
        raise InputError(f"{where}: recognise: {_shown(recognise)}; expected a list of columns")
    world = WORLDS[top.choice("world", WORLDS, "enu")]
    body = top.choice("body", BODIES, "flu")
    time = _time(top)
    parts: dict[str, Any] = {}
    for section in SECTIONS:
        given = top.take(section)
        if given is not None:
            part = _Section(given, f"{where}: {section}")
            parts[section] = _PARSERS[section](part)
            part.end()
    top.end()
    found = LogMap(
        time=time,
        world=world,
        body=body,
        about=about,
        vehicle=vehicle,
        recognise=tuple(recognise),
        name=name or where,
        **parts,
    )
    _check_whole(found, where)
    return found


def _check_whole(found: LogMap, where: str) -> None:
    """Raise InputError where a map's sections are not enough for a flight log."""
    if (found.position is None) != (found.attitude is None):
        missing = "attitude" if found.attitude is None else "position"
        raise InputError(
            f"{where}: no section {missing}; expected position and attitude, or neither where "
            "accelerometer and gyro are there"
        )
    if found.position is None and (found.accelerometer is None or found.gyro is None):
        raise InputError(
            f"{where}: no pose and no IMU; expected the sections position and attitude, or "
            "accelerometer and gyro"
        )
    if found.rotors is None and found.commands is None:
        raise InputError(f"{where}: no motors; expected a section rotors or commands")
    if (found.force is None) != (found.torque is None):
        raise InputError(f"{where}: force and torque come together; expected both or neither")


def _time(top: _Section) -> TimeColumn:
    part = _Section(top.take("time", {}), f"{top.where}: time")
    rate, offset = part.number("rate_hz", 0.0), part.number("offset", None)
    unit = part.choice("unit", TIME_UNITS, "s")
    if rate:
        part.take("column")
        if rate <= 0.0 or part.fields.get("column") is not None:
            raise InputError(f"{part.where}: expected a column, or rate_hz above 0 without one")
        column = ""
    else:
        (column,) = part.columns("column", 1)
    part.end()
    return TimeColumn(column, unit, offset, rate or 0.0)


def _position(part: _Section) -> Columns:
    return Columns(unit=part.choice("unit", LENGTH_UNITS, "m"), **part.shared(3))


def _attitude(part: _Section) -> Attitude:
    sense = part.choice("sense", SENSES, "body_to_world")
    if part.take("euler") is None:
        order = part.choice("order", QUATERNIONS, "wxyz")
        part.known += ["euler"]
        return Attitude(order=order, sense=sense, **part.shared(4))
    euler = part.choice("euler", EULER_ORDERS, "zyx")
    unit = part.choice("unit", ANGLE_UNITS, "deg")
    return Attitude(euler=euler, sense=sense, unit=unit, **part.shared(3))


def _rotors(part: _Section) -> Rotors:
    unit = part.choice("unit", ROTOR_UNITS, "rad/s")
    if unit == "eRPM" and part.fields.get("pole_pairs") is None:
        raise InputError(
            f"{part.where}: unit eRPM without pole_pairs; expected the motors' pairs of poles (7 "
            "on most motors of 5-inch racers, 6 on smaller ones)"
        )
    pairs = part.count("pole_pairs", 1)
    return Rotors(
        unit=unit,
        pole_pairs=pairs,
        order=rotor_order(part.take("order", "windwrench"), f"{part.where}: order"),
        **part.shared(4),
    )


def _commands(part: _Section) -> Commands:
    unit = part.choice("unit", COMMAND_UNITS, "normalised")
    limits = part.take("range")
    if limits is not None:
        good = (
            isinstance(limits, list)
            and len(limits) == 2
            and all(isinstance(x, int | float) and not isinstance(x, bool) for x in limits)
            and all(map(_finite, limits))
            and limits[0] != limits[1]
        )
        if not good:
            raise InputError(
                f"{part.where}: range: {_shown(limits)}; expected two numbers, what stands for no "
                "and for full command, such as [1000, 2000]"
            )
    factor = part.number("thrust_factor", 1.0)
    if factor is None or not 0.0 <= factor <= 1.0:
        raise InputError(f"{part.where}: thrust_factor: {factor:g}; expected 0 to 1")
    return Commands(
        unit=unit,
        range=(float(limits[0]), float(limits[1])) if limits is not None else COMMAND_UNITS[unit],
        thrust_factor=factor,
        order=rotor_order(part.take("order", "windwrench"), f"{part.where}: order"),
        **part.shared(4),
    )


def _battery(part: _Section) -> Battery:
    unit = part.choice("unit", VOLTAGE_UNITS, "V")
    return Battery(unit=unit, cells=part.count("cells", 1), **part.shared(1, "column"))


def _sensor(part: _Section, units: Mapping[str, float]) -> Sensor:
    unit = part.choice("unit", units, next(iter(units)))
    if unit == "raw" and "scale" not in part.fields:
        raise InputError(f"{part.where}: unit raw without a scale; expected the scale to SI units")
    body = part.choice("body", BODIES, "flu") if part.fields.get("body") is not None else ""
    part.known.append("body")
    return Sensor(unit=unit, body=body, **part.shared(3))


_PARSERS: dict[str, Any] = {
    "position": _position,
    "attitude": _attitude,
    "rotors": _rotors,
    "commands": _commands,
    "battery": _battery,
    "accelerometer": lambda part: _sensor(part, ACCELERATION_UNITS),
    "gyro": lambda part: _sensor(part, RATE_UNITS),
    "force": lambda part: Columns(unit=part.choice("unit", ("N", "mN"), "N"), **part.shared(3)),
    "torque": lambda part: Columns(unit=part.choice("unit", ("Nm", "mNm"), "Nm"), **part.shared(3)),
}
