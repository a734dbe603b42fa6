"""Which topic of a bag holds which part: the one that the topic map names, else what is left by the
rules that ``rosbag`` states.
"""

from collections.abc import Mapping
from pathlib import Path

from ....runtime.errors import InputError, unknown_name
from .ros_messages import ARRAYS, PARTS, kinds
from .topic_map import UNITS, Setting, Topic

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
        setting = settings.get(part, Setting())
        try:
            choice = (
                _named(path, types, part, setting, where)
                if setting.topic
                else _fitting(path, types, part, setting, where)
            )
        except InputError as error:
            if part in settings:
                raise
            refused[part] = error
        else:
            if choice is not None:
                chosen[part] = choice
    if "rotors" not in chosen and "command" not in chosen:
        raise refused.get("rotors") or _no_rotors(path, types, where)
    # an ambiguous pose is no reason to go on without one
    if "pose" not in chosen and ("imu" not in chosen or "pose" in refused):
        raise refused.get("pose") or _no_pose(path, types, where)
    return chosen, [str(error).removeprefix(f"{path}: ") for error in refused.values()]


def _named(path: Path, types: Mapping[str, str], part: str, setting: Setting, where: str) -> Topic:
    """Return the topic of a part that the topic map names.

    Raises:
        InputError: it is not there, or of a type that cannot be the part.
    """
    topic, fitting = setting.topic, kinds(part)
    if topic not in types:
        raise unknown_name("topic", topic, types, f"{path}: {part} (named in {where})")
    kind = types[topic]
    if kind not in fitting:
        raise InputError(
            f"{path}: {part}: topic {topic} is of type {kind}; expected {' or '.join(fitting)}"
        )
    found = Topic(topic, part, fitting[kind], setting)
    if part in UNITS and not found.unit:
        raise InputError(
            f"{path}: {part}: topic {topic} is a {kind}, which states no unit; expected "
            f"unit: {', '.join(UNITS[part])} in {where}"
        )
    return found


def _fitting(
    path: Path, types: Mapping[str, str], part: str, setting: Setting, where: str
) -> Topic | None:
    """Return the only topic that may be a part, or that which its name tells; None: there is none.

    Raises:
        InputError: several may be it.
    """
    # an array of numbers may be anything until somebody names its unit
    fitting = [kind for kind in kinds(part) if kind not in ARRAYS or setting.unit]
    several = sorted(topic for topic, kind in types.items() if kind in fitting)
    if part in ("pose", "rotors"):
        flown = [t for t in several if not any(word in t.lower() for word in _SETPOINTS)]
        several = flown or (several if part == "rotors" else [])
    found = several
    if part == "pose" and len(several) > 1:
        measured = [t for t in several if any(word in t.lower() for word in _MOCAP)]
        found = measured if len(measured) == 1 else several
    elif part == "imu" and len(several) > 1:
        found = [t for t in several if not t.endswith("_raw")] or several
    if len(found) > 1:
        raise InputError(
            f"{path}: {part}: {len(found)} topics could be it ({', '.join(found)}); expected one: "
            f"name it in {where}"
        )
    if not found:
        return None
    others = ", ".join(topic for topic in several if topic not in found)
    why = f", chosen by its name before {others}; a topic map says another" if others else ""
    return Topic(found[0], part, kinds(part)[types[found[0]]], setting, why)


def _listed(types: Mapping[str, str]) -> str:
    topics = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(types.items())) or "none"
    return f"The bag's topics: {topics}"


def _no_rotors(path: Path, types: Mapping[str, str], where: str) -> InputError:
    """Return the error for a bag without rotor speeds and commands."""
    arrays = sorted(topic for topic, kind in types.items() if kind in ARRAYS)
    if arrays:
        return InputError(
            f"{path}: rotors: {', '.join(arrays)} could be it, but a multi-array states no "
            f"unit; expected in {where} the line rotors: {{topic: {arrays[0]}, unit: rad/s}} (or "
            f"{', '.join(UNITS['rotors'][1:])}), or command: {{topic: {arrays[0]}, unit: us}} "
            f"(or {UNITS['command'][0]}). {_listed(types)}"
        )
    known = [kind for part in UNITS for kind in kinds(part) if kind not in ARRAYS]
    return InputError(
        f"{path}: rotors: no topic of a type that fits; expected one of "
        f"{' or '.join(dict.fromkeys(known))} or a multi-array of std_msgs with a unit, or its "
        f"name in {where}. {_listed(types)}"
    )


def _no_pose(path: Path, types: Mapping[str, str], where: str) -> InputError:
    """Return the error for a bag without a pose and inertial sensors."""
    left_out = sorted(topic for topic, kind in types.items() if kind in kinds("pose"))
    why = "no topic of a type that fits"
    if left_out:
        why = f"no topic but set-points by their names ({', '.join(left_out)})"
    return InputError(
        f"{path}: pose: {why}; expected one of {' or '.join(kinds('pose'))}, or its name in "
        f"{where}. {_listed(types)}"
    )
