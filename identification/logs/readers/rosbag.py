"""ROS 1 and ROS 2 bags (``.bag``, ``.db3``, ``.mcap`` or a ROS 2 bag's folder), read with rosbags; no ROS is needed.

Which topic is what, a small YAML file may say: ``NAME.topics.yaml`` beside the bag ``NAME.bag`` (or folder ``NAME``), or the
file given as the reader's option, ``rosbag:FILE.yaml``::

    pose: {topic: /vicon/drone, frame: flu}        # or ned; default flu
    rotors: {topic: /motors, unit: rad/s, order: px4-x}
    command: {topic: /pwm, unit: us, order: [3, 2, 4, 1], range: [1000, 2000]}
    voltage: {topic: /battery}
    imu: {topic: /imu, frame: flu}                 # or ned, for body axes forward, right, down

``/topic`` alone stands for ``{topic: /topic}``. Of what the file does not name:

1. topics whose names say that they are set-points (setpoint, reference, command ...) are not taken for a pose or for rotor speeds;
2. the bag's only topic of a type that fits is taken;
3. of several poses, the one that motion capture or a ground truth names itself (vicon, vrpn, mocap, optitrack ...) is taken, and
   of several inertial sensors or others that which no other name extends by ``_raw``; a note says so;
4. where that leaves several, the bag is refused and they are listed.

* ``pose``: geometry_msgs/PoseStamped, geometry_msgs/TransformStamped (body in world),
  nav_msgs/Odometry or px4_msgs/VehicleOdometry. ``frame: flu`` is ROS's own: world z up, body
  forward, left, up. ``ned``: world z down, body forward, right, down, which is VehicleOdometry's.
  Without a pose, an inertial sensor must be there
* ``rotors``: mav_msgs/Actuators (``angular_velocities``), actuator_msgs/Actuators (``velocity``),
  px4_msgs/EscStatus, mavros_msgs/ESCStatus (rpm), or a std_msgs multi-array, the last only with a
  ``unit``: ``rad/s``, ``rpm`` or ``rev/s``. ``order``: by name (``px4-x``, ``betaflight`` ...), or
  which elements, from 1, are rotors 1 front-left, 2 rear-left, 3 rear-right, 4 front-right; default
  [1, 2, 3, 4], of PX4's and MAVROS's types ``px4-x``
* ``command``: px4_msgs/ActuatorMotors (0 to 1, NaN: off), mavros_msgs/RCOut (us),
  actuator_msgs/Actuators (``normalized``), or a multi-array with a ``unit``: ``normalized`` or
  ``us``. ``range``: values of the commands 0 and 1, of pulses 1000 and 2000 us unless it is given
* ``voltage``: sensor_msgs/BatteryState
* ``imu``: sensor_msgs/Imu, without its attitude: specific force (m/s2) and angular velocity
  (rad/s), as ROS's REP 145 has them; or px4_msgs/SensorCombined (forward, right, down)

A sample's time is its header's (of PX4's types its ``timestamp_sample`` or ``timestamp``), where that runs within a second of the
bag's clock, else the time it was recorded.
Messages are decoded by rosbags' own definitions and those in ``ros_messages``, never by those in the bag,
so that nothing in a file decides what code runs; a bag whose definitions differ is refused.
"""  # noqa: E501

import os
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError, unknown_name
from ....runtime.file_limits import LIMITS
from ....runtime.regular_files import check_regular, open_regular
from ..flight_log import FlightLog
from ..streams import Stream, flight_log
from .ros_messages import (
    ARRAYS,
    COMMAND_UNITS,
    PARTS,
    SPEED_UNITS,
    VARIANTS,
    definitions,
    stamp,
)
from .topic_map import Topic, topic_map
from .unpacking import check_bag_files, limited_unpacking, refuse_packed_files

Array = NDArray[np.float64]

SUFFIXES = (".bag", ".db3", ".mcap")
_ROS1 = b"#ROSBAG V2.0"
BEGINS = (_ROS1, b"\x89MCAP0\r\n", b"SQLite format 3\0")

_SAME_CLOCK = 1.0  # s between a header's time and the recording's
_SETPOINTS = ("setpoint", "set_point", "reference", "command", "cmd", "desired", "target", "goal")
_MOCAP = (
    "vicon",
    "vrpn",
    "mocap",
    "motion_capture",
    "optitrack",
    "qualisys",
    "natnet",
    "vision_pose",
    "ground_truth",
    "groundtruth",
)


@dataclass(frozen=True)
class _Bag:
    """An open bag: its topics and how to read the messages of one."""

    path: Path
    types: Mapping[str, str]  # topic to message type
    messages: Callable[[str], Iterator[tuple[int, Any]]]  # topic to (recorded at ns, message)


def read(path: Path, vehicle: Vehicle | None = None, option: str = "") -> FlightLog:
    """Read a bag; ``option`` is the path of a topic map, the default ``NAME.topics.yaml`` beside
    the bag if it is there.

    Raises:
        InputError: rosbags is missing, the bag or the map cannot be read, a topic is missing,
            ambiguous or of another type, or a message cannot be used.
    """
    settings, where = topic_map(path, option)
    with _opened(path) as bag:
        chosen, doubts = _choices(bag, settings, where)
        streams = {}
        for part, choice in chosen.items():
            try:
                streams[part] = _stream(bag, part, choice)
            except InputError as error:
                if part in settings or part in ("pose", "rotors"):
                    raise
                doubts.append(f"no {part}: {error}")  # nobody asked for it
    notes = [
        *(
            f"{part}: topic {chosen[part].name} ({bag.types[chosen[part].name]})" + chosen[part].why
            for part in streams
        ),
        *(_part_note(part, chosen[part]) for part in streams if part != "voltage"),
        *doubts,
        *(note for _, _, stamp_notes in streams.values() for note in stamp_notes),
    ]
    if not streams:
        raise InputError(f"{path}: {doubts[0] if doubts else 'nothing in it can be read'}")
    origin = min(int(nanoseconds[0]) for nanoseconds, _, _ in streams.values())
    made = {
        part: Stream(chosen[part].name, 1e-9 * (nanoseconds - origin).astype(np.float64), values)
        for part, (nanoseconds, values, _) in streams.items()
    }
    return flight_log(
        path,
        "rosbag",
        made.get("pose"),
        made.get("rotors"),
        made.get("voltage"),
        tuple(notes),
        *_inertial(made.get("imu")),
        command=made.get("command"),
        vehicle=vehicle,
    )


def _part_note(part: str, choice: Topic) -> str:
    """Return what was assumed of a part's frame or order."""
    if part in ("rotors", "command"):
        states = "" if "order" in choice.setting else _order_source(choice)
        pulses = ""
        if part == "command" and choice.unit == "us":
            low, high = choice.range
            pulses = f"; pulses of {low:g} to {high:g} us are the commands 0 to 1"
        return (
            f"{part}: rotors 1, 2, 3, 4 are elements {', '.join(map(str, choice.order))} of the "
            f"message{states}{pulses}"
        )
    if choice.frame == "flu":
        return (
            f"{part}: {'world z up, ' if part == 'pose' else ''}body forward, left, up, as the bag "
            "has it"
        )
    return f"{part}: turned half a turn about x, from z down to z up"


def _order_source(choice: Topic) -> str:
    named = choice.kind.order
    return "" if named == "windwrench" else f", as on {named}, which the bag does not state"


def _inertial(imu: Stream | None) -> tuple[Stream | None, Stream | None]:
    """Return accelerometer and gyro of an IMU's stream."""
    if imu is None:
        return None, None
    force, turn = imu.values[:, :3], imu.values[:, 3:]
    return Stream(imu.name, imu.t, force), Stream(imu.name, imu.t, turn)


@contextmanager
def _opened(path: Path) -> Iterator[_Bag]:
    """Open a bag of either kind.

    Raises:
        InputError: rosbags is missing or the bag cannot be read.
    """
    folder = os.path.isdir(path)
    if not folder:
        with open_regular(path, "a ROS bag") as file:
            begins = file.read(len(_ROS1))
        ros1 = begins == _ROS1 or path.suffix.lower() == ".bag"
    else:
        ros1 = False
    if not (folder or ros1 or path.name.lower().endswith(SUFFIXES)):
        raise InputError(
            f"{path}: unknown kind of bag; expected {', '.join(SUFFIXES)} or the folder of a ROS 2 "
            f"bag"
        )
    try:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise InputError(
            f"{path}: a bag needs rosbags, which is not installed: pip install 'windwrench[logs]', "
            f"or pip "
            "install rosbags"
        ) from error
    stores = []
    for variant in range(VARIANTS):
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        for name, text in definitions(variant).items():
            store.register(get_types_from_msg(text, name))
        stores.append(store)
    if ros1:
        check_regular(path, "a ROS 1 bag")
    else:
        check_bag_files(path)
        refuse_packed_files(path)
    limits = ExitStack()
    reader: Any = None
    try:
        limits.enter_context(limited_unpacking())
        reader = rosbag1.Reader(path) if ros1 else rosbag2.Reader(path)
        reader.open()
        types = {connection.topic: connection.msgtype for connection in reader.connections}
    except Exception as error:  # whatever a parser makes of bytes that are no bag
        limits.close()
        raise InputError(
            f"{path}: cannot be read as a ROS {1 if ros1 else 2} bag: "
            f"{error or type(error).__name__}; "
            "expected a whole bag"
        ) from error

    def messages(topic: str) -> Iterator[tuple[int, Any]]:
        try:
            wanted = [connection for connection in reader.connections if connection.topic == topic]
            kind = types[topic]
            fitting = [store for store in stores if all(_same(c, store, ros1) for c in wanted)]
            if not fitting:
                raise InputError(
                    f"{path}: topic {topic}: its {kind} has another definition "
                    f"than the one "
                    f"this reader knows (digest {wanted[0].digest}); expected the common one"
                )
            for _, recorded, raw in reader.messages(wanted):
                if not 0 <= int(recorded) < 2**63:
                    raise ValueError(f"recorded at {recorded} ns")
                yield int(recorded), _decoded(raw, kind, fitting, ros1)
        except InputError:
            raise
        except Exception as error:  # as above
            raise InputError(
                f"{path}: topic {topic}: a message cannot be read: "
                f"{error or type(error).__name__}; expected "
                f"{types[topic]}"
            ) from error

    try:
        yield _Bag(path, types, messages)
    finally:
        reader.close()
        limits.close()


def _same(connection: Any, store: Any, ros1: bool) -> bool:
    """Return whether a topic was recorded with the definition of its type that will decode it, as
    far as the bag says.
    """
    digest = connection.digest or ""
    if ros1:
        return bool(digest == store.generate_msgdef(connection.msgtype)[1])
    # a type hash stands in newer ROS 2 bags only
    return not digest.startswith("RIHS01") or bool(digest == store.hash_rihs01(connection.msgtype))


def _decoded(raw: Any, kind: str, stores: list[Any], ros1: bool) -> Any:
    """Return a message, decoded by the first of the definitions that it fits; the others are
    dropped.
    """
    while True:
        try:
            return (
                stores[0].deserialize_ros1(raw, kind)
                if ros1
                else stores[0].deserialize_cdr(raw, kind)
            )
        except Exception:
            if len(stores) == 1:
                raise
            del stores[0]


def _choices(
    bag: _Bag, settings: Mapping[str, Mapping[str, Any]], where: str
) -> tuple[dict[str, Topic], list[str]]:
    """Return the topic of each part, and notes on parts that are not there.

    Raises:
        InputError: a part that is needed is missing or ambiguous.
    """
    chosen: dict[str, Topic] = {}
    refused: dict[str, InputError] = {}
    for part in PARTS:
        try:
            if (choice := _choose(bag, part, settings.get(part, {}), where)) is not None:
                chosen[part] = choice
        except InputError as error:
            if part in settings:
                raise
            refused[part] = error
    if "rotors" not in chosen and "command" not in chosen:
        raise refused.get("rotors") or _nothing(bag, "rotors", where)
    # an ambiguous pose is no reason to go on without one
    if "pose" not in chosen and ("imu" not in chosen or "pose" in refused):
        raise refused.get("pose") or _nothing(bag, "pose", where)
    doubts = [
        str(error).removeprefix(f"{bag.path}: ")
        for part, error in refused.items()
        if not (part == "rotors" and _unnamed_arrays(bag))
    ]
    return chosen, doubts


def _choose(bag: _Bag, part: str, setting: Mapping[str, Any], where: str) -> Topic | None:
    """Return the topic of a part: the one named, or the one that the rules above leave; None: the
    bag has none.

    Raises:
        InputError: several could be it, or the one named cannot.
    """
    kinds = PARTS[part]
    if "topic" in setting:
        topic = str(setting["topic"])
        if topic not in bag.types:
            raise unknown_name("topic", topic, bag.types, f"{bag.path}: {part} (named in {where})")
        kind = bag.types[topic]
        if kind not in kinds:
            raise InputError(
                f"{bag.path}: {part}: topic {topic} is of type {kind}; expected "
                f"{' or '.join(kinds)}"
            )
        if kind in ARRAYS and "unit" not in setting:
            raise InputError(
                f"{bag.path}: {part}: topic {topic} is a {kind}, which states no unit; expected "
                f"unit: {', '.join(_units(part))} in {where}"
            )
        return Topic(topic, part, kinds[kind], setting)
    # an array of numbers may be anything until somebody names its unit
    fitting = [kind for kind in kinds if kind not in ARRAYS or "unit" in setting]
    found = sorted(topic for topic, kind in bag.types.items() if kind in fitting)
    if part in ("pose", "rotors"):
        found = _without(found, _SETPOINTS, keep_last=part == "rotors")
    several = found
    if part == "pose" and len(found) > 1:
        named = [t for t in found if any(word in t.lower() for word in _MOCAP)]
        found = named if len(named) == 1 else found
    if part == "imu" and len(found) > 1:
        found = [t for t in found if not t.endswith("_raw")] or found
    if len(found) == 1:
        why = ""
        if len(several) > 1:
            others = ", ".join(topic for topic in several if topic not in found)
            why = f", chosen by its name before {others}; a topic map says another"
        return Topic(found[0], part, kinds[bag.types[found[0]]], setting, why)
    if not found:
        return None
    raise InputError(
        f"{bag.path}: {part}: {len(found)} topics could be it ({', '.join(found)}); expected one: "
        f"name it in {where}"
    )


def _without(found: list[str], words: tuple[str, ...], keep_last: bool) -> list[str]:
    """Return topics whose names have none of some words; where ``keep_last`` and that leaves none,
    all of them.
    """
    left = [topic for topic in found if not any(word in topic.lower() for word in words)]
    return left or (found if keep_last else [])


def _units(part: str) -> tuple[str, ...]:
    return tuple(SPEED_UNITS) if part == "rotors" else COMMAND_UNITS


def _unnamed_arrays(bag: _Bag) -> list[str]:
    return sorted(topic for topic, kind in bag.types.items() if kind in ARRAYS)


def _nothing(bag: _Bag, part: str, where: str) -> InputError:
    """Return the error for a part that is not there."""
    listed = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(bag.types.items())) or "none"
    arrays = _unnamed_arrays(bag)
    if part == "rotors" and arrays:
        return InputError(
            f"{bag.path}: rotors: {', '.join(arrays)} could be it, but a multi-array states no "
            f"unit; expected in {where} the line rotors: {{topic: {arrays[0]}, unit: rad/s}} (or "
            f"{', '.join(list(SPEED_UNITS)[1:])}), or command: {{topic: {arrays[0]}, unit: us}} "
            f"(or {COMMAND_UNITS[0]}). The bag's topics: {listed}"
        )
    kinds = [kind for kind in PARTS[part] if kind not in ARRAYS]
    if part == "rotors":
        kinds += [kind for kind in PARTS["command"] if kind not in (*ARRAYS, *kinds)]
        kinds.append("a multi-array of std_msgs with a unit")
    left_out = sorted(t for t, kind in bag.types.items() if kind in PARTS[part])
    why = (
        f"no topic but set-points by their names ({', '.join(left_out)})"
        if part == "pose" and left_out
        else "no topic of a type that fits"
    )
    return InputError(
        f"{bag.path}: {part}: {why}; expected one of {' or '.join(kinds)}, or its name in "
        f"{where}. "
        f"The bag's topics: {listed}"
    )


def _stream(bag: _Bag, part: str, choice: Topic) -> tuple[NDArray[np.int64], Array, list[str]]:
    """Return times (N,) in ns, values (N, K) in the kit's frames, order and units, and notes of a
    topic.
    """
    topic = choice.name
    recorded, stamped, values = array("q"), array("q"), array("d")
    for index, (received, message) in enumerate(bag.messages(topic)):
        if index >= LIMITS.table_rows:
            raise InputError(
                f"{bag.path}: topic {topic}: more than {LIMITS.table_rows} messages; expected one "
                f"flight"
            )
        recorded.append(received)
        stamped.append(min(stamp(message), 2**63 - 1))
        found = choice.kind.values(message)
        if part in ("rotors", "command"):
            found = _four(found, choice, f"{bag.path}: topic {topic}, message {index + 1}", part)
        values.extend(found)
    if not recorded:
        raise InputError(
            f"{bag.path}: {part}: topic {topic} has no messages; expected at least two"
        )
    numbers = choice.in_kit_units(np.array(values).reshape(len(recorded), -1))
    received_at, sampled_at = np.array(recorded), np.array(stamped)
    if not np.any(sampled_at):
        return received_at, numbers, [f"{topic}: no time stamps; the times of recording were taken"]
    if np.max(np.abs(sampled_at - received_at)) > _SAME_CLOCK * 1e9:
        return (
            received_at,
            numbers,
            [
                f"{topic}: its time stamps are of another clock than the bag's; the times of "
                "recording were taken"
            ],
        )
    return sampled_at, numbers, []


def _four(found: Any, choice: Topic, where: str, part: str) -> Array:
    """Return rotor speeds (4,) or commands (4,) of a message, in the kit's order."""
    numbers: Array = np.asarray(found, dtype=np.float64)
    what = "rotor speed(s)" if part == "rotors" else "command(s)"
    order = choice.setting.get("order")
    if order is None and len(numbers) != 4 and choice.kind.order == "windwrench":
        raise InputError(
            f"{where}: {len(numbers)} {what}; expected 4, or an order in the topic map"
        )
    if len(numbers) < max(choice.order):
        raise InputError(
            f"{where}: {len(numbers)} {what}; expected at least {max(choice.order)} by the order "
            f"{choice.order}"
        )
    return choice.four(numbers)
