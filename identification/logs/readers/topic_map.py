"""The topic map of a bag: a small YAML file that says which topic is what."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....runtime.errors import InputError, unknown_name
from ....runtime.yaml_file import read_yaml
from ..rotor_orders import ORDERS
from ..streams import from_ned
from .ros_messages import COMMAND_UNITS, SPEED_UNITS, Kind

Array = NDArray[np.float64]

_KEYS = {
    "pose": ("topic", "frame"),
    "rotors": ("topic", "unit", "order"),
    "command": ("topic", "unit", "order", "range"),
    "voltage": ("topic",),
    "imu": ("topic", "frame"),
}
_FRAMES = ("flu", "ned")


@dataclass(frozen=True)
class Topic:
    """A topic that holds a part, and how its numbers are read."""

    name: str
    part: str  # pose, rotors, command, voltage or imu
    kind: Kind
    setting: Mapping[str, Any]  # of the topic map
    why: str = ""  # it was chosen, where it was not the only one

    @property
    def order(self) -> list[int]:
        """Elements of the message, from 1, that are the kit's rotors."""
        return list(self.setting.get("order") or ORDERS[self.kind.order])

    @property
    def unit(self) -> str:
        """Of rotor speeds or commands; nothing: not known."""
        return str(self.setting.get("unit", self.kind.unit))

    @property
    def frame(self) -> str:
        """Of a pose or an inertial sensor: flu or ned."""
        return str(self.setting.get("frame", self.kind.frame))

    @property
    def range(self) -> tuple[float, float]:
        """What stands for the commands 0 and 1."""
        usual = self.kind.range if self.unit == "us" else (0.0, 1.0)
        low, high = self.setting.get("range", usual)
        return float(low), float(high)

    def four(self, values: Array) -> Array:
        """Return the values of a message (K,) that belong to the kit's rotors (4,)."""
        return np.asarray(values[np.array(self.order) - 1])

    def in_kit_units(self, values: Array) -> Array:
        """Return the values (N, K) of messages in the kit's units and frames.

        A pose is position and scalar-first quaternion, an IMU's sample accelerometer and gyro. The
        values of rotors are in the kit's order (``four``); a command of NaN is a motor that is off.
        """
        if self.part == "rotors":
            return values * SPEED_UNITS[self.unit]
        if self.part == "command":
            low, high = self.range
            share = (np.nan_to_num(values, nan=low) - low) / (high - low)
            return np.asarray(np.clip(share, 0.0, 1.0))
        if self.part in ("pose", "imu") and self.frame == "ned":
            if self.part == "pose":
                return np.column_stack(from_ned(values[:, :3], values[:, 3:]))
            return np.asarray(values * np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0]))
        return values


def topic_map(path: Path, option: str) -> tuple[dict[str, dict[str, Any]], str]:
    """Return the settings of each part, checked, and the name of the file that they are from.

    Args:
        path: the bag.
        option: path of the map; nothing: ``NAME.topics.yaml`` beside the bag, if it is there.

    Raises:
        InputError: it cannot be read, or says something that is not known.
    """
    stem = path.name if os.path.isdir(path) else path.stem
    file = Path(option) if option else path.with_name(f"{stem}.topics.yaml")
    if not option and not os.path.exists(file):
        return {}, str(file)
    data = read_yaml(file, "a topic map")
    if not isinstance(data, dict):
        raise InputError(
            f"{file}: expected a mapping of {', '.join(_KEYS)} to topics, got {type(data).__name__}"
        )
    settings = {}
    for part, value in data.items():
        if part not in _KEYS:
            raise unknown_name("key", str(part), _KEYS, str(file))
        settings[part] = _checked(value, part, str(file))
    return settings, str(file)


def _checked(value: object, part: str, where: str) -> dict[str, Any]:
    setting = {"topic": value} if isinstance(value, str) else value
    if not isinstance(setting, dict):
        raise InputError(
            f"{where}: {part}: expected a topic or a mapping of {', '.join(_KEYS[part])}, got "
            f"{value!r}"
        )
    for key in setting:
        if key not in _KEYS[part]:
            raise unknown_name("key", str(key), _KEYS[part], f"{where}: {part}")
    if not isinstance(setting.get("topic", ""), str):
        raise InputError(
            f"{where}: {part}: topic: expected a name such as /motors, got {setting['topic']!r}"
        )
    units = tuple(SPEED_UNITS) if part == "rotors" else COMMAND_UNITS
    for key, known in (("frame", _FRAMES), ("unit", units)):
        if key in setting and (not isinstance(setting[key], str) or setting[key] not in known):
            raise unknown_name(key, str(setting[key]), known, f"{where}: {part}")
    if "order" in setting:
        setting = setting | {"order": _order(setting["order"], f"{where}: {part}")}
    if "range" in setting:
        _check_range(setting["range"], f"{where}: {part}")
    return setting


def _order(order: object, where: str) -> list[int]:
    """Return an order as four elements, from 1, of the message."""
    if isinstance(order, str):
        if order not in ORDERS:
            raise unknown_name("order", order, ORDERS, where)
        return list(ORDERS[order])
    good = (
        isinstance(order, list)
        and all(type(i) is int and i >= 1 for i in order)
        and len(set(order)) == 4 == len(order)
    )
    if not good:
        raise InputError(
            f"{where}: order: expected four different elements, counted from 1, such "
            f"as "
            f"[1, 2, 3, 4], or one of {', '.join(ORDERS)}, got {order!r}"
        )
    assert isinstance(order, list)
    return order


def _check_range(value: object, where: str) -> None:
    good = (
        isinstance(value, list)
        and len(value) == 2
        and all(type(x) in (int, float) for x in value)
        and 0.0 <= value[0] < value[1] <= 1e5
    )
    if not good:
        raise InputError(
            f"{where}: range: expected the values of the commands 0 and 1, such as [1000, 2000], "
            f"got {value!r}"
        )
