"""Messages by a map of their fields (``identification.logs.log_map``), as the columns of a log: one
message is a table of one row.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..identification.logs.channels import in_kit_axes, in_kit_units, quaternions, scaled
from ..identification.logs.log_map import (
    OWN_MAP,
    UNITS,
    Attitude,
    Columns,
    LogMap,
    constant,
    load_map,
)
from ..identification.logs.magnitudes import LARGEST
from ..identification.logs.mapped_log import with_range
from ..runtime.arrays import Array
from .messages import SECOND, Malformed, Measurement, normalised

_OUTSIDE = 0.01  # tolerance, share of a command's range
_FIELDS = {
    "rotors": "rotor_speeds",
    "commands": "command",
}  # others: as the section


class FieldMap:
    """From a message's fields to a measurement.

    Args:
        log_map: meaning of the fields; None: this kit's columns.
        vehicle: its motor curve states the range of commands where the map states none.
        where: origin of the fields, for errors.
    """

    def __init__(self, log_map: LogMap | None, vehicle: Vehicle, where: str) -> None:
        self.map = with_range(log_map or load_map(OWN_MAP), vehicle, where)
        self._rows = 0
        self._sections = {name: self.map.ways(name) for name in self.map.sections}
        self._clocks = self.map.ways("time")

    def sample(self, fields: Mapping[str, Any], arrival: int) -> Measurement:
        """Return the measurement in a message.

        Args:
            fields: numbers by name; None, NaN or no entry: not measured.
            arrival: ns, when the message came.

        Raises:
            Malformed: a quantity is incomplete, none is there, or a number is none of a flight.
        """
        sample = Measurement("row", self._stamp(fields), arrival)
        for section, parts in self._sections.items():
            for part in parts:
                values = _values(part, section, fields)
                if values is not None:
                    self._take(sample, section, part, values)
                    break
        if (sample.position is None) != (sample.quaternion is None):
            missing = "attitude" if sample.quaternion is None else "position"
            raise Malformed(f"a pose without {missing}")
        poses = self._sections.get("position", ())
        named = any(name in fields for part in poses for name in part.columns)  # a lost pose
        sample.whole = sample.has_motors and (sample.has_pose or named)
        there = {
            "pose": sample.has_pose,
            "motors": sample.has_motors,
            "imu": sample.has_imu,
            "battery": sample.voltage is not None,
        }
        if not sample.whole:
            sample.kind = "+".join(name for name, is_there in there.items() if is_there)
        if not sample.kind:
            raise Malformed(
                f"none of the fields that are looked for; found {', '.join(fields)[:200]}; "
                "expected such as px, omega1, gx, vbat, or those of --map"
            )
        return sample

    def _take(self, sample: Measurement, section: str, part: Columns, values: Array) -> None:
        """Put a section's numbers (k,) into a sample, in the kit's units and axes."""
        if isinstance(part, Attitude):
            sample.quaternion = self._attitude(part, values)
            return
        kit = in_kit_units(self.map, section, part, values[None])[0]
        if section == "battery":
            sample.voltage = float(kit[0]) if kit[0] > 0.0 else None
            return
        if section == "rotors":
            kit = np.abs(kit)
        elif section == "commands":
            if np.all((kit < -_OUTSIDE) | (kit > 1.0 + _OUTSIDE)):
                low, high = part.range  # type: ignore[attr-defined]
                raise Malformed(
                    f"motor commands {', '.join(f'{x:g}' for x in values)}; expected {low:g} to "
                    f"{high:g}"
                )
            kit = np.clip(kit, 0.0, 1.0)
        setattr(sample, _FIELDS.get(section, section), kit)

    def _stamp(self, fields: Mapping[str, Any]) -> int | None:
        """Return the time of a message, ns; None: no such field."""
        clock = next((c for c in self._clocks if c.column in fields), self.map.time)
        if not clock.column:
            self._rows += 1
            return round((self._rows - 1) * SECOND / clock.rate_hz)
        if clock.column not in fields:
            return None
        value = fields[clock.column]
        if type(value) in (int, float) and abs(value) < (2**63 if type(value) is int else 1e12):
            stamp: int = round(value * round(UNITS["time"][clock.unit] * SECOND))
            return stamp
        raise Malformed(f"field {clock.column}: {_shown(value)}; expected a time")

    def _attitude(self, part: Attitude, values: Array) -> Array:
        quaternion = quaternions(part, values[None])
        if not part.euler:
            quaternion = normalised(quaternion)
        return np.asarray(in_kit_axes(self.map, part, quaternion)[0])


def _values(part: Columns, section: str, fields: Mapping[str, Any]) -> Array | None:
    """Return a section's numbers, with signs and scale; None: it has none."""
    given: list[Any] = [fields.get(name) for name in part.columns]
    if all(type(x) is float and abs(x) <= LARGEST for x in given):  # nearly always, and quick
        return scaled(part, np.array(given))
    numbers = {name: _number(name, fields) for name in part.columns}
    missing = [name for name in part.named if math.isnan(numbers[name])]
    if missing:
        if len(missing) == len(part.named):
            return None
        raise Malformed(
            f"no field {', '.join(missing)}; expected all of {', '.join(part.named)} ({section})"
        )
    values = scaled(part, np.array([numbers[name] for name in part.columns]))
    if not np.all(np.abs(values) <= LARGEST):
        raise Malformed(
            f"{section}: {', '.join(f'{x:.3g}' for x in values)}; expected numbers of a flight"
        )
    return values


def _number(name: str, fields: Mapping[str, Any]) -> float:
    """Return a field, or the constant in its name; NaN: there is none."""
    fixed = constant(name)
    value = fields.get(name) if fixed is None else fixed
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Malformed(f"field {name}: {_shown(value)}; expected a number")
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _shown(value: object) -> str:
    return "missing" if value is None else repr(value)[:60]
