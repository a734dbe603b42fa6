"""A guessed map for a table without one, from every flight's physics, the size of the numbers, and
the columns' names. Each field is certain or a guess, with the reason; an unknown field is ``?``,
beside its candidates.

``column_parts`` finds each part's columns. The specific force points along the thrust axis, so a
horizontal acceleration is gravity times the tilt: this shows the quaternion's order and sense,
frames, degrees and millimetres. Rotors on one side turn the body to the other: this shows their
order. A flight with little motion shows neither; the field is then a guess. A name's unit is taken
unless the numbers contradict the name.
"""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS
from .channels import BODY_TURNS
from .column_names import WORDS, Group, Name, named_alone, take_apart
from .column_parts import (
    SHOWN,
    ColumnCandidate,
    Judge,
    Numbers,
    Verdict,
    candidates,
    named_columns,
)
from .evidence import GOOD, GOOD_TORQUE, Evidence, Fit, RankedFits, likelihood
from .flight_log import LONGEST, SomeVehicle
from .inertial import gyro_shares
from .log_map import (
    COMMAND_UNITS,
    UNITS,
    UNKNOWN,
    Attitude,
    Battery,
    Columns,
    Commands,
    LogMap,
    Rotors,
    Sensor,
    TimeColumn,
)
from .magnitudes import DOUBTFUL, likely_unit, motor_unit, within
from .readings import DECLARED, OTHER, ROTORS, SensorReading, rotations, table_readings
from .table import Array, ArrayMap, Data, NamedArrays, NamedTexts, Names, Table, lengths
from .what_flew import ORDERS, Order, more_rotors, order_names, order_words

_Choice = tuple[str, bool, str]  # value, whether it is certain, and why
_G = UNITS["accelerometer"]["g"]
# fields of a body's turns
_TURNS = (
    "frames.map_world",
    "frames.map_body",
    "attitude.sense",
    "attitude.order",
    "attitude.unit",
    "pitch_sign",
)
_MOTORS = ("motors", "commands")
_GYROS = [
    SensorReading(turn=UNITS["gyro"][unit] * turn, unit=unit, body=body)
    for unit, (body, turn) in product(("rad/s", "deg/s"), BODY_TURNS.items())
]
_EXAMPLES = {
    "position": "x, y, z",
    "attitude": "qw, qx, qy, qz or roll, pitch, yaw",
    "accelerometer": "ax, ay, az",
    "gyro": "gx, gy, gz",
}


@dataclass(frozen=True)
class _Reason:
    """The reason for a field's value."""

    section: str
    field: str
    certain: bool
    why: str
    candidates: Names = ()  # columns for a person's choice, the likeliest first


@dataclass(frozen=True)
class Guess:
    """A guessed map."""

    log_map: LogMap
    reasons: tuple[_Reason, ...]
    unused: Names = ()  # columns
    missing: tuple[_Reason, ...] = ()  # fields ``?``; the log is not read without them

    @property
    def lacks(self) -> str:
        """The missing fields, in one line; empty for a whole map."""
        return "; ".join(f"{m.section}.{m.field}: {m.why}" for m in self.missing)

    @property
    def doubts(self) -> tuple[_Reason, ...]:
        """The uncertain fields."""
        return tuple(reason for reason in self.reasons if not reason.certain)


def guess_map(table: Table, vehicle: SomeVehicle = None) -> Guess:
    """Return a guessed map of a table.

    Args:
        table: a table of any columns, with its line of units.
        vehicle: the vehicle, for the rotors' unit by weight; None: unknown.

    Raises:
        InputError: the table cannot be read.
    """
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # empty or absurd columns
        guessing = _Guessing(table, vehicle)
        missing = tuple(guessing.missing())
    parts = [part for part in guessing.sections.values() if isinstance(part, Columns)]
    used = {*guessing.clocks, *(c for part in parts for c in part.columns)}
    unused = tuple(column for column in table.header if column not in used)
    guessing.sections.setdefault("time", TimeColumn(UNKNOWN))
    return Guess(
        LogMap(**guessing.sections, name="guess"), tuple(guessing.reasons), unused, missing
    )


def _numbers_of(table: Table, names: Sequence[Name]) -> NamedArrays:
    """Return the columns (rows,) of numbers, without columns of later text."""
    numeric = table.numeric or table.header
    wanted = [n.column for n in names if table.header.count(n.column) == 1 and n.column in numeric]
    if len(wanted) * table.rows > LIMITS.table_numbers // 2:  # columns with telling names
        named = named_columns(names)
        wanted = [column for column in wanted if column in named]
    while wanted:
        try:
            return table.read(wanted)
        except InputError as error:
            spoiled = [c for c in wanted if str(error).startswith(f"{table.path}: column {c}, ")]
            if not spoiled:
                raise
            wanted = [column for column in wanted if column not in spoiled]
    return {}


def _time_column(names: Sequence[Name], data: ArrayMap) -> Name | None:
    """Return the column of the time: by name, else the first increasing column."""
    there = [name for name in names if name.column in data]
    for name in named_alone(there, "time"):
        values = data[name.column]
        steps = np.diff(values[np.isfinite(values)])
        if (steps > 0.0).any() and (steps >= 0.0).mean() > 0.9:
            return name
    rises = (n for n in there if len(x := data[n.column]) > 2 and (np.diff(x) > 0.0).all())
    return next(rises, None)


def _explained(ranking: RankedFits | None) -> float:
    """Return the share explained by the best reading; 0: less than half, or nothing is known."""
    left = 1.0 if ranking is None else ranking.fit.horizontal
    return 1.0 - left if left <= GOOD else 0.0


class _Guessing:
    """The state of a guess: the columns of each part, the sections of the map, and reasons."""

    def __init__(self, table: Table, vehicle: SomeVehicle) -> None:
        self.table, self.vehicle = table, vehicle
        self.sections: Data = {}
        self.reasons: list[_Reason] = []
        self.ranked: dict[str, list[ColumnCandidate]] = {}  # of each part
        self.parts: dict[str, Group] = {}  # the first of the candidates, if likely
        self.unnamed: set[str] = set()  # sections without telling names
        self.further: NamedTexts = {}  # words on more than four motors, by part
        self.ranking: RankedFits | None = None  # of the pose
        names = take_apart(table.header, table.units)
        self.data = _numbers_of(table, names)
        self.clock = _time_column(names, self.data)
        self.t: Array = 0.01 * np.arange(0.0, table.rows)
        if self.clock is not None:
            # a column of nanoseconds may stand beside a clock of whole seconds
            key = re.sub("(^|_)secs?$", "", self.clock.base)
            fine = {f"{key}_{word}".strip("_") for word in WORDS["nanoseconds"]}
            beside = next((name.column for name in names if name.base in fine), "")
            self.t = self.time(self.clock, beside)
        self.clocks = self.sections.get("time", TimeColumn()).named
        self.free = [name for name in names if name.column not in self.clocks]
        self.numbers = numbers = Numbers(self.t, self.data)
        self.battery()
        attitude = self.choose("attitude", numbers.quaternion)
        force = self.choose("accelerometer", numbers.gravity)
        place = self.choose("position", self.follows_tilt)
        numbers.feel(force, place)
        motors = [part for part in _MOTORS if self.choose(part, numbers.moves_together)]
        if attitude and place:
            self.pose(place, attitude)
        if force:
            self.accelerometer(force)
        if gyro := self.choose("gyro", self.turns_alike):
            self.gyro(gyro)
        for part in motors:
            self.motors(part, self.parts[part])

    def choose(self, part: str, judge: Judge) -> Group | None:
        """Return the likeliest columns of a part, and take them from later parts; None: there are
        none. Other likely columns are a reason for doubt.
        """
        ranked = self.ranked[part] = candidates(part, self.free, self.numbers, judge)
        if not ranked or ranked[0].score <= 0.0:
            return None
        group = self.parts[part] = ranked[0].group
        self.free = [name for name in self.free if name.column not in group.columns]
        if part != "commands" and not ranked[0].why.startswith("by"):
            self.unnamed.add(part)
        likely = [c for c in ranked if c.score > max(0.0, ranked[0].score - 2.0)]
        if part in _EXAMPLES and (len(likely) > 1 or part in self.unnamed):
            field = "order" if len(group.columns) == 4 else "columns"
            self.say(part, field, False, "; or ".join(map(str, likely[:SHOWN])))
        return group

    def values(self, columns: Names) -> Array:
        """Return the values (N, k) of columns."""
        return np.column_stack([self.data[name] for name in columns])

    def missing(self) -> list[_Reason]:
        """Return the fields missing for a flight log."""
        lacks: NamedTexts = {}
        if self.clock is None:
            lacks["time"] = "no column looks like a time; expected one such as t, time or timestamp"
            for name in named_alone(self.free, "time"):
                x = self.data.get(name.column, np.zeros(0))
                if len(x) > 1 and (np.diff(x) == 0.0).mean() > 0.9:
                    lacks["time"] = (
                        f"column {name.column} is {x[0]:g} in nearly every row: a program that "
                        "wrote the table left out its digits; expected a time in each row"
                    )
                    break
        pose, imu, has = ("position", "attitude"), ("accelerometer", "gyro"), {*self.sections}
        if "position" not in has and not has.issuperset(imu):
            half = [part for part in pose if part in self.parts]
            # the nearest to a whole: half a pose, half an IMU, else a pose
            for part in pose if half or not has.intersection(imu) else imu:
                if part in half:
                    self.half_a_pose(part)
                elif part not in has:
                    lacks[part] = f"no columns look like one (such as {_EXAMPLES[part]})"
        lacks |= self.further
        if not self.further and has.isdisjoint(("rotors", "commands")):
            lacks["motors"] = (
                "no columns look like four motors (such as rpm1 to rpm4, motor[0] to motor[3])"
            )
        return [
            _Reason(
                "rotors" if part in _MOTORS else part,
                "column" if part == "time" else "columns",
                False,
                why,
                tuple(map(str, self.ranked.get(part, [])[:SHOWN])),
            )
            for part, why in lacks.items()
        ]

    def half_a_pose(self, part: str) -> None:
        """Keep a position without an attitude, or the reverse, for a person to complete."""
        columns, unit = self.parts[part].columns, self.parts[part].unit
        most = abs(self.numbers.some(columns)).max(initial=0.0)
        made = Columns(columns, unit or "m")
        if part == "attitude":
            made = Attitude(columns)
            if len(columns) == 3:
                unit = unit or ("deg" if most > 2.0 * np.pi else "rad")
                made = Attitude(columns, unit, euler="zyx")
        self.say(part, "columns", False, self.ranked[part][0].why)
        if made.unit:
            self.say(part, "unit", False, f"{made.unit}: values up to {most:.3g}")
        self.sections[part] = made

    def say(self, section: str, name: str, certain: bool, why: str) -> None:
        """Keep the reason for a field's value."""
        certain = certain and section not in self.unnamed
        self.reasons.append(_Reason(section, name, certain, why))

    def take(self, section: str, name: str, choice: _Choice) -> str:
        """Return the choice for a field, and keep the reason."""
        value, sure, why = choice
        self.say(section, name, sure, f"{value}: {why}")
        return value

    def unit(self, section: str, named: str, choice: _Choice) -> str:
        """Return a section's unit: by its columns' names unless the numbers are certain of another,
        else as guessed.
        """
        guessed, sure, why = choice
        if named in UNITS[section]:
            choice = named, True, "by the columns' names"
            if sure and guessed != named:
                choice = guessed, False, f"{why}, though the columns' names say {named}"
        return self.take(section, "unit", choice)

    def time(self, clock: Name, nanoseconds: str) -> Array:
        """Find the unit of the time; return times (N,) in s of the middle of a long flight, NaN
        elsewhere.
        """
        raw = TimeColumn(clock.column, nanoseconds=nanoseconds).raw(self.data)
        known, units = raw[np.isfinite(raw)], UNITS["time"]
        steps = np.diff(known)
        step = max(float(np.median(steps[steps > 0.0])), 1e-300)
        guessed, sure = likely_unit("time", step)
        if clock.unit in units:  # an unusual rate (Hz) is no reason to doubt a name
            sure &= not within(1.0 / (step * units[clock.unit]), (0.5, 20000.0))
        choice = guessed, sure, f"{1.0 / (step * units[guessed]):.4g} rows a second"
        unit = self.unit("time", "s" if nanoseconds else clock.unit, choice)
        t = (raw - known[0]) * units[unit]
        middle = 0.5 * (np.nanmin(t) + np.nanmax(t))
        self.sections["time"] = TimeColumn(clock.column, unit, nanoseconds)
        return np.where(abs(t - middle) <= 0.5 * LONGEST, t, np.nan)

    def pose_fits(self, place: Group, group: Group) -> RankedFits:
        """Return the fits of a pose in each of a map's frames, units, orders and senses."""
        attitude = self.values(group.columns)
        units: Names = ("deg", "rad")
        if np.nanmax(abs(attitude[:, :2]), initial=0.0) > np.pi:
            units = ("deg",)
        elif group.unit in units:
            units = (group.unit,)
        orders = ("wxyz", "xyzw") if group.numbered else ("wxyz",)
        readings = table_readings(
            orders if len(group.columns) == 4 else (),
            units,
            place.unit,
            hint="ned" if re.search("ned|down|d$", "".join(place.columns).lower()) else "",
        )
        motors = [self.values(self.parts[part].columns) for part in _MOTORS if part in self.parts]
        thrusts = [*motors, np.ones((len(self.t), 4))][0] ** 2
        evidence = Evidence(self.t, thrusts, self.values(place.columns), attitude)
        return RankedFits(evidence.fit(reading, torques=False) for reading in readings)

    def follows_tilt(self, columns: Names) -> Verdict:
        """Return the share of three columns' horizontal acceleration by a quaternion's tilt; 0
        where the tilt drives less than half.
        """
        attitude = self.parts.get("attitude")
        if attitude is None or len(attitude.columns) == 3:
            return 0.0, ""
        ranking = self.pose_fits(Group(columns), attitude)
        return _explained(ranking), "their acceleration follows the tilt"

    def pose(self, place: Group, group: Group) -> None:
        """Find frames, units, order and sense of the pose."""
        self.ranking = ranking = self.pose_fits(place, group)
        best = ranking.best
        length = self.unit("position", place.unit, ranking.says("length"))
        fields = [
            ("world", "", "frames.map_world"),
            ("body", "", "frames.map_body"),
            ("attitude", "sense", "attitude.sense"),
        ]
        if best.attitude.euler:
            guessed = ranking.says("attitude.unit")
            if len({fit.reading.attitude.unit for fit in ranking.ranked}) == 1:
                guessed = guessed[0], guessed[0] != group.unit, "angles beyond pi"
            self.unit("attitude", group.unit, guessed)
            fields += [("attitude", "euler", "attitude.euler"), ("attitude", "signs", "pitch_sign")]
        elif group.numbered:
            fields.append(("attitude", "order", "attitude.order"))
        else:
            self.say("attitude", "order", True, "by the columns' names")
        for section, name, prop in fields:
            self.take(section, name, ranking.says(prop))
        self.sections |= {"world": best.frames.map_world, "body": best.frames.map_body}
        self.sections["position"] = Columns(place.columns, length)
        self.sections["attitude"] = replace(best.attitude, columns=group.columns)

    def accelerometer(self, group: Group) -> None:
        """Find unit and axes of the accelerometer by gravity."""
        values = self.values(group.columns)
        size = max(float(np.nanmedian(lengths(values))), 1e-12)
        z = np.nanmean(values[:, 2]) / size
        # without a pose, a negative z may also be gravity in place of the specific force
        sure = bool(z > 0.8 or (z < -0.8 and self.ranking))
        why = f"along z it reads {z:+.2f} of its size"
        axes = self.take("accelerometer", "body", ("flu" if z > 0.0 else "frd", sure, why))
        guessed, is_gravity = likely_unit("accelerometer", size)
        units, why, scale = UNITS["accelerometer"], f"its median size is {size:.4g}", 1.0
        if group.unit in units or is_gravity:
            guessed = guessed if is_gravity else group.unit
            unit = self.unit("accelerometer", group.unit, (guessed, True, why))
            if unit == group.unit and not within(size * units[unit] / _G, DOUBTFUL):
                self.say("accelerometer", "unit", False, f"{unit}: {why}, which is not gravity's")
        else:
            scale = float(f"{_G / size:.6g}")
            why += ", which is taken for the 9.81 m/s2 of a hover"
            unit = self.take("accelerometer", "scale", ("raw", False, why))
        self.sections["accelerometer"] = Sensor(group.columns, unit, scale=scale, body=axes)
        if self.ranking is None:
            self.sections["body"] = axes

    def gyro_fits(self, columns: Names, unit: str = "") -> RankedFits | None:
        """Return fits of columns to the pose's turns, by each unit and body axes; None: no pose, or
        too short a pose. Another unit than a named one has a penalty.
        """
        if self.ranking is None:
            return None
        times, attitude = self.numbers.rows(self.parts["attitude"].columns)
        times, first = np.unique(times, return_index=True)
        good, rotation = rotations(attitude[first], self.ranking.best)
        t, values = self.numbers.rows(columns)
        shares = gyro_shares(t, values, times[good], rotation, _GYROS) or []
        fits = [
            Fit(
                way, left, 1.0, float(likelihood([left] * 3)) - OTHER * (unit not in ("", way.unit))
            )
            for way, left in zip(_GYROS, shares, strict=False)
        ]
        return RankedFits(fits, "attitude's rate stays unexplained") if fits else None

    def turns_alike(self, columns: Names) -> Verdict:
        """Return the share of the pose's turns in three columns, at most 1; 0 where they turn
        otherwise.
        """
        return _explained(self.gyro_fits(columns)), "they turn as the attitude does"

    def gyro(self, group: Group) -> None:
        """Find unit and axes of the gyro: from the pose's turns, or from size and accelerometer."""
        ranking = self.gyro_fits(group.columns, group.unit if group.unit in UNITS["gyro"] else "")
        if ranking is not None:
            guessed = ranking.says("unit")
            axes, sure, why = ranking.says("body")
            assert self.ranking is not None
            sure &= self.ranking.certain(*_TURNS)
            self.take("gyro", "body", (axes, sure, why))
        else:
            axes = self.sections.get("body", "flu")
            told = {(r.section, r.field) for r in self.reasons if r.certain}
            sure = self.ranking is None and ("accelerometer", "body") in told
            self.say("gyro", "body", sure, "as the accelerometer's")
            high = float(np.nanquantile(abs(self.values(group.columns)), 0.995))
            # 99.5 % of a flight's angular velocities are less than 6 rad/s; 35 rad/s
            # (2000 deg/s) is the range of usual gyros
            unit = "deg/s" if high > 6.0 else "rad/s"
            guessed = unit, high > 35.0, f"its fast values are {high:.3g}"
        unit = self.unit("gyro", group.unit, guessed)
        self.sections["gyro"] = Sensor(group.columns, unit, body=axes)

    def motors(self, part: str, group: Group) -> None:
        """Find unit and order of rotor speeds or commands, unless the map has such a section."""
        values = self.values(group.columns)
        kind, unit, sure, why = motor_unit(
            group, values, self.vehicle, self.numbers.elasticity(values)
        )
        if more := more_rotors(group.columns, self.table):
            self.further[part] = more
            return
        if kind in self.sections:
            return
        if part in self.unnamed:
            self.unnamed.add(kind)
        self.take(kind, "unit", (unit, sure, why))
        order, sure, why = self.order(group, values)
        self.say(kind, "order", sure, why)
        if kind == "rotors":
            pairs = 7 if unit == "eRPM" else 1
            if pairs > 1:
                self.say(kind, "pole_pairs", False, "7, of most motors of small racers")
            self.sections[kind] = Rotors(group.columns, unit, order=order, pole_pairs=pairs)
            return
        high = np.nanmax(values, initial=0.0)
        bits = next((bits for bits in (8, 10, 11, 12) if high < 2**bits), 16)
        limits = COMMAND_UNITS[unit] or (0.0, 2.0**bits - 1.0)
        if unit in ("us", "counts", "dshot"):
            self.say(kind, "range", False, f"{limits[0]:g} to {limits[1]:g}, the usual one")
        self.sections[kind] = Commands(group.columns, unit, order=order, range=limits)

    def order(self, group: Group, values: Array) -> tuple[Order, bool, str]:
        """Return the order of the rotors, whether the order is certain, and why."""
        if not group.numbered:
            return ORDERS["windwrench"], True, "the columns are named by the rotors' places"
        text = " ".join(group.columns).lower()
        hint = next((name for word, name in WORDS["orders"].items() if word in text), "windwrench")
        best, motion = DECLARED, Data()
        if "gyro" in self.sections:
            sensor = self.sections["gyro"]
            rates = self.values(sensor.columns) * UNITS["gyro"][sensor.unit]
            motion = {"gyro": rates @ BODY_TURNS[sensor.body].T}
        elif self.ranking is not None and self.ranking.certain(*_TURNS):
            best = self.ranking.best
            motion = {
                part: self.values(self.parts[part].columns) for part in ("position", "attitude")
            }
        evidence = Evidence(self.t, values**2, **motion)
        if not motion or not evidence.enough:
            return ORDERS[hint], False, f"{hint}: the log does not show how the body turns"
        ways = [replace(best, rotors=order) for order in permutations(ROTORS)]
        ranking = RankedFits(map(evidence.fit, ways))
        left, lead, order = ranking.fit.torque, ranking.other("rotors")[1], ranking.best.motors
        names = order_names(order)
        # rad/s: in hovers (0.03 in a simulated one) rotors answer disturbances more than they turn
        # the body, and the mirrored order may explain more
        turns = evidence.turns(best) >= 0.06
        is_sure = left <= GOOD_TORQUE and ranking.certain("rotors") and turns
        if is_sure or (names and left <= 0.9 and lead >= 1.0):
            why = (
                f"{(*names, order_words(order))[0]}: {left:.0%} of the angular acceleration "
                f"stays unexplained; the log likelihood of the next best is {lead:.3g} lower"
            )
            return order, is_sure, why
        why = f"{hint}: no order is much likelier than all others"
        # roll and pitch of a plus, by rotors at the left, rear, right and front
        sides = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])
        evidence = Evidence(self.t, values**2, sides=sides, **motion)
        plus = RankedFits(map(evidence.fit, ways))
        if plus.fit.torque <= GOOD_TORQUE and turns:
            placed = order_words(plus.best.motors, ("left", "rear", "right", "front"))
            why = (
                f"a plus, {placed}: {plus.fit.torque:.0%} of the angular acceleration stays "
                "unexplained; expected a vehicle file with these rotor_positions"
            )
        return ORDERS[hint], False, why

    def battery(self) -> None:
        """Find the battery's voltage and its unit."""
        named = [name for name in named_alone(self.free, "battery") if name.unit != "percent"]
        if not named or (column := named[0].column) not in self.data:
            return
        values = self.data[column]
        middle = float(np.nanmedian(values[values > 0.0]))
        if np.isfinite(middle):
            guessed = *likely_unit("battery", middle), f"its median is {middle:.4g}"
            self.sections["battery"] = Battery(
                (column,), self.unit("battery", named[0].unit, guessed)
            )
