"""What the fields of a message mean, by the same map as the columns of a log
(``identification.logs.log_map``): one message at a time.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..dynamics.vehicle import Vehicle
from ..identification.logs.log_map import (
    ACCELERATION_UNITS,
    ANGLE_UNITS,
    LENGTH_UNITS,
    RATE_UNITS,
    ROTOR_UNITS,
    TIME_UNITS,
    VOLTAGE_UNITS,
    Columns,
    LogMap,
    Sensor,
    load_map,
)
from ..identification.logs.magnitudes import Magnitudes
from ..identification.logs.mapped_log import BODY_TURNS, WORLD_TURNS
from ..runtime.errors import InputError
from .messages import Array, Sample

_SECOND = 1_000_000_000  # ns
_NORM_TOLERANCE = 0.02  # of a quaternion's length, as in a log
_OUTSIDE = 0.01  # of a command's range, beyond which it is none of that range
_LARGEST = Magnitudes().largest


class Malformed(ValueError):  # noqa: N818 - of one message, not of the request
    """A message that says nothing: why, in words."""


class FieldMap:
    """From a message's fields to what it holds.

    Args:
        log_map: what the fields mean; None: they are this kit's columns.
        vehicle: whose motor curve states the range of commands that the map does not.
        where: they come from, for errors.
    """

    def __init__(self, log_map: LogMap | None, vehicle: Vehicle, where: str) -> None:
        own = log_map is None
        given = load_map("windwrench") if log_map is None else log_map
        if own and given.rotors is not None:  # a log of commands alone has no rotor speeds
            given = replace(given, rotors=replace(given.rotors, optional=True))
        commands = given.commands
        if commands is not None and commands.range is None:
            if vehicle.motor_curve is None:
                raise InputError(
                    f"{where}: map {given.name}: commands: unit counts without a range; expected "
                    "what stands for no and for full command, such as range: [0, 65535], or a "
                    "vehicle whose motor_curve states it"
                )
            given = replace(given, commands=replace(commands, range=vehicle.motor_curve.command))
        self.map, self.where = given, where
        self._rows = 0
        self._world, self._body = WORLD_TURNS[given.world], BODY_TURNS[given.body]
        self._turned = given.world != "enu" or given.body != "flu"
        self._sections = given.sections

    def check(self, names: Iterable[str]) -> None:
        """Check that the fields of all messages are there.

        Raises:
            InputError: one is missing.
        """
        there = set(names)
        needed = [self.map.time.column] if self.map.time.column else []
        motors = False
        for section, part in self._sections.items():
            wanted = [name for name in part.columns if not name.startswith("=")]
            if part.optional and not there & set(wanted):
                continue
            motors |= section in ("rotors", "commands")
            needed += wanted
        missing = [name for name in needed if name not in there]
        if not motors:
            rotors = self.map.rotors or self.map.commands
            missing += [] if rotors is None else rotors.columns
        if missing:
            raise InputError(
                f"{self.where}: no field {', '.join(missing)}; found "
                f"{', '.join(sorted(there)[:30]) or 'none'}; expected "
                + (
                    "this kit's columns t, px, py, pz, qw, qx, qy, qz, omega1 ... omega4 (or "
                    "cmd1 ... cmd4), or --map, a file that says what the fields mean"
                    if self.map.name == "windwrench"
                    else f"those of the map {self.map.name}"
                )
            )

    def sample(self, kind: str, fields: Mapping[str, Any], arrival: int) -> Sample:
        """Return what a message holds.

        Args:
            kind: of message.
            fields: by name: numbers; None, NaN or nothing where there is none.
            arrival: ns, when it came.

        Raises:
            Malformed: a part of it is there by halves, or is no number that a flight has.
        """
        given = self.map
        found = Sample(kind, self._stamp(fields), arrival)
        for name, part in self._sections.items():
            values = _values(part, name, fields)
            if values is None:
                continue
            if name == "position":
                found.position = values * LENGTH_UNITS[part.unit]
            elif name == "attitude":
                found.quaternion = self._attitude(values)
            elif name == "rotors":
                assert given.rotors is not None
                unit = ROTOR_UNITS[part.unit] / given.rotors.pole_pairs
                order = [motor - 1 for motor in given.rotors.order]
                found.rotor_speeds = np.abs(values[order] * unit)
            elif name == "commands":
                found.command = self._commands(values)
            elif name == "battery":
                assert given.battery is not None
                volts = float(values[0]) * VOLTAGE_UNITS[part.unit] * given.battery.cells
                found.voltage = volts if volts > 0.0 else None
            elif isinstance(part, Sensor):
                units = ACCELERATION_UNITS if name == "accelerometer" else RATE_UNITS
                turn = BODY_TURNS[part.body or given.body]
                setattr(found, name, turn @ (values * units[part.unit]))
            else:  # the true force or torque
                setattr(found, name, values * (1e-3 if part.unit.startswith("m") else 1.0))
        if self._turned:
            for name in ("position", "force", "torque"):
                if (value := getattr(found, name)) is not None:
                    setattr(found, name, self._world @ value)
        if (found.position is None) != (found.quaternion is None):
            missing = "attitude" if found.quaternion is None else "position"
            raise Malformed(f"a pose without {missing}")
        motors = found.has_motors
        named = given.position is not None and any(x in fields for x in given.position.columns)
        found.whole = motors and (found.has_pose or named)  # named: the pose was lost
        return found

    def _stamp(self, fields: Mapping[str, Any]) -> int:
        clock = self.map.time
        if not clock.column:
            self._rows += 1
            return round((self._rows - 1) * _SECOND / clock.rate_hz)
        value = fields.get(clock.column)
        if isinstance(value, int) and not isinstance(value, bool):
            if abs(value) < 2**63:
                return round(value * round(TIME_UNITS[clock.unit] * _SECOND))
        elif isinstance(value, float) and math.isfinite(value) and abs(value) < 1e12:
            return round(value * (TIME_UNITS[clock.unit] * _SECOND))
        raise Malformed(f"field {clock.column}: {_shown(value)}; expected a time")

    def _attitude(self, values: Array) -> Array:
        part = self.map.attitude
        assert part is not None
        if part.euler:
            about = {"x": 0, "y": 1, "z": 2}
            angles = values[[about[axis] for axis in part.euler]] * ANGLE_UNITS[part.unit]
            turn = Rotation.from_euler(part.euler.upper(), angles)
            quaternion = np.asarray(turn.as_quat(scalar_first=True))
        else:
            quaternion = values[[3, 0, 1, 2]] if part.order == "xyzw" else values
            length = float(np.linalg.norm(quaternion))
            if not abs(length - 1.0) <= _NORM_TOLERANCE:
                raise Malformed(
                    f"a quaternion of length {length:.4g}; expected 1 within {_NORM_TOLERANCE:g}"
                )
            quaternion = quaternion / length
        if part.sense == "world_to_body":
            quaternion = quaternion * np.array([1.0, -1.0, -1.0, -1.0])
        if self._turned:
            matrix = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
            turn = Rotation.from_matrix(self._world @ matrix @ self._body.T)
            quaternion = np.asarray(turn.as_quat(scalar_first=True))
        return quaternion

    def _commands(self, values: Array) -> Array:
        part = self.map.commands
        assert part is not None
        assert part.range is not None
        low, high = part.range
        u = (values[[motor - 1 for motor in part.order]] - low) / (high - low)
        if np.all((u < -_OUTSIDE) | (u > 1.0 + _OUTSIDE)):
            raise Malformed(
                f"motor commands {', '.join(f'{x:g}' for x in values)}; expected {low:g} to "
                f"{high:g}"
            )
        return np.clip(u, 0.0, 1.0)


def _values(part: Columns, section: str, fields: Mapping[str, Any]) -> Array | None:
    """Return a section's numbers, with signs and scale; None where it has none."""
    given: list[Any] = [fields.get(name) for name in part.columns]
    if all(type(value) is float for value in given):  # nearly always, and quick
        total = sum(given)
        if total == total and max(given) <= _LARGEST and min(given) >= -_LARGEST:
            return _scaled(np.array(given), part)
    elif not any(value is not None for value in given) and not any(
        name[0] == "=" for name in part.columns
    ):
        return None
    return _checked(part, section, fields)


def _scaled(values: Array, part: Columns) -> Array:
    if part.signs:
        values = values * np.array(part.signs, dtype=np.float64)
    return values * part.scale if part.scale != 1.0 else values


def _checked(part: Columns, section: str, fields: Mapping[str, Any]) -> Array | None:
    """Return the same of numbers that may be none; say what is wrong with them."""
    numbers = []
    for name in part.columns:
        value = float(name[1:]) if name.startswith("=") else fields.get(name)
        if value is None:
            numbers.append(math.nan)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            try:
                numbers.append(float(value))
            except OverflowError:
                numbers.append(math.inf)
        else:
            raise Malformed(f"field {name}: {_shown(value)}; expected a number")
    missing = [
        name
        for name, value in zip(part.columns, numbers, strict=True)
        if math.isnan(value) and not name.startswith("=")
    ]
    if missing:
        named = [name for name in part.columns if not name.startswith("=")]
        if len(missing) == len(named):
            return None
        raise Malformed(
            f"no field {', '.join(missing)}; expected all of {', '.join(named)} ({section})"
        )
    values = _scaled(np.array(numbers), part)
    if not np.all(np.abs(values) <= _LARGEST):
        raise Malformed(
            f"{section}: {', '.join(f'{x:.3g}' for x in values)}; expected numbers of a flight"
        )
    return values


def _shown(value: object) -> str:
    return "missing" if value is None else repr(value)[:60]
