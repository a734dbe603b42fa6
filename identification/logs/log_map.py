"""Log maps: the meaning of a log's columns, in a YAML file.

Every section but ``time`` may be left out; the log must come to have a pose or an IMU, and rotor
speeds or motor commands. ``optional: true`` skips a section without any of its columns. ``signs:
[1, -1, 1]`` in a section of several columns turns single ones over. ``scale`` multiplies a column's
numbers, before its unit. ``note`` is a note of each log with the section. A list of sections in
place of one states alternatives: the first is taken with columns in the log, and numbers in them.

* ``about``: the kind of table, for people
* ``vehicle``: name of the vehicle
* ``recognise``: columns of every table of this kind, by which the map is chosen
* ``notes``: notes of every log
* ``world``: enu (z up; also nwu, flu), ned (z down; also frd), y_up (motion capture)
* ``body``: flu (forward, left, up), frd (forward, right, down) or y_up (forward, up, right)
* ``rows``, of a table: mixed (default: fields may be empty where a channel has no sample) or whole
  (every field of a pose is filled, or all are empty; times strictly increase; every row is one of
  the log's); messages, of a recording: as mixed, and a position may stand still
* ``stray_rows``: how many rows at the start are dropped, at most, where a gap follows them
* ``time``: column (numbers, dates or times of day), unit (s, ms, us, ns, min), nanoseconds (column
  beside one of whole seconds), offset (s; default: the flight begins at 0); or rate_hz alone, where
  the table has no time
* ``topic`` of any section: the kind of message with its columns, in a log of several
* ``position``: columns (x, y, z), unit (m, mm, cm, ft), held (true: a repeated position is no
  measurement)
* ``attitude``: columns, and order (wxyz or xyzw); or columns (roll, pitch, yaw: about x, y, z),
  euler (order of the turns, each about the axis moved by the turn before: zyx is yaw, pitch, roll)
  and unit (deg, rad). A column ``=0`` stands for an angle outside the table. sense: body_to_world
  or world_to_body. of: topics of its positions (default: all)
* ``rotors``: measured speeds: columns, order (a name of ``what_flew`` or four motors' numbers:
  at front-left, rear-left, rear-right, front-right), unit (rad/s, rpm, Hz, eRPM with pole_pairs)
* ``commands``: columns, order, unit (us, normalised, duty, percent, dshot, counts), range (counts
  of no and of full command), clip (true: a command beyond the range is set to its end); assumed of
  a vehicle without a motor curve: thrust_factor (f of the relative thrust f u^2 + (1 - f) u) or
  thrust (N a motor, the coefficients of the count's powers 0, 1, 2, at full_voltage, from
  thrust_source)
* ``wrench``: commanded collective thrust (N) and torque about x, y, z (Nm): columns
* ``battery``: column, unit (V, mV, cV), cells (of a voltage of one cell), late (s, delay of the
  logged voltage)
* ``accelerometer``: columns, unit (m/s2, g, raw with scale in m/s2), body (where another than
  above)
* ``gyro``: columns, unit (rad/s, deg/s, raw with scale in rad/s), body
* ``force, torque``: true external wrench in the world, N and Nm
* ``extra``: further channels, by name: columns and scale
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    StringConstraints,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

from ...runtime.errors import InputError, unknown_name
from ...runtime.forms import STRICT, Number, Positive, checked, expected
from ...runtime.yaml_file import read_yaml
from .column_names import WORDS, unit_spelled
from .table import Array, ArrayMap, Data, Lines, NamedNumbers, NamedTexts, Names, Pair, Wanted
from .what_flew import ORDERS, Order, rotor_order

_T = TypeVar("_T")

Ways = tuple[Any, ...]  # to fill a section
MAPS = Path(__file__).parent / "maps"  # the kit's own maps
OWN_MAP = "windwrench"  # of this kit's own columns
UNKNOWN = "?"  # a field that a person must choose

WORLDS: NamedTexts = WORDS["worlds"]
UNITS: dict[str, NamedNumbers] = WORDS["factors"]
COMMAND_UNITS: dict[str, Pair | None] = {
    unit: ends and (ends[0], ends[1]) for unit, ends in WORDS["commands"].items()
}
SECTIONS: dict[str, int] = WORDS["sections"]  # columns of each
SENSES = ("body_to_world", "world_to_body")


def _known(value: Any, known: Wanted, what: str) -> str:
    """Return a value as one of the known words, in any case or spelling."""
    text = str(value).lower()
    for name in known:
        if name.lower() in (text, unit_spelled(text).lower()):
            return name
    raise unknown_name(what, str(value), known)


def _one_of(known: Wanted) -> BeforeValidator:
    """Return a validator for one of some words, as ``_known``."""
    return BeforeValidator(lambda value, info: _known(value, known, info.field_name))


def _two_levels(given: Pair) -> Pair:
    _not_zero(given[1] - given[0])
    return given


def _not_zero(factor: float) -> float:
    if factor == 0.0:
        raise ValueError("zero")
    return factor


_Truth = Annotated[bool, Strict()]
_Count = Annotated[int, Strict(), Field(ge=1, le=1000)]
_Scale = Annotated[Number, AfterValidator(_not_zero), expected("a factor that is not zero")]
_Sign = Annotated[int, Strict(), Field(ge=-1, le=1), AfterValidator(_not_zero), expected("1 or -1")]
_Name = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1),
    Field(coerce_numbers_to_str=True),  # columns without a header are named by their numbers
]
_Range = Annotated[
    tuple[Number, Number],
    AfterValidator(_two_levels),
    expected("two numbers, what stands for no and for full command, such as [1000, 2000]"),
]
_Body = Annotated[str, _one_of(("flu", "frd", "y_up"))]
_Order = Annotated[Order, BeforeValidator(rotor_order)]


class _Form:
    __pydantic_config__: ClassVar[ConfigDict] = STRICT


@dataclass(frozen=True)
class Columns(_Form):
    """Columns of one kind, with unit, scale and signs."""

    columns: tuple[_Name, ...]
    unit: str = ""
    scale: _Scale = 1.0
    signs: tuple[_Sign, ...] = ()  # one a column; empty: all as they stand
    optional: _Truth = False
    note: str = ""
    topic: str = ""  # of the columns' messages; empty: any

    @property
    def label(self) -> str:
        """The columns' common name: their topic, else the first of them."""
        return self.topic or self.columns[0] + " ..." * (len(self.columns) > 1)

    @property
    def named(self) -> Lines:
        """The columns of the table, without constants such as ``=0``."""
        return [name for name in self.columns if constant(name) is None]


@dataclass(frozen=True)
class TimeColumn(_Form):
    """The clock."""

    column: _Name = ""
    unit: Annotated[str, _one_of(UNITS["time"])] = "s"
    nanoseconds: str = ""  # column of nanoseconds beyond whole seconds
    offset: Number | None = None  # s, added; None: the flight begins at 0
    rate_hz: Positive = 0.0  # of rows, without a column
    note: str = ""
    optional: ClassVar[bool] = False

    @property
    def named(self) -> Names:
        """The columns of the table."""
        return tuple(filter(None, (self.column, self.nanoseconds)))

    def raw(self, columns: ArrayMap) -> Array:
        """Return times (N,) in its unit."""
        if not self.nanoseconds:
            return columns[self.column]
        return columns[self.column] + 1e-9 / UNITS["time"][self.unit] * columns[self.nanoseconds]


@dataclass(frozen=True)
class Position(Columns):
    """A position."""

    held: _Truth = False  # a repeated value is no measurement


@dataclass(frozen=True)
class Attitude(Columns):
    """A quaternion, or Euler angles about x, y and z."""

    order: Annotated[str, _one_of(("wxyz", "xyzw"))] = "wxyz"  # order of a quaternion's columns
    euler: Annotated[str, _one_of(("xyz", "xzy", "yxz", "yzx", "zxy", "zyx"))] = (
        ""  # of turns; empty: a quaternion
    )
    sense: Annotated[str, _one_of(SENSES)] = "body_to_world"
    of: Names = ()  # topics of positions; empty: of all


@dataclass(frozen=True)
class Rotors(Columns):
    """Measured rotor speeds."""

    order: _Order = ORDERS["windwrench"]
    pole_pairs: _Count = 1


@dataclass(frozen=True)
class Commands(Columns):
    """Motor commands."""

    order: _Order = ORDERS["windwrench"]
    range: _Range | None = None  # None: as of the vehicle's motor curve
    thrust_factor: Annotated[Number, Field(ge=0.0, le=1.0)] = 1.0
    thrust_span: tuple[Number, Number] = (0.0, 1.0)  # commands at which u is 0 and 1
    clip: _Truth = False
    thrust: tuple[Number, ...] = ()  # N a motor, of the count's powers 0, 1, 2
    full_voltage: Positive = 1.0  # V, at which ``thrust`` holds
    thrust_source: str = ""  # source of ``thrust``


@dataclass(frozen=True)
class Battery(Columns):
    """The battery's voltage."""

    cells: _Count = 1
    late: Number = 0.0  # s, delay of the logged voltage


@dataclass(frozen=True)
class Sensor(Columns):
    """An inertial sensor of three axes."""

    body: _Body = ""  # empty: the map's


def _section(given: Any, inner: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
    """Check a section: the number of columns, their unit and signs."""
    name = info.field_name or ""
    count = SECTIONS.get(name, 0)
    units: Wanted = COMMAND_UNITS if name == "commands" else UNITS.get(name, ())
    stated = given if isinstance(given, Mapping) else {}
    if stated:
        given = {str(key): value for key, value in stated.items() if value is not None}
        if count == 1 and "column" in given:
            given["columns"] = [given.pop("column")]
        given.setdefault("columns", [])
    part = inner(given)
    is_euler = isinstance(part, Attitude) and part.euler
    needed, found = 3 if is_euler else count, len(part.columns)
    if found != (needed or max(1, found)):
        words = {0: "some columns", 1: "one column"}.get(needed, f"a list of {needed} columns")
        raise ValueError(f"must have {words} of the table, got {list(part.columns)!r:.100}")
    if len(part.signs) not in (0, found):
        raise ValueError(f"must have signs of {found} times 1 or -1, got {list(part.signs)!r:.100}")
    if units and (part.unit or is_euler or not isinstance(part, Attitude)):
        part = replace(part, unit=_known(part.unit or next(iter(units)), units, "unit"))
    if part.unit == "raw" and "scale" not in stated:
        raise ValueError("has unit raw without a scale; expected the scale to SI units")
    if part.unit == "eRPM" and "pole_pairs" not in stated:
        raise ValueError(
            "has unit eRPM without pole_pairs; expected the motors' pairs of poles (7 on most "
            "motors of 5-inch racers, 6 on smaller ones)"
        )
    if isinstance(part, Commands) and part.range is None:
        part = replace(part, range=COMMAND_UNITS[part.unit])
    return part


_Section = Annotated[_T, WrapValidator(_section)]
_Part = _Section[_T] | None


def _clock(time: TimeColumn) -> TimeColumn:
    if bool(time.column) == bool(time.rate_hz):
        raise ValueError("must have one column of the table, or rate_hz above 0 without one")
    return time


@dataclass(frozen=True)
class LogMap(_Form):
    """The meaning of a table's columns."""

    time: Annotated[TimeColumn, AfterValidator(_clock)]
    world: Annotated[str, _one_of(WORLDS), AfterValidator(WORLDS.__getitem__)] = "enu"
    body: _Body = "flu"
    position: _Part[Position] = None
    attitude: _Part[Attitude] = None
    rotors: _Part[Rotors] = None
    commands: _Part[Commands] = None
    wrench: _Part[Columns] = None
    battery: _Part[Battery] = None
    accelerometer: _Part[Sensor] = None
    gyro: _Part[Sensor] = None
    force: _Part[Columns] = None
    torque: _Part[Columns] = None
    about: str = ""
    vehicle: str = ""
    recognise: Names = ()
    name: str = ""  # source: a shipped map's name or a file
    notes: Names = ()
    rows: Literal["mixed", "whole", "messages"] = "mixed"
    stray_rows: Annotated[int, Field(ge=0)] = 0
    extra: Mapping[str, _Section[Columns]] = field(default_factory=dict)
    # further ways to fill a section (``time`` among them), in their order
    alternatives: Mapping[str, Ways] = field(default_factory=dict)

    @property
    def sections(self) -> dict[str, Columns]:
        """The sections of the map, without the time."""
        return {name: part for name in SECTIONS if (part := getattr(self, name)) is not None}

    @property
    def is_own(self) -> bool:
        """Are the columns this kit's own?"""
        return self.name == OWN_MAP

    def ways(self, section: str) -> Ways:
        """Return the ways to fill a section, in their order."""
        first = getattr(self, section)
        return () if first is None else (first, *self.alternatives.get(section, ()))

    def with_ways(self, ways: Mapping[str, Sequence[Any]]) -> "LogMap":
        """Return the map with these ways to fill its sections, without empty ones."""
        first: Data = {name: listed[0] if listed else None for name, listed in ways.items()}
        others = {name: tuple(listed[1:]) for name, listed in ways.items()}
        return replace(self, **first, alternatives={**self.alternatives, **others})

    def with_order(self, order: Order) -> "LogMap":
        """Return the map with this order of rotors and commands."""
        motors = "rotors", "commands"
        return self.with_ways({n: [replace(w, order=order) for w in self.ways(n)] for n in motors})

    @property
    def wanted(self) -> Lines:
        """The map's columns, each once."""
        parts = [way for section in self.sections for way in self.ways(section)]
        parts += [*self.extra.values(), self.time]
        return list(dict.fromkeys(name for part in parts for name in part.named if name))

    @property
    def topics(self) -> set[str]:
        """The kinds of messages of the columns."""
        return {way.topic for section in self.sections for way in self.ways(section)}


_FIELDS = [field.name for field in fields(LogMap) if field.name not in ("name", "alternatives")]


def constant(name: str) -> float | None:
    """Return the constant of a column's name such as ``=0``."""
    if not name.startswith("="):
        return None
    try:
        return float(name[1:])
    except ValueError:
        return None


def map_names() -> Lines:
    """Return the names of the kit's own maps."""
    return sorted(path.stem for path in MAPS.glob("*.yaml"))


def load_map(name: str | Path) -> LogMap:
    """Return a map of the kit, by its name, or of a YAML file.

    Raises:
        InputError: the name is unknown, the file is no map, or leaves a field open; the message
            says where, and the expected value.
    """
    path, known = Path(name), map_names()
    if (text := str(name)) in known:
        return shipped_map(text)
    if path.suffix.lower() not in (".yaml", ".yml") and not path.exists():
        raise unknown_name("map", text, [*known, "the path of a YAML file"])
    content = read_yaml(path, "a map file")
    for section, part in content.items() if isinstance(content, Mapping) else ():
        for field_name, value in part.items() if isinstance(part, Mapping) else ():
            if value == UNKNOWN or (isinstance(value, list) and UNKNOWN in value):
                # a comment beside the field holds the candidates
                text = path.read_text(encoding="utf-8-sig")
                noted = re.search(rf"(?m)^# choose {section}\.{field_name}: (.*)$", text)
                raise InputError(
                    f"{path}: {section}.{field_name} is still {UNKNOWN}; expected "
                    f"{noted[1] if noted else 'columns of the table'}"
                )
    return parse_map(content, str(path))


@cache
def shipped_map(name: str) -> LogMap:
    """Return a map of the kit: of tables, or in ``recordings`` of an autopilot's messages."""
    return parse_map(read_yaml(MAPS / f"{name}.yaml", "a map"), f"map {name}", name)


@cache
def stated(name: str) -> Data:
    """Return a file of ``maps/recordings`` other than a map."""
    content: Data = read_yaml(MAPS / "recordings" / f"{name}.yaml", name)
    return content


def parse_map(value: object, where: str, name: str = "") -> LogMap:
    """Return the map stated by a YAML file's value.

    Args:
        value: content of the file.
        where: its source, for errors.
        name: name of the map.

    Raises:
        InputError: a field is unknown, missing, or of another kind.
    """
    if not isinstance(value, Mapping):
        raise InputError(
            f"{where}: expected a mapping of fields such as time and position, got {value!r:.100}"
        )
    given = {str(key): item for key, item in value.items() if item is not None}
    for key in given:
        if key not in _FIELDS:
            raise unknown_name("key", key, _FIELDS, where)
    ways = {key: given[key] for key in ("time", *SECTIONS) if isinstance(given.get(key), list)}
    first = given | {key: listed[0] for key, listed in ways.items() if listed}
    log_map = checked(LogMap, first, where)
    others = {
        key: [getattr(checked(LogMap, first | {key: way}, where), key) for way in listed]
        for key, listed in ways.items()
    }
    check_whole(log_map, where)
    return replace(log_map, name=name or where).with_ways(others)


def check_whole(log_map: LogMap, where: str) -> None:
    """Raise InputError where a map's sections are not enough for a flight log."""
    there = set(log_map.sections)
    has_imu = {"accelerometer", "gyro"} <= there
    pose = {"position", "attitude"} & there
    if len(pose) == 1 and not (log_map.is_own and has_imu):
        (missing,) = {"position", "attitude"} - pose
        raise InputError(
            f"{where}: no section {missing}; expected position and attitude, or neither where "
            "accelerometer and gyro are there"
        )
    if "position" not in there and not has_imu and not log_map.extra:
        raise InputError(
            f"{where}: no pose and no IMU; expected the sections position and attitude, or "
            "accelerometer and gyro"
        )
    if there.isdisjoint(("rotors", "commands", "wrench")):
        raise InputError(f"{where}: no motors; expected a section rotors or commands")
    if len({"force", "torque"} & there) == 1:
        raise InputError(f"{where}: force and torque come together; expected both or neither")
