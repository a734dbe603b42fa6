"""A map for a table that brings none: guessed from the columns' names, the size of their numbers,
and the physics that every flight obeys. Each field says whether it is certain, and why.

A unit in a name is taken at its word. What names do not say, the flight does: the specific force
points along the thrust axis, so a horizontal acceleration is gravity times the tilt, which tells
the quaternion's order and sense, frames, degrees and millimetres; rotors turn the body towards the
side that they push up, which tells their order. A flight that hardly moves tells neither, and then
the field is a guess.
"""

import re
import warnings
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Any

import numpy as np
import yaml

from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .channels import BODY_TURNS
from .column_names import Group, Name, best_group, groups_of, take_apart, words
from .evidence import EVIDENCE, Evidence, Ranking, likelihood
from .excerpt import LONGEST
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
from .magnitudes import (
    MAGNITUDES,
    carrying_units,
    thrust_by_weight,
    time_unit,
    voltage_unit,
    within,
)
from .readings import DECLARED, ROTORS, rotations, table_readings
from .rotor_orders import ORDERS, Order, order_names, order_words
from .table import Array, Table


@dataclass(frozen=True)
class GuessSettings:
    """When a field is certain."""

    rpm: float = 4500.0  # median above which no unit but rpm is left: no propeller turns at that
    # rate in rad/s
    counts: float = 20_000.0  # median above which rpm may also be a command of 16 bits
    fast_gyro: float = 35.0  # beyond the range of gyros in rad/s (2000 deg/s)
    slow_gyro: float = 6.0  # below which 99.5 % of a flight's angular velocities lie in rad/s


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
        found = _Guessing(table, take_apart(table.header, table.units), vehicle)
        found.time()
        if "position" in found.parts:
            found.pose()
        found.accelerometer()
        found.gyro()
        found.motors("motors")
        found.motors("commands")
        found.battery()
    unused = tuple(column for column in table.header if column not in found.data)
    return Guess(LogMap(**found.sections, name=name), tuple(found.reasons), unused)


def _time_column(table: Table, names: list[Name]) -> Name:
    named = [name for word in words()["time"] for name in names if name.base == word]
    named += [
        name
        for name in names
        if name.base.startswith("time") or name.base.endswith(("time", "timestamp"))
    ]
    if named:
        return named[0]
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


def _groups(names: list[Name]) -> tuple[dict[str, Group], dict[str, int]]:
    """Return the columns of each part, by their names, and how many groups look like each."""
    parts: dict[str, Group] = {}
    rivals: dict[str, int] = {}
    taken: set[str] = set()
    for part, ways in words()["parts"].items():
        for way in ways:
            groups = [
                group
                for kind in ("endings", "numbered")
                for endings in way.get(kind, ())
                for group in groups_of(names, endings, kind == "numbered")
                if not taken & set(group.columns)
            ]
            best, count = best_group(groups, way["words"])
            if best is not None and part not in parts:
                parts[part], rivals[part] = best, count
                taken |= set(best.columns)
    for word in words()["battery"]:
        for name in names:
            if f"_{name.base}".endswith(f"_{word}") and "battery" not in parts:
                parts["battery"] = Group((name.column,), name.base, name.unit)
    return parts, rivals


def _check_enough(table: Table, parts: Mapping[str, Group]) -> None:
    missing = []
    if "position" not in parts and not ("accelerometer" in parts and "gyro" in parts):
        missing.append(
            "a pose (such as x, y, z, qw, qx, qy, qz or roll, pitch, yaw) or an IMU (such as ax, "
            "ay, az, gx, gy, gz)"
        )
    if "motors" not in parts and "commands" not in parts:
        missing.append("four motors (such as rpm1 to rpm4, motor[0] to motor[3])")
    if missing:
        raise InputError(
            f"{table.path}: no columns look like {' or like '.join(missing)}; found "
            f"{', '.join(table.header[:40])}. Write a map by hand"
        )


class _Guessing:
    """What was found so far: the columns of each part, the sections of the map, and reasons."""

    def __init__(self, table: Table, names: list[Name], vehicle: Vehicle | None) -> None:
        self.table, self.vehicle = table, vehicle
        self.clock = _time_column(table, names)
        self.parts, rivals = _groups([n for n in names if n.column != self.clock.column])
        if not {"position", "attitude"} <= set(self.parts):
            self.parts = {k: v for k, v in self.parts.items() if k not in ("position", "attitude")}
        _check_enough(table, self.parts)
        wanted = [self.clock.column, *(c for g in self.parts.values() for c in g.columns)]
        self.data = table.read(list(dict.fromkeys(wanted)))
        self.values = {
            part: np.column_stack([self.data[name] for name in group.columns])
            for part, group in self.parts.items()
        }
        self.sections: dict[str, Any] = {}
        self.reasons: list[Reason] = []
        self.ranking: Ranking | None = None  # of the pose
        for part in ("position", "attitude", "accelerometer", "gyro"):
            if part in self.parts and rivals[part] > 1:
                columns = self.parts[part].columns
                field = "order" if len(columns) == 4 else "columns"
                why = f"{rivals[part]} groups of columns look like it; taken: {columns[0]} ..."
                self.say(part, field, False, why)

    def say(self, section: str, name: str, certain: bool, why: str) -> None:
        """Keep why a field is what it is."""
        self.reasons.append(Reason(section, name, certain, why))

    def take(self, section: str, name: str, choice: _Choice) -> str:
        """Return what is taken for a field, and keep why."""
        value, sure, why = choice
        self.say(section, name, sure, f"{value}: {why}")
        return value

    def unit(
        self, section: str, named: str, known: Container[str], guess: Callable[[], _Choice]
    ) -> str:
        """Return a section's unit: as its columns' names say, or as guessed."""
        choice = (named, True, "by the columns' names") if named in known else guess()
        return self.take(section, "unit", choice)

    def time(self) -> None:
        """Find the unit of the time, and the middle of a long flight."""
        column = self.clock.column
        raw = self.data[column]
        steps = np.diff(raw[np.isfinite(raw)])
        steps = steps[steps > 0.0]
        if not steps.size:
            raise InputError(
                f"{self.table.path}: column {column}: no increasing times; expected a time"
            )
        step = float(np.median(steps))
        guessed, sure = time_unit(step)
        rate = f"{1.0 / max(step * TIME_UNITS[guessed], 1e-300):.4g} rows a second"
        unit = self.unit("time", self.clock.unit, TIME_UNITS, lambda: (guessed, sure, rate))
        self.t = (raw - raw[np.isfinite(raw)][0]) * TIME_UNITS[unit]
        middle = 0.5 * (np.nanmin(self.t) + np.nanmax(self.t))
        self.t[~(np.abs(self.t - middle) <= 0.5 * LONGEST)] = np.nan
        self.sections["time"] = TimeColumn(column, unit)

    def by_motion(self, prop: str) -> _Choice:
        """Return what the motion says of a property of a pose's reading."""
        assert self.ranking is not None
        value, (other, lead) = getattr(self.ranking.best, prop), self.ranking.other(prop)
        left = self.ranking.fit.horizontal
        why = f"{left:.0%} of the horizontal acceleration is left by the tilt"
        if other is not None and lead > 0.0:
            why += f", and {other} is less likely by a log-likelihood ratio of {lead:.3g}"
        return value, self.ranking.certain(prop), why

    def pose(self) -> None:
        """Find frames, units, order and sense of the pose."""
        place, group = self.parts["position"], self.parts["attitude"]
        attitude, is_quaternion = self.values["attitude"], len(group.columns) == 4
        units: tuple[str, ...] = ("deg", "rad")
        if group.unit in units:
            units = (group.unit,)
        elif np.nanmax(np.abs(attitude[:, :2]), initial=0.0) > np.pi:
            units = ("deg",)
        orders = ("wxyz", "xyzw") if group.numbered else ("wxyz",)
        readings = table_readings(
            orders if is_quaternion else (),
            units,
            lengths=(place.unit,) if place.unit in LENGTH_UNITS else ("m", "cm", "mm"),
            hint="ned" if re.search("ned|down", "".join(place.columns).lower()) else "",
        )
        thrusts = np.square(self.values["motors" if "motors" in self.parts else "commands"])
        evidence = Evidence(self.t, thrusts, self.values["position"], attitude)
        self.ranking = Ranking.of(evidence, readings, torques=False)
        best = self.ranking.best
        self.unit("position", place.unit, LENGTH_UNITS, lambda: self.by_motion("length"))
        told = [("world", "", "world"), ("body", "", "body"), ("attitude", "sense", "sense")]
        made = Attitude(group.columns, order=best.order, sense=best.sense)
        if not is_quaternion:
            signs = (1, best.pitch_sign, 1) if best.pitch_sign < 0 else ()
            made = replace(made, unit=best.unit, euler=best.euler, signs=signs)
            beyond = best.unit, True, "angles beyond pi"
            guessed = self.by_motion("unit") if len(units) > 1 else beyond
            self.unit("attitude", group.unit, ANGLE_UNITS, lambda: guessed)
            told += [("attitude", "euler", "euler"), ("attitude", "signs", "pitch_sign")]
        elif group.numbered:
            told.append(("attitude", "order", "order"))
        else:
            self.say("attitude", "order", True, "by the columns' names")
        for section, name, prop in told:
            self.take(section, name, self.by_motion(prop))
        position = Columns(place.columns, best.length)
        self.sections |= {"world": best.world, "body": best.body}
        self.sections |= {"position": position, "attitude": made}

    @property
    def turning_known(self) -> bool:
        """Whether a pose shows how the body turns."""
        names = ("world", "body", "sense", "order", "pitch_sign", "unit")
        return self.ranking is not None and self.ranking.certain(*names)

    def accelerometer(self) -> None:
        """Find unit and axes of the accelerometer by gravity."""
        if "accelerometer" not in self.parts:
            return
        group, values = self.parts["accelerometer"], self.values["accelerometer"]
        size = float(np.nanmedian(np.linalg.norm(values, axis=1)))
        z = float(np.nanmean(values[:, 2])) / max(size, 1e-12)
        # without a pose, turned over may also be gravity in place of the specific force
        sure = abs(z) > 0.8 and (z > 0.0 or self.ranking is not None)
        why = f"along z it reads {'+' if z > 0 else '-'}{abs(z):.2f} of its size"
        axes = self.take("accelerometer", "body", ("flu" if z > 0.0 else "frd", sure, why))
        units = {"m/s2": 1.0, "g": _G}
        likely = [u for u, one in units.items() if within(size * one / _G, MAGNITUDES.gravity)]
        why, scale = f"its median size is {size:.4g}", 1.0
        if group.unit in units or likely:
            unit = self.unit("accelerometer", group.unit, units, lambda: (likely[0], True, why))
        else:
            scale = float(f"{_G / max(size, 1e-12):.6g}")
            why += ", which is taken for the 9.81 m/s2 of a hover"
            unit = self.take("accelerometer", "scale", ("raw", False, why))
        self.sections["accelerometer"] = Sensor(group.columns, unit, scale=scale, body=axes)
        if self.ranking is None:
            self.sections["body"] = axes

    def gyro(self) -> None:
        """Find unit and axes of the gyro: by the pose's turns, or by size and accelerometer."""
        if "gyro" not in self.parts:
            return
        group, values = self.parts["gyro"], self.values["gyro"]
        if self.ranking is None:
            axes = self.sections.get("body", "flu")
            sure = any(
                r.section == "accelerometer" and r.field == "body" and r.certain
                for r in self.reasons
            )
            self.say("gyro", "body", sure, "as the accelerometer's")
            high = float(np.nanquantile(np.abs(values), 0.995))
            unit = "deg/s" if high > GUESS.slow_gyro else "rad/s"
            guessed = unit, high > GUESS.fast_gyro, f"its fast values are {high:.3g}"
        else:
            units = (group.unit,) if group.unit in ("rad/s", "deg/s") else ("rad/s", "deg/s")
            axes, guessed = self.gyro_by_pose(values, units)
            self.take("gyro", "body", (axes, *guessed[1:]))
        unit = self.unit("gyro", group.unit, RATE_UNITS, lambda: guessed)
        self.sections["gyro"] = Sensor(group.columns, unit, body=axes)

    def gyro_by_pose(self, values: Array, units: Sequence[str]) -> tuple[str, _Choice]:
        """Return a gyro's body axes and unit, whether they are sure, and why."""
        assert self.ranking is not None
        good, rotation = rotations(self.values["attitude"], self.ranking.best)
        times = self.t[good]
        seen = np.isfinite(times)
        ways = list(product(units, BODY_TURNS))
        turns = [RATE_UNITS[unit] * BODY_TURNS[body] for unit, body in ways]
        shares = gyro_shares(self.t, values, times[seen], rotation[seen], turns)
        if shares is None:
            return ways[0][1], (ways[0][0], False, "the log is too short")
        first, second = np.argsort(shares)[:2]
        lead = likelihood([shares[first]] * 3) - likelihood([shares[second]] * 3)
        sure = shares[first] <= EVIDENCE.good and lead >= EVIDENCE.certain and self.turning_known
        why = f"{shares[first]:.0%} of the attitude's rate is left unexplained"
        return ways[first][1], (ways[first][0], sure, why)

    def motors(self, part: str) -> None:
        """Find unit and order of rotor speeds or commands, where the map has none of the kind."""
        if part not in self.parts:
            return
        group, values = self.parts[part], self.values[part]
        kind, unit, sure, why = motor_unit(group, values, self.vehicle)
        if kind in self.sections:
            return
        self.take(kind, "unit", (unit, sure, why))
        order, sure, why = self.order(group, values)
        self.say(kind, "order", sure, why)
        if kind == "rotors":
            if unit == "eRPM":
                self.say(kind, "pole_pairs", False, "7, of most motors of small racers")
            pairs = 7 if unit == "eRPM" else 1
            self.sections[kind] = Rotors(group.columns, unit, order=order, pole_pairs=pairs)
            return
        limits = COMMAND_UNITS[unit] or (0.0, 65535.0)
        if unit in ("us", "counts", "dshot"):
            self.say(kind, "range", False, f"{limits[0]:g} to {limits[1]:g}, the usual one")
        self.sections[kind] = Commands(group.columns, unit, order=order, range=limits)

    def order(self, group: Group, values: Array) -> tuple[Order, bool, str]:
        """Return the order of the rotors, whether it is certain, and why."""
        if not group.numbered:
            return ORDERS["windwrench"], True, "the columns are named by the rotors' places"
        text = " ".join(group.columns).lower()
        hint = next(
            (name for word, name in words()["orders"].items() if word in text), "windwrench"
        )
        evidence, best = None, DECLARED
        if "gyro" in self.sections:
            sensor = self.sections["gyro"]
            rates = self.values["gyro"] * RATE_UNITS[sensor.unit] @ BODY_TURNS[sensor.body]
            evidence = Evidence(self.t, np.square(values), gyro=rates)
        elif self.ranking is not None and self.turning_known:
            best = self.ranking.best
            pose = self.values["position"], self.values["attitude"]
            evidence = Evidence(self.t, np.square(values), *pose)
        if evidence is None or not evidence.enough:
            return ORDERS[hint], False, f"{hint}: the log does not show how the body turns"
        ways = [replace(best, rotors=(a, b, c, d)) for a, b, c, d in permutations(ROTORS)]
        ranking = Ranking.of(evidence, ways)
        left, lead = ranking.fit.torque, ranking.other("rotors")[1]
        order = ranking.best.motors
        names = order_names(order)
        why = (
            f"{names[0] if names else order_words(order)}: {left:.0%} of the angular acceleration "
            f"is left, and the next best is less likely by a log-likelihood ratio of {lead:.3g}"
        )
        turns = evidence.turns(best) >= EVIDENCE.turning
        if left <= EVIDENCE.good_torque and ranking.certain("rotors") and turns:
            return order, True, why
        if names and left <= 0.9 and lead >= 1.0:
            return order, False, why
        return ORDERS[hint], False, f"{hint}: no order is much likelier than all others"

    def battery(self) -> None:
        """Find the unit of the battery's voltage."""
        values = self.values.get("battery", np.empty(0))
        values = values[np.isfinite(values) & (values > 0.0)]
        if not values.size:
            return
        group, middle = self.parts["battery"], float(np.median(values))
        guessed = *voltage_unit(middle), f"its median is {middle:.4g}"
        unit = self.unit("battery", group.unit, VOLTAGE_UNITS, lambda: guessed)
        self.sections["battery"] = Battery(group.columns, unit)


def motor_unit(group: Group, values: Array, vehicle: Vehicle | None) -> tuple[str, str, bool, str]:
    """Return whether columns are rotors or commands, their unit, if that is certain, and why: by
    the first rule that holds.
    """
    names = " ".join(group.columns).lower()
    turning = np.abs(values[np.isfinite(values) & (values != 0.0)])
    if not turning.size:
        return "commands", "normalised", False, "all are zero"
    low, middle, high = (float(x) for x in np.quantile(turning, [0.01, 0.5, 1.0]))
    named = group.unit or next((unit for unit in ("eRPM", "rpm") if unit.lower() in names), "")
    commanded = any(word in names for word in words()["command_words"])
    speeds = any(word in names for word in ("omega", "speed", "rotor"))
    pulses = low >= 850.0 and high <= 2250.0
    carrying: list[str] = []
    if vehicle is not None and not commanded:
        there = values[np.isfinite(values).all(axis=1)]
        carrying = [u for u in carrying_units(thrust_by_weight(there, vehicle)) if u in ROTOR_UNITS]
    # numbers of 1000 to 2000 may be pulses as well, whatever they would carry
    doubt = "pulses in us" if pulses else "percents" if high <= 100.0 else ""
    doubt = "" if speeds else doubt
    by_names, between = "by the columns' names", f"values from {low:.4g} to {high:.4g}"
    up_to = f"values up to {high:.6g}"
    carries = f"in it the rotors carry the weight of {vehicle.name if vehicle else ''}"
    carries += f", though they may be {doubt}" if doubt else ""
    rules = (
        (named in ROTOR_UNITS, "rotors", named, True, by_names),
        (high <= 1.0, "commands", "normalised", "omega" not in names, up_to),
        (named in ("us", "percent"), "commands", named, True, by_names),
        (commanded and pulses, "commands", "us", True, between),
        (commanded and high <= 100.0, "commands", "percent", False, up_to),
        (commanded and middle > 4000.0 and high <= 65535.0, "commands", "counts", False, up_to),
        (len(carrying) == 1, "rotors", "".join(carrying), not doubt, carries),
        (
            not commanded and middle > GUESS.counts and high <= 65535.5,
            *("commands", "counts", False),
            f"{up_to}, which may be 16 bits of a command, or rpm",
        ),
        (
            not commanded and middle > GUESS.rpm,
            *("rotors", "rpm", True),
            f"the median is {middle:.5g}, too fast for rad/s",
        ),
        (pulses and "omega" not in names, "commands", "us", False, between),
    )
    otherwise = f"the median is {middle:.4g}; it might be rpm or Hz"
    return next((rule[1:] for rule in rules if rule[0]), ("rotors", "rad/s", False, otherwise))


def map_yaml(guess: Guess) -> str:
    """Return a guessed map as a YAML file; comments say what is certain and what is a guess."""
    m = guess.log_map
    sections: dict[str, Any] = {"vehicle": m.vehicle} if m.vehicle else {}
    sections |= {"time": {"column": m.time.column, "unit": m.time.unit}}
    sections |= {"world": m.world, "body": m.body}
    sections |= {name: _fields(part) for name, part in m.sections.items()}
    lines = ["# A map of this table's columns. What is marked GUESS: check it."]
    for name, value in sections.items():
        for r in (r for r in guess.reasons if r.section == name):
            mark = "certain" if r.certain else "GUESS"
            lines.append(f"# {mark}: {f'{r.field}: ' if r.field else ''}{r.why}")
        flow = False if isinstance(value, str) else None
        text = yaml.safe_dump(
            {name: value}, default_flow_style=flow, sort_keys=False, width=1000, allow_unicode=True
        )
        lines.append(text.rstrip())
    if guess.unused:
        lines.append(f"# columns that are not used: {', '.join(guess.unused)}")
    return "\n".join(lines) + "\n"


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
