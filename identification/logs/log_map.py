"""What the columns of a log mean: a map from them to a flight log, in a YAML file.

Every section but ``time`` may be left out; the log must come to have a pose or an IMU, and rotor
speeds or motor commands. ``optional: true`` in a section skips it where none of its columns is
there. ``signs: [1, -1, 1]`` in a section of several columns turns single ones over; ``scale``
multiplies what the column holds before its unit is applied; ``note`` is said of a log in which the
section is used. A list of sections in place of one states alternatives: the first is taken whose
columns the log has, with numbers in them.

* ``about``: what kind of table it is, for people
* ``vehicle``: name of the vehicle that flew
* ``recognise``: columns by which a table of this kind is known without being told
* ``notes``: said of every log
* ``world``: enu (z up; also nwu, flu), ned (z down; also frd), y_up (motion capture)
* ``body``: flu (forward, left, up) or frd (forward, right, down)
* ``rows``: mixed (default: fields may be empty where a channel has no sample), streams (as mixed,
  and rows that go back in time are left out), messages (as streams, and every row of a position is
  one of the log's: one of NaN was lost) or whole (every field of a pose is filled, or all are
  empty; times strictly increase; every row is one of the log's)
* ``stray_rows``: how many rows at the start are dropped, at most, where a gap follows them
* ``time``: column, unit (s, ms, us, ns, min), offset (s; default: the flight begins at 0); or
  rate_hz alone, where the table has no time
* ``topic`` of any section: the kind of message in which its columns stand, in a log of several
* ``position``: columns (x, y, z), unit (m, mm, cm, ft), held (true: a position that repeats the one
  before is no measurement)
* ``attitude``: columns, and order (wxyz or xyzw); or columns (roll, pitch, yaw: about x, y, z),
  euler (order of the turns, each about the axis that the last has moved: zyx is yaw, pitch, roll)
  and unit (deg, rad). A column ``=0`` stands for an angle that is not in the table. sense:
  body_to_world or world_to_body. of: topics of the positions that it goes with (default: all)
* ``rotors``: measured speeds: columns, order (a name of ``rotor_orders`` or four motors' numbers:
  those at front-left, rear-left, rear-right, front-right), unit (rad/s, rpm, Hz, eRPM with
  pole_pairs)
* ``commands``: columns, order, unit (us, normalised, duty, percent, dshot, counts), range (what
  stands for 0 and for full command), clip (true: a command beyond the range is set to its end);
  what a vehicle without a motor curve is assumed to make of them: thrust_factor (f of the relative
  thrust f u^2 + (1 - f) u) or thrust (N a motor, the coefficients of the count's powers 0, 1, 2, at
  full_voltage)
* ``wrench``: commanded collective thrust (N) and torque about x, y, z (Nm): columns
* ``battery``: column, unit (V, mV, cV), cells (where the voltage is that of one cell), late (s, by
  which the voltage is logged late)
* ``accelerometer``: columns, unit (m/s2, g, raw with scale in m/s2), body (where another than
  above)
* ``gyro``: columns, unit (rad/s, deg/s, raw with scale in rad/s), body
* ``force, torque``: true external wrench in the world, N and Nm
* ``extra``: what else is kept, by name: columns and scale
"""

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from ...runtime.errors import InputError, unknown_name
from ...runtime.forms import STRICT, checked
from ...runtime.yaml_file import read_yaml
from .rotor_orders import ORDERS, Order, rotor_order

MAPS = Path(__file__).parent / "maps"  # those that ship with the kit
OWN_MAP = "windwrench"  # of this kit's own columns

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
    "rev/s": "Hz",
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


def that_is(wanted: str, test: Callable[[Any], bool]) -> BeforeValidator:
    """Return a validator that refuses what fails a test, in the words of what was wanted."""

    def check(value: Any, info: Any) -> Any:
        if not test(value):
            raise InputError(f"{info.field_name}: {_shown(value)}; expected {wanted}")
        return tuple(value) if isinstance(value, list) else value

    return BeforeValidator(check)


def one_of(known: Collection[str]) -> BeforeValidator:
    """Return a validator that takes one of some words, whatever its case, and other spellings."""
    lower = {name.lower(): name for name in known}

    def check(value: Any, info: Any) -> str:
        text = str(value).lower()
        found = lower.get(text) or lower.get(_SPELLINGS.get(text, "").lower())
        if found is None:
            raise unknown_name(info.field_name, str(value), known)
        return found

    return BeforeValidator(check)


def _finite(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= 1e300


def _two_numbers(value: Any) -> bool:
    two = isinstance(value, list | tuple) and len(value) == 2 and all(map(_finite, value))
    return value is None or (two and value[0] != value[1])


_Text = Annotated[str, that_is("a text", lambda x: isinstance(x, str))]
_Number = Annotated[float, that_is("a finite number", _finite)]
_Truth = Annotated[bool, that_is("true or false", lambda x: isinstance(x, bool))]
_Count = Annotated[
    int, that_is("a whole number from 1", lambda x: type(x) is int and 1 <= x <= 1000)
]
_Names = Annotated[
    tuple[str, ...],
    that_is(
        "a list of columns",
        lambda x: isinstance(x, list | tuple) and all(isinstance(name, str) for name in x),
    ),
]
_Range = Annotated[
    tuple[float, float] | None,
    that_is(
        "two numbers, what stands for no and for full command, such as [1000, 2000]", _two_numbers
    ),
]
_Order = Annotated[Order, BeforeValidator(lambda value: rotor_order(value, "order"))]


@dataclass(frozen=True)
class Columns:
    """Columns of one kind, and what they are in."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    columns: tuple[str, ...]
    unit: str = ""
    scale: Annotated[_Number, that_is("a factor that is not zero", lambda x: x != 0)] = 1.0
    signs: tuple[int, ...] = ()  # one a column; empty: all as they stand
    optional: _Truth = False
    note: _Text = ""
    topic: _Text = ""  # of the messages in which the columns stand; empty: any

    @property
    def label(self) -> str:
        """What the columns are called together: their topic, else the first of them."""
        several = " ..." if len(self.columns) > 1 else ""
        return self.topic or f"{self.columns[0]}{several}"

    @property
    def named(self) -> list[str]:
        """The columns that stand in the table: those that are no constant such as ``=0``."""
        return [name for name in self.columns if constant(name) is None]


@dataclass(frozen=True)
class TimeColumn:
    """The clock."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    column: str = ""
    unit: Annotated[str, one_of(TIME_UNITS)] = "s"
    offset: Annotated[
        float | None, that_is("a finite number", lambda x: x is None or _finite(x))
    ] = None  # s, added; None: so that the flight begins at 0
    rate_hz: _Number = 0.0  # of rows, where there is no column
    note: _Text = ""


@dataclass(frozen=True)
class Position(Columns):
    """A position."""

    held: _Truth = False  # a value that repeats the one before is no measurement


@dataclass(frozen=True)
class Attitude(Columns):
    """A quaternion, or Euler angles about x, y and z."""

    order: Annotated[str, one_of(QUATERNIONS)] = "wxyz"  # of the columns of a quaternion
    euler: Annotated[str, one_of(EULER_ORDERS)] = ""  # of turns; empty: a quaternion
    sense: Annotated[str, one_of(SENSES)] = "body_to_world"
    of: _Names = ()  # topics of positions; empty: of all


@dataclass(frozen=True)
class Rotors(Columns):
    """Measured rotor speeds."""

    order: _Order = ORDERS["windwrench"]
    pole_pairs: _Count = 1


@dataclass(frozen=True)
class Commands(Columns):
    """Motor commands."""

    order: _Order = ORDERS["windwrench"]
    range: _Range = None  # None: the vehicle's motor curve states it
    thrust_factor: Annotated[float, that_is("0 to 1", lambda x: _finite(x) and 0 <= x <= 1)] = 1.0
    thrust_span: tuple[_Number, _Number] = (0.0, 1.0)  # commands at which u is 0 and 1
    clip: _Truth = False
    thrust: tuple[_Number, ...] = ()  # N a motor, of the count's powers 0, 1, 2
    full_voltage: Annotated[_Number, Field(gt=0.0)] = 1.0  # V, at which ``thrust`` holds


@dataclass(frozen=True)
class Battery(Columns):
    """The battery's voltage."""

    cells: _Count = 1
    late: _Number = 0.0  # s, by which the voltage is logged late


@dataclass(frozen=True)
class Sensor(Columns):
    """An inertial sensor of three axes."""

    body: Annotated[str, one_of(BODIES)] = ""  # empty: the map's


@dataclass(frozen=True)
class LogMap:
    """What the columns of a table mean."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    time: TimeColumn
    world: Annotated[str, one_of(WORLDS)] = "enu"
    body: Annotated[str, one_of(BODIES)] = "flu"
    position: Columns | None = None
    attitude: Attitude | None = None
    rotors: Rotors | None = None
    commands: Commands | None = None
    wrench: Columns | None = None
    battery: Battery | None = None
    accelerometer: Sensor | None = None
    gyro: Sensor | None = None
    force: Columns | None = None
    torque: Columns | None = None
    about: _Text = ""
    vehicle: _Text = ""
    recognise: _Names = ()
    name: str = ""  # where it comes from: a shipped map's name or a file
    notes: _Names = ()
    rows: Literal["mixed", "whole", "streams", "messages"] = "mixed"
    stray_rows: Annotated[int, Field(ge=0)] = 0
    extra: Mapping[str, Columns] = field(default_factory=dict)
    # further ways to fill a section (``time`` among them), in their order
    alternatives: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)

    @property
    def sections(self) -> dict[str, Columns]:
        """The sections that the map has, but the time."""
        found = {name: getattr(self, name) for name in SECTIONS}
        return {name: part for name, part in found.items() if part is not None}

    @property
    def is_own(self) -> bool:
        """Are the columns this kit's own?"""
        return self.name == OWN_MAP


# sections: their class, how many columns they have, and their units
_FORMS: dict[str, tuple[type[Columns], int, Collection[str]]] = {
    "position": (Position, 3, LENGTH_UNITS),
    "attitude": (Attitude, 4, ANGLE_UNITS),
    "rotors": (Rotors, 4, ROTOR_UNITS),
    "commands": (Commands, 4, COMMAND_UNITS),
    "wrench": (Columns, 4, ("N",)),
    "battery": (Battery, 1, VOLTAGE_UNITS),
    "accelerometer": (Sensor, 3, ACCELERATION_UNITS),
    "gyro": (Sensor, 3, RATE_UNITS),
    "force": (Columns, 3, ("N", "mN")),
    "torque": (Columns, 3, ("Nm", "mNm")),
}
_DEFAULT_UNITS = {"attitude": "deg", "commands": "normalised"}  # of others the first
SECTIONS = tuple(_FORMS)


def constant(name: str) -> float | None:
    """Return the constant that a column's name stands for, such as ``=0``."""
    if not name.startswith("="):
        return None
    try:
        return float(name[1:])
    except ValueError:
        return None


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
        return _shipped_map(str(name))
    if path.suffix.lower() not in (".yaml", ".yml") and not path.exists():
        raise unknown_name("map", str(name), [*map_names(), "the path of a YAML file"])
    return parse_map(read_yaml(path, "a map file"), str(path), str(path))


def recording_map(name: str) -> LogMap:
    """Return the map of an autopilot's messages, which its reader decodes."""
    return _shipped_map(f"recordings/{name}")


@cache
def _shipped_map(name: str) -> LogMap:
    return parse_map(read_yaml(MAPS / f"{name}.yaml", "a map"), f"map {name}", name)


def parse_map(value: object, where: str, name: str = "") -> LogMap:
    """Return the map that a YAML file's value states.

    Args:
        value: of the file.
        where: it comes from, for errors.
        name: of the map.

    Raises:
        InputError: a field is unknown, missing, or of another kind.
    """
    if not isinstance(value, dict):
        raise InputError(f"{where}: {_shown(value)}; expected a mapping of fields")
    given: dict[str, Any] = {str(key): item for key, item in value.items() if item is not None}
    others: dict[str, tuple[Any, ...]] = {}
    for section in ("time", *SECTIONS):
        ways = given.get(section, {} if section == "time" else None)
        if ways is None:
            continue
        read = _time if section == "time" else _section
        ways = ways if isinstance(ways, list) and ways else [ways]
        given[section], *more = [read(way, where, section) for way in ways]
        others[section] = tuple(more)
    extra = given.pop("extra", {})
    if not isinstance(extra, dict):
        raise InputError(f"{where}: extra: {_shown(extra)}; expected a mapping of names")
    for key, part in extra.items():
        if isinstance(part, dict) and not part.get("columns"):
            raise InputError(f"{where}: extra: {key}: columns: missing; expected some of the table")
    given["extra"] = {
        str(key): checked(Columns, _filled(part, f"{where}: extra"), f"{where}: extra: {key}")
        for key, part in extra.items()
    }
    _check_names(given, LogMap, where)
    found = checked(LogMap, given | {"name": name or where, "alternatives": others}, where)
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
    has_imu = found.accelerometer is not None and found.gyro is not None
    if found.position is None and not has_imu and not found.extra:
        raise InputError(
            f"{where}: no pose and no IMU; expected the sections position and attitude, or "
            "accelerometer and gyro"
        )
    if found.rotors is None and found.commands is None and found.wrench is None:
        raise InputError(f"{where}: no motors; expected a section rotors or commands")
    if (found.force is None) != (found.torque is None):
        raise InputError(f"{where}: force and torque come together; expected both or neither")


def _filled(given: object, where: str) -> dict[str, Any]:
    """Return a section's fields that are stated, its columns as texts."""
    if not isinstance(given, dict):
        raise InputError(f"{where}: {_shown(given)}; expected a mapping of fields")
    fields = {str(key): item for key, item in given.items() if item is not None}
    if isinstance(columns := fields.get("columns"), list):
        for name in columns:
            if isinstance(name, bool) or not isinstance(name, str | int) or name == "":
                raise InputError(f"{where}: columns: {_shown(name)}; expected the name of a column")
        fields["columns"] = tuple(str(name).strip() for name in columns)
    return fields


def _time(given: object, where: str, section: str) -> TimeColumn:
    where = f"{where}: {section}"
    fields = _filled(given, where)
    _check_names(fields, TimeColumn, where)
    rate = fields.get("rate_hz")
    column = fields.get("column")
    if not rate and (isinstance(column, bool) or not isinstance(column, str | int)):
        raise InputError(f"{where}: column: {_shown(column)}; expected one column of the table")
    found = checked(TimeColumn, fields | ({} if rate else {"column": str(column).strip()}), where)
    if rate and (found.rate_hz <= 0.0 or column is not None):
        raise InputError(f"{where}: expected a column, or rate_hz above 0 without one")
    return found


def _section(given: object, where: str, section: str) -> Columns:
    kind, count, units = _FORMS[section]
    where = f"{where}: {section}"
    fields = _filled(given, where)
    _check_names(fields, kind, where, *(["column"] if count == 1 else []))
    named = "columns"
    if count == 1:
        named = "column"
        column = fields.pop("column", None)
        fields["columns"] = [column] if isinstance(column, str | int) else column
        fields = _filled(fields, where)
    if "euler" in fields:
        count = 3
    if not isinstance(fields.get("columns"), tuple) or len(fields["columns"]) != count:
        what = "one column" if count == 1 else f"a list of {count} columns"
        found = fields.get("columns", given.get(named) if isinstance(given, dict) else None)
        found = list(found) if isinstance(found, tuple) else found
        raise InputError(f"{where}: {named}: {_shown(found)}; expected {what} of the table")
    lower = {name.lower(): name for name in units}
    default = "" if section == "attitude" and count == 4 else _DEFAULT_UNITS.get(section)
    unit = str(fields.get("unit", next(iter(units)) if default is None else default))
    spelt = lower.get(unit.lower()) or lower.get(_SPELLINGS.get(unit.lower(), "").lower())
    if unit and spelt is None:
        raise unknown_name("unit", unit, units, where)
    fields["unit"] = spelt or ""
    if spelt == "raw" and "scale" not in fields:
        raise InputError(f"{where}: unit raw without a scale; expected the scale to SI units")
    if spelt == "eRPM" and "pole_pairs" not in fields:
        raise InputError(
            f"{where}: unit eRPM without pole_pairs; expected the motors' pairs of poles (7 "
            "on most motors of 5-inch racers, 6 on smaller ones)"
        )
    if section == "commands":
        fields.setdefault("range", COMMAND_UNITS[fields["unit"]])
    signs = fields.get("signs", [])
    if signs and not (
        isinstance(signs, list)
        and len(signs) == count
        and all(s in (1, -1) and not isinstance(s, bool) for s in signs)
    ):
        raise InputError(
            f"{where}: signs: {_shown(signs)}; expected {count} times 1 or -1, such as "
            f"{[1, -1, 1, 1][:count]}"
        )
    return checked(kind, fields, where)


def _check_names(fields: Mapping[str, Any], form: Any, where: str, *more: str) -> None:
    """Raise InputError at a field that no file states."""
    known = {field.name for field in dataclasses.fields(form)} - {"alternatives", "name"} | {*more}
    for name in fields:
        if name not in known:
            raise unknown_name("field", name, known, where)


def _shown(value: object) -> str:
    return "missing" if value is None else repr(value)[:100]
