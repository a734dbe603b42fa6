"""Which topic of a bag holds which part: the one that the topic map names, else what is left by the
rules that ``rosbag`` states.
"""

from collections.abc import Mapping
from pathlib import Path

from ....runtime.errors import InputError, unknown_name
from .ros_messages import ARRAYS, MOTORS, PARTS, kinds
from .topic_map import UNITS, Setting, Topic, topic_of

_SETPOINTS = ("setpoint", "set_point", "reference", "command", "cmd", "desired", "target", "goal")
_MOCAP = (
    *("vicon", "vrpn", "mocap", "motion_capture", "optitrack", "qualisys", "natnet"),
    *("vision_pose", "ground_truth", "groundtruth"),
)


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
    named = setting.topic
    if named and named not in types:
        raise unknown_name("topic", named, types, f"{path}: {part} (named in {where})")
    # an array of numbers may be anything until somebody names its unit
    fitting = [kind for kind in kinds(part) if kind not in ARRAYS or setting.unit]
    several = sorted(topic for topic, kind in types.items() if kind in fitting)
    if part in ("pose", "rotors"):
        flown = [t for t in several if not any(word in t.lower() for word in _SETPOINTS)]
        several = flown or (several if part == "rotors" else [])
    found = [named] if named else several
    if part == "pose" and len(found) > 1:
        measured = [t for t in several if any(word in t.lower() for word in _MOCAP)]
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
    arrays = sorted(topic for topic, kind in types.items() if kind in ARRAYS)
    if part == "rotors" and arrays:
        return InputError(
            f"{path}: rotors: {', '.join(arrays)} could be it, but a multi-array states no "
            f"unit; expected in {where} the line rotors: {{topic: {arrays[0]}, unit: rad/s}} (or "
            f"{', '.join(UNITS['rotors'][1:])}), or command: {{topic: {arrays[0]}, unit: us}} "
            f"(or {UNITS['command'][0]}). The bag's topics: {topics}"
        )
    parts = ("pose",) if part == "pose" else MOTORS
    known = dict.fromkeys(kind for one in parts for kind in kinds(one) if kind not in ARRAYS)
    left_out = sorted(topic for topic, kind in types.items() if kind in known)
    names = f"but set-points by their names ({', '.join(left_out)})"
    more = "" if part == "pose" else " or a multi-array of std_msgs with a unit"
    return InputError(
        f"{path}: {part}: no topic {names if left_out else 'of a type that fits'}; expected one of "
        f"{' or '.join(known)}{more}, or its name in {where}. The bag's topics: {topics}"
    )
