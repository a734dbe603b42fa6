"""The topic map of a bag or of a live source: a small YAML file that says which topic holds which
part, by the rules that ``rosbag`` states where it says nothing; and the sections of a log map that
follow from it.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict

from ....runtime.errors import InputError, unknown_name
from ....runtime.forms import STRICT, Number, checked, expected
from ....runtime.yaml_file import read_yaml
from ..log_map import (
    COMMAND_UNITS,
    Attitude,
    Battery,
    Columns,
    Commands,
    LogMap,
    Position,
    Rotors,
    Sensor,
    TimeColumn,
    one_of,
)
from ..rotor_orders import ORDERS, order_names, rotor_order
from ..table import Array
from .ros_messages import MOTORS, PARTS, Kind, kinds, stated

UNITS = {"rotors": ("rad/s", "rpm", "Hz"), "command": ("normalised", "us")}
KEYS = {  # what may be said of a part
    "pose": ("topic", "frame"),
    "rotors": ("topic", "unit", "order"),
    "command": ("topic", "unit", "order", "range"),
    "voltage": ("topic",),
    "imu": ("topic", "frame"),
}
_FRAMES = {"flu": ("enu", "flu"), "ned": ("ned", "frd")}  # world and body
_LARGEST_COMMAND = 1e5
_SECTIONS: Mapping[str, Mapping[str, Columns]] = {  # of a log map, that a part fills
    "pose": {
        "position": Position(("x", "y", "z"), "m"),
        "attitude": Attitude(("qw", "qx", "qy", "qz")),
    },
    "rotors": {"rotors": Rotors(())},
    "command": {"commands": Commands(())},
    "voltage": {"battery": Battery(("voltage",), "V")},
    "imu": {
        "accelerometer": Sensor(("ax", "ay", "az"), "m/s2"),
        "gyro": Sensor(("gx", "gy", "gz"), "rad/s"),
    },
}


def _elements(value: Any) -> tuple[int, ...]:
    """Return the elements of a message, from 1, that are the kit's rotors."""
    if isinstance(value, str):
        return rotor_order(value)
    is_list = isinstance(value, list | tuple) and all(type(i) is int and i >= 1 for i in value)
    if not is_list or not len(set(value)) == 4 == len(value):
        raise InputError(
            "expected four different elements, counted from 1, such as [1, 2, 3, 4], or "
            f"one of {', '.join(ORDERS)}, got {value!r}"
        )
    return tuple(value)


def _rising(values: tuple[float, float]) -> tuple[float, float]:
    if not 0.0 <= values[0] < values[1] <= _LARGEST_COMMAND:
        raise ValueError("no range")
    return values


@dataclass(frozen=True)
class Setting:
    """What a topic map says of a part; what is left empty is usual of the type of messages."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    topic: Annotated[str, expected("a name such as /motors")] = ""
    frame: Annotated[str, one_of(_FRAMES)] = ""  # ned: world and body z down; flu: ROS's own
    unit: Annotated[str, one_of([*UNITS["rotors"], *UNITS["command"]])] = ""
    order: Annotated[tuple[int, ...], BeforeValidator(_elements)] = ()
    range: Annotated[  # values of the commands 0 and 1
        tuple[Number, Number] | tuple[()],
        AfterValidator(_rising),
        expected("the values of the commands 0 and 1, such as [1000, 2000]"),
    ] = ()


def topic_map(path: Path, option: str) -> tuple[dict[str, Setting], str]:
    """Return what a topic map says of each part, and the name of its file.

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
            f"{file}: expected a mapping of {', '.join(KEYS)} to topics, got {type(data).__name__}"
        )
    settings = {}
    for part, value in data.items():
        if part not in KEYS:
            raise unknown_name("key", str(part), KEYS, str(file))
        where, given = f"{file}: {part}", {"topic": value} if isinstance(value, str) else value
        for key in given if isinstance(given, dict) else ():
            if key not in KEYS[part]:
                raise unknown_name("key", str(key), KEYS[part], where)
        settings[part] = found = checked(Setting, given, where, ", ".join(KEYS[part]))
        if found.unit and found.unit not in UNITS[part]:
            raise unknown_name("unit", found.unit, UNITS[part], where)
    return settings, str(file)


@dataclass(frozen=True)
class Topic:
    """A topic that holds a part, and how its numbers are read."""

    name: str
    part: str  # of ``KEYS``
    kind: Kind  # with what the topic map says
    why: str = ""  # it was chosen, where it was not the only one
    assumed_order: str = ""  # of its motors: usual of its type, and not stated

    @property
    def elements(self) -> tuple[int, ...]:
        """Elements of the message, from 1, that are the kit's rotors."""
        return self.kind.order or (1, 2, 3, 4)

    @cached_property
    def log_map(self) -> LogMap:
        """What the columns of its messages mean."""
        world, body = _FRAMES[self.kind.frame]
        given: dict[str, Any] = {"topic": self.name}
        if self.part == "imu":
            given["body"] = body
        elif self.part in MOTORS:
            picked = sorted(self.elements)
            given["columns"] = tuple(f"{self.part} {element}" for element in picked)
            given["order"] = tuple(picked.index(element) + 1 for element in self.elements)
            given["unit"] = self.kind.unit
        if self.part == "command":
            given["range"] = self.kind.range
        parts: dict[str, Any] = {
            name: replace(part, **given) for name, part in _SECTIONS[self.part].items()
        }
        return LogMap(TimeColumn("stamp", "ns"), world, body, rows="messages", **parts)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of what ``values`` returns."""
        return tuple(name for part in self.log_map.sections.values() for name in part.columns)

    def values(self, message: Any) -> Array:
        """Return the columns of a message (K,); a command of NaN is a motor that is off.

        Raises:
            ValueError: it has too few rotors, or more than four and no order.
        """
        found = self.kind.values(message)
        if self.part not in MOTORS:
            return found
        what = "rotor speed(s)" if self.part == "rotors" else "command(s)"
        if not self.kind.order and len(found) != 4:
            raise ValueError(f"{len(found)} {what}; expected 4, or an order in the topic map")
        if len(found) < max(self.elements):
            raise ValueError(
                f"{len(found)} {what}; expected at least {max(self.elements)} by the order "
                f"{list(self.elements)}"
            )
        found = found[np.array(sorted(self.elements)) - 1]
        is_off = np.isnan(found) & (self.part == "command")
        return np.where(is_off, self.kind.range[0], found)


def topic_of(
    part: str, name: str, kind: str, setting: Setting, where: tuple[str, str], why: str = ""
) -> Topic:
    """Return a topic as the holder of a part.

    Args:
        part: of ``KEYS``.
        name: of the topic.
        kind: the type of its messages.
        setting: what the topic map says of the part.
        where: the bag or source, and the topic map, for errors.
        why: it was chosen.

    Raises:
        InputError: messages of this type hold no such part, or need a unit that is not given.
    """
    source, map_file = where
    fitting = kinds(part)
    if kind not in fitting:
        raise InputError(
            f"{source}: {part}: topic {name} is of type {kind}; expected {' or '.join(fitting)}"
        )
    usual = fitting[kind]
    said = {name: x for name, x in vars(setting).items() if x and name != "topic"}
    found = replace(usual, **said)
    if part in MOTORS and not found.unit:
        raise InputError(
            f"{source}: {part}: topic {name} is a {kind}, which states no unit; expected "
            f"unit: {', '.join(UNITS[part])} in {map_file}"
        )
    if not setting.range:
        found = replace(found, range=COMMAND_UNITS.get(found.unit) or usual.range)
    assumed = "" if setting.order else "".join(order_names(found.order)[:1])
    return Topic(name, part, found, why, assumed)


def joined(topics: Mapping[str, Topic]) -> LogMap:
    """Return the map of several topics, by their parts, in the frames of the pose."""
    parts = {name: way for topic in topics.values() for name, way in topic.log_map.sections.items()}
    first = topics.get("pose") or next(iter(topics.values()))
    return replace(first.log_map, **parts)  # type: ignore[arg-type]


def chosen_topics(
    path: Path, types: Mapping[str, str], settings: Mapping[str, Setting], where: str
) -> tuple[dict[str, Topic], list[str]]:
    """Return the topic of each part, and notes on parts that are not there.

    Args:
        path: the bag, for errors.
        types: of its topics' messages.
        settings: what the topic map says of each part.
        where: the topic map's file, for errors.

    Raises:
        InputError: a part that is needed is missing or ambiguous, or a topic that is named cannot
            hold its part.
    """
    chosen: dict[str, Topic] = {}
    refused: dict[str, InputError] = {}
    for part in PARTS:
        try:
            topic = _topic(path, types, part, settings.get(part, Setting()), where)
        except InputError as error:
            if part in settings:
                raise
            refused[part] = error
        else:
            chosen |= {part: topic} if topic is not None else {}
    if "rotors" not in chosen and "command" not in chosen:
        raise refused.get("rotors") or _missing(path, types, "rotors", where)
    # an ambiguous pose is no reason to go on without one
    if "pose" not in chosen and ("imu" not in chosen or "pose" in refused):
        raise refused.get("pose") or _missing(path, types, "pose", where)
    return chosen, [str(error).removeprefix(f"{path}: ") for error in refused.values()]


def _topic(
    path: Path, types: Mapping[str, str], part: str, setting: Setting, where: str
) -> Topic | None:
    """Return the topic of a part: the one that the topic map names, the only one that may be it, or
    that which its name tells; None: there is none.

    Raises:
        InputError: it is not there, is of a type that cannot be the part, or several may be it.
    """

    def named_by(topic: str, words: str) -> bool:
        return any(word in topic.lower() for word in stated()[words])

    named = setting.topic
    if named and named not in types:
        raise unknown_name("topic", named, types, f"{path}: {part} (named in {where})")
    # an array of numbers may be anything until somebody names its unit
    fitting = [kind for kind in kinds(part) if kind not in stated()["arrays"] or setting.unit]
    several = sorted(topic for topic, kind in types.items() if kind in fitting)
    if part in ("pose", "rotors"):
        flown = [topic for topic in several if not named_by(topic, "setpoint_words")]
        several = flown or (several if part == "rotors" else [])
    found = [named] if named else several
    if part == "pose" and len(found) > 1:
        measured = [topic for topic in several if named_by(topic, "measured_words")]
        found = measured if len(measured) == 1 else several
    elif part == "imu" and len(found) > 1:
        found = [t for t in several if not t.endswith("_raw")] or several
    if len(found) > 1:
        raise InputError(
            f"{path}: {part}: {len(found)} topics could be it ({', '.join(found)}); expected one: "
            f"name it in {where}"
        )
    if not found:
        return None
    others = [] if named else [topic for topic in several if topic not in found]
    why = f", chosen by its name before {', '.join(others)}; a topic map says another"
    places = str(path), where
    return topic_of(part, found[0], types[found[0]], setting, places, why if others else "")


def _missing(path: Path, types: Mapping[str, str], part: str, where: str) -> InputError:
    """Return the error for a bag without rotor speeds and commands, or without a pose and inertial
    sensors.
    """
    topics = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(types.items())) or "none"
    every = [kind for one in (("pose",) if part == "pose" else MOTORS) for kind in kinds(one)]
    arrays = sorted(topic for topic, kind in types.items() if kind in stated()["arrays"])
    known = dict.fromkeys(kind for kind in every if kind not in stated()["arrays"])
    left_out = sorted(topic for topic, kind in types.items() if kind in known)
    found = "no topic of a type that fits"
    found = f"no topic but set-points by their names ({', '.join(left_out)})" if left_out else found
    wanted = f"one of {' or '.join(known)}, or its name in {where}"
    if part == "rotors" and arrays:
        found = f"{', '.join(arrays)} could be it, but a multi-array states no unit"
        wanted = f"in {where} the line rotors: {{topic: {arrays[0]}, unit: rad/s}} (or "
        wanted += f"{', '.join(UNITS['rotors'][1:])}), or command: {{topic: {arrays[0]}, unit: us}}"
        wanted += f" (or {UNITS['command'][0]})"
    return InputError(f"{path}: {part}: {found}; expected {wanted}. The bag's topics: {topics}")
