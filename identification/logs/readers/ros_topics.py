"""Topics of a bag for the sections of a log map, by the rules of ``rosbag``; and their messages as
columns: numbers by the paths of their fields, such as ``pose.position.x``, ``data[0]`` or
``esc[0].esc_rpm``.
"""

import re
from array import array
from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from itertools import islice
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np

from ....runtime.errors import InputError, unknown_name
from ....runtime.file_limits import LIMITS, check_count
from ..log_map import LogMap, parse_map, stated
from ..mapped_log import MOTOR_NAMES
from ..table import Array, Data, Lines, NamedArrays, NamedTexts, Noted, Wanted
from .px4_ulog import unified

Types = Mapping[str, str]  # of messages, by topic
Stated = Mapping[str, Any]  # of a map's section, or of a map
SECTIONS = ("position", "attitude", "rotors", "commands", "battery", "accelerometer", "gyro")
# sections in the messages of another, without a topic of their own
BESIDE = {"attitude": "position", "gyro": "accelerometer"}
MOTORS = ("rotors", "commands")
_LATEST = 2**63  # ns
_PX4 = "px4_msgs/msg/"


def map_of(types: Types, given: Stated, source: str, where: str) -> Noted[LogMap]:
    """Return the log map of topics, and notes.

    Args:
        types: types of the topics' messages, by topic.
        given: content of a map file; a section's topic and columns may be left out.
        source: the bag, for errors.
        where: the map file, for errors.

    Raises:
        InputError: the map has an unknown field; a needed section is missing or ambiguous; or a
            topic cannot hold its section.
    """
    sections: Data = {}
    refused: NamedTexts = {}
    notes: Lines = []
    for section in SECTIONS:
        said = given.get(section) or {}
        said = {"topic": said} if isinstance(said, str) else said
        if not isinstance(said, Mapping):  # parse_map takes alternatives as they stand
            sections[section] = said
            continue
        beside = _topic_of(sections.get(BESIDE.get(section, "")))
        topic, why = _topic_of(said) or beside, ""
        try:
            if not topic and (said or section not in BESIDE):
                topic, why = _chosen(types, section, said, where)
            if not topic:
                continue
            usual = _usual(types, section, said, topic, where)
        except InputError as error:
            refused[section] = f"{section}: {error}"
            if section in given:
                raise InputError(f"{source}: {refused[section]}") from error
            continue
        own = {key: given[key] for key in {"body"} & usual.keys() & given.keys()}
        sections[section] = {**usual, **own, **said, "topic": topic}
        if topic != beside:
            notes.append(f"{section}: topic {topic} ({types[topic]}){why}")
        if "order" in usual and not {"order", "columns"} & {*said}:
            notes.append(f"{section}: motors as on {usual['order']}, which the bag does not state")
    # an ambiguous pose is no reason to go on without one
    is_posed = "position" in sections or ("gyro" in sections and "position" not in refused)
    is_driven = {*MOTORS, "wrench"} & {*sections, *given}
    if not (is_posed and is_driven):
        section = "position" if is_driven else "rotors"
        why = refused.get(section) or f"{section}: {_missing(types, section, where)}"
        raise InputError(f"{source}: {why}")
    is_ned = types.get(_topic_of(sections.get("position"))) in stated("ros")["ned"]
    used = {_topic_of(section) for section in sections.values()}
    motors = {kind for name in MOTORS for kind in stated("ros")[name]}
    named = {
        topic for topic in _of_types(types, stated("ros")["arrays"]) if MOTOR_NAMES.search(topic)
    }
    if left := sorted({*_of_types(types, motors), *named} - used):
        notes.append(f"topics that may hold motors were left out: {', '.join(left)}")
    clock: Data = {"time": {"column": "stamp", "unit": "ns"}}
    clock |= {"world": "ned", "body": "frd"} if is_ned else {}
    log_map = parse_map({**clock, **given, **sections}, where)
    sensed = {part.body for part in (log_map.accelerometer, log_map.gyro) if part is not None}
    frames = [f"world {log_map.world}, body {log_map.body}", *sorted(sensed - {"", log_map.body})]
    notes.append(f"frames: {', inertial sensors '.join(frames)}")
    return log_map, [*notes, *refused.values()]


def _topic_of(section: object) -> str:
    """Return a section's topic; empty: none."""
    return str(section.get("topic") or "") if isinstance(section, Mapping) else ""


def _of_types(types: Types, wanted: Wanted) -> Lines:
    """Return the topics of some types of messages."""
    return sorted(topic for topic, kind in types.items() if kind in wanted)


def _usual(types: Types, section: str, said: Stated, topic: str, where: str) -> Data:
    """Return a section of a topic's messages by their type alone.

    Raises:
        InputError: the topic is not there, cannot hold the section, or has no unit.
    """
    if topic not in types:
        raise unknown_name("topic", topic, types, f"named in {where}")
    kind, known = types[topic], stated("ros")[section]
    array = stated("ros")["arrays"].get(kind) if section in MOTORS else None
    if array and "unit" not in said:
        units = "rad/s, rpm, Hz" if section == "rotors" else "normalised, us"
        raise InputError(
            f"topic {topic} is a {kind}, which states no unit; expected unit: {units} in {where}"
        )
    if array:
        return {"columns": [f"{array}[{i}]" for i in range(4)]}
    if kind not in known and not {"columns", "column"} & {*said}:
        raise InputError(
            f"topic {topic} is of type {kind}; expected {' or '.join(known)}, or in {where} its "
            "fields as columns"
        )
    return dict(known.get(kind, {}))


def _chosen(types: Types, section: str, said: Stated, where: str) -> tuple[str, str]:
    """Return the topic of a section, the only possible one or the one by name, and a note on the
    choice; empty: there is none.

    Raises:
        InputError: several topics are possible.
    """

    def named_by(words: str) -> Lines:
        return [x for x in several if any(word in x.lower() for word in stated("ros")[words])]

    fitting = {*stated("ros")[section], *(stated("ros")["arrays"] if "unit" in said else ())}
    several = _of_types(types, fitting)
    if section in ("position", "rotors"):
        flown = sorted({*several} - {*named_by("setpoint_words")})
        several = flown or (several if section == "rotors" else [])
    usable = several
    if section == "position" and len(measured := named_by("measured_words")) == 1:
        usable = measured
    elif section in ("accelerometer", "gyro"):
        usable = [topic for topic in several if not topic.endswith("_raw")] or several
    if len(usable) > 1:
        raise InputError(
            f"{len(usable)} topics could be it ({', '.join(usable)}); expected one: name it in "
            f"{where}, such as {section}: {{topic: {usable[0]}}}"
        )
    others = [topic for topic in several if topic not in usable]
    why = f", chosen by its name before {', '.join(others)}; a map says another" if others else ""
    return "".join(usable), why


def _missing(types: Types, section: str, where: str) -> str:
    """Return words on topics without rotor speeds and commands, or without a pose and inertial
    sensors.
    """
    topics = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(types.items())) or "none"
    names = MOTORS if section == "rotors" else (section,)
    known = dict.fromkeys(kind for name in names for kind in stated("ros")[name])
    arrays, left_out = (_of_types(types, kinds) for kinds in (stated("ros")["arrays"], known))
    seen = "no topic of a type that fits"
    if left_out:
        seen = f"no topic but set-points by their names ({', '.join(left_out)})"
    wanted = f"one of {' or '.join(known)}, or its topic and columns in {where}"
    if section == "rotors" and arrays:
        seen = f"{', '.join(arrays)} could be it, but a multi-array states no unit"
        wanted = (
            f"in {where} the line rotors: {{topic: {arrays[0]}, unit: rad/s}} (or rpm, Hz), or "
            f"commands: {{topic: {arrays[0]}, unit: us}} (or normalised)"
        )
    return f"{seen}; expected {wanted}. The topics: {topics}"


def definitions() -> list[NamedTexts]:
    """Return definitions for rosbags' unknown types, in several variants: the newest of each comes
    first.
    """
    known = stated("ros")["definitions"]
    return [
        {name: texts[min(variant, len(texts) - 1)] for name, texts in known.items()}
        for variant in range(max(map(len, known.values())))
    ]


def stamp(message: Any) -> int:
    """Return the time of a message's sample, in ns of its sender's clock; 0: unknown."""
    header = getattr(message, "header", None)
    if header is not None:
        return min(int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec), _LATEST - 1)
    sampled = int(getattr(message, "timestamp_sample", 0) or getattr(message, "timestamp", 0))
    return 1000 * sampled if sampled < _LATEST // 1000 else 0


_Getter = Callable[[Any], Any]  # of a number from a message


class MessageFields:
    """The numbers of a map in a topic's messages; whole arrays. A field that a message lacks, such
    as a number of a shorter array, is NaN there.

    Args:
        where: the topic, for errors.
        kind: the type of its messages.
        wanted: columns of the map.
    """

    def __init__(self, where: str, kind: str, wanted: Wanted) -> None:
        self.where, self._kind, self._wanted = where, kind, dict.fromkeys(wanted)
        self._is_px4 = kind.startswith(_PX4)
        self._getters: dict[str, _Getter] = {}
        self._numbers, self._count = array("d"), 0

    def take(self, message: Any) -> None:
        """Add the numbers of a message.

        Raises:
            InputError: the message has more than ``FileLimits.log_fields``.
        """
        known = self._getters
        if not known or not (self._is_px4 or known.keys() >= {*self._wanted}):
            before = self._rows()
            paths = list(islice(_paths(message), LIMITS.log_fields + 1))
            check_count(self.where, len(paths), LIMITS.log_fields, "fields of a message")
            arrays = set(map(array_of, paths if self._is_px4 else self._wanted))
            if new := [x for x in paths if x not in known and array_of(x) in arrays]:
                known |= {path: _getter(path) for path in new}
                rows = np.pad(before, ((0, 0), (0, len(new))), constant_values=np.nan)
                self._numbers = array("d", rows.tobytes())
        for get in known.values():
            try:
                self._numbers.append(get(message))
            except IndexError:
                self._numbers.append(np.nan)
        self._count += 1

    def _rows(self) -> Array:
        return np.array(self._numbers).reshape(self._count, len(self._getters))

    def columns(self) -> NamedArrays:
        """Return the columns (N,) of the messages, by name."""
        columns_by_name = dict(zip(self._getters, self._rows().T, strict=True))
        if not self._is_px4:
            return columns_by_name
        name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", self._kind.removeprefix(_PX4)).lower()
        return unified(name, columns_by_name)

    def lack(self, columns: Wanted) -> InputError:
        """Return the error for columns without some of the wanted ones."""
        missing = ", ".join(name for name in self._wanted if name not in columns)
        return InputError(
            f"{self.where}: no field {missing} in its {self._kind}; found "
            f"{', '.join(islice(columns, 30)) or 'no number'}"
        )


def array_of(path: str) -> str:
    """Return a field's path without the numbers of its elements: the same for all elements."""
    return re.sub(r"\[\d+\]", "[]", path)


def _paths(value: Any, path: str = "") -> Iterator[str]:
    """Yield the paths of the numbers in a message."""
    if isinstance(value, str | bytes):
        return
    if isinstance(value, int | float | np.generic):
        yield path
    elif hasattr(value, "__len__"):
        for i, item in enumerate(value):
            yield from _paths(item, f"{path}[{i}]")
    else:  # a message
        for name in value.__dataclass_fields__:
            yield from _paths(getattr(value, name), f"{path}.{name}" if path else name)


def _getter(path: str) -> _Getter:
    """Return a function that returns a field of a message."""
    if "[" not in path:
        return attrgetter(path)
    names = re.findall(r"[^.\[\]]+", path)
    steps = [itemgetter(int(x)) if x.isdecimal() else attrgetter(x) for x in names]
    return lambda message: reduce(lambda value, get: get(value), steps, message)
