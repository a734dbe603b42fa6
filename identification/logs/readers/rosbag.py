"""ROS 1 and ROS 2 bags (``.bag``, ``.db3``, ``.mcap`` or a ROS 2 bag's folder), read with rosbags; no ROS is needed.

Which topic is what, a small YAML file says: ``NAME.topics.yaml`` beside the bag ``NAME.bag`` (or folder ``NAME``), or the
file given as the reader's option, ``rosbag:FILE.yaml``::

    pose: {topic: /vicon/drone, frame: flu}        # or ned; default flu
    rotors: {topic: /motors, unit: rad/s, order: [3, 2, 4, 1]}
    voltage: {topic: /battery}                     # optional
    imu: {topic: /imu, frame: flu}                 # optional; or ned, for body axes forward, right, down

``/topic`` alone stands for ``{topic: /topic}``. What the file does not name is the bag's only topic of a type that fits.

=========  =============================================================================================================
pose       geometry_msgs/PoseStamped, geometry_msgs/TransformStamped (body in world) or nav_msgs/Odometry.
           ``frame: flu`` is ROS's own: world z up, body forward, left, up. ``ned``: world z down, body forward, right, down
rotors     mav_msgs/Actuators (``angular_velocities``) or std_msgs/Float32MultiArray, the latter only with a ``unit``:
           ``rad/s`` (default for Actuators), ``rpm`` or ``rev/s``. ``order``: which elements, from 1, are rotors 1
           front-left, 2 rear-left, 3 rear-right, 4 front-right; PX4's quad x is [3, 2, 4, 1]; default [1, 2, 3, 4]
voltage    sensor_msgs/BatteryState
imu        sensor_msgs/Imu, without its attitude: specific force (m/s2) and angular velocity (rad/s), as ROS's REP 145 has
           them. Only where the file names it: a bag may hold several, mounted in any way
=========  =============================================================================================================

A sample's time is its header's, where that runs within a second of the bag's clock, else the time it was recorded.
Messages are decoded by rosbags' own definitions (and the one of mav_msgs/Actuators below), never by those in the bag,
so that nothing in a file decides what code runs; a bag whose definitions differ is refused.
"""  # noqa: E501

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError, unknown_name
from ....runtime.yaml_file import read_yaml
from ..flight_log import FlightLog
from .streams import Stream, flight_log, from_ned
from .unpacking import limited_unpacking, refuse_packed_files

Array = NDArray[np.float64]

SUFFIXES = (".bag", ".db3", ".mcap")

_ACTUATORS = "mav_msgs/msg/Actuators"
_ACTUATORS_TEXT = (
    "std_msgs/Header header\nfloat64[] angles\nfloat64[] angular_velocities\nfloat64[] normalized\n"
)
_ARRAY = "std_msgs/msg/Float32MultiArray"
_TYPES = {
    "pose": (
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/TransformStamped",
        "nav_msgs/msg/Odometry",
    ),
    "rotors": (_ACTUATORS, _ARRAY),
    "voltage": ("sensor_msgs/msg/BatteryState",),
    "imu": ("sensor_msgs/msg/Imu",),
}
_KEYS = {
    "pose": ("topic", "frame"),
    "rotors": ("topic", "unit", "order"),
    "voltage": ("topic",),
    "imu": ("topic", "frame"),
}
_UNITS = {"rad/s": 1.0, "rpm": 2.0 * math.pi / 60.0, "rev/s": 2.0 * math.pi}
_FRAMES = ("flu", "ned")
_SAME_CLOCK = 1.0  # s between a header's time and the recording's


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
    del vehicle  # a bag has rotor speeds; nothing needs to be turned into them
    settings, where = _topic_map(path, option)
    with _opened(path) as bag:
        chosen = {
            part: topic
            for part in _TYPES
            if (topic := _choose(bag, part, settings.get(part, {}), where)) is not None
        }
        streams, doubts = {}, []
        for part, topic in chosen.items():
            try:
                streams[part] = _stream(bag, part, topic, settings.get(part, {}), where)
            except InputError as error:
                if part != "voltage" or "topic" in settings.get(part, {}):
                    raise
                doubts.append(f"no voltage: {error}")  # nobody asked for it
    order = settings.get("rotors", {}).get("order", [1, 2, 3, 4])
    frame = settings.get("pose", {}).get("frame", "flu")
    notes = [
        *(
            f"{part}: topic {topic} ({bag.types[topic]})"
            for part, topic in chosen.items()
            if part in streams
        ),
        f"rotors 1, 2, 3, 4 are elements {', '.join(map(str, order))} of the message",
        "frames: world z up, body forward, left, up, as the bag has them"
        if frame == "flu"
        else "world and body turned half a turn about x: from z down to z up",
        *doubts,
        *(note for _, _, stamp_notes in streams.values() for note in stamp_notes),
    ]
    origin = min(int(nanoseconds[0]) for nanoseconds, _, _ in streams.values())
    made = {
        part: Stream(chosen[part], 1e-9 * (nanoseconds - origin).astype(np.float64), values)
        for part, (nanoseconds, values, _) in streams.items()
    }
    return flight_log(
        path,
        "rosbag",
        made["pose"],
        made["rotors"],
        made.get("voltage"),
        tuple(notes),
        *_inertial(made.get("imu")),
    )


def _inertial(imu: Stream | None) -> tuple[Stream | None, Stream | None]:
    """Return accelerometer and gyro of an IMU's stream."""
    if imu is None:
        return None, None
    force, turn = imu.values[:, :3], imu.values[:, 3:]
    return Stream(imu.name, imu.t, force), Stream(imu.name, imu.t, turn)


def _topic_map(path: Path, option: str) -> tuple[dict[str, dict[str, Any]], str]:
    """Return the settings of each part, checked, and the name of the file that they
    are from.
    """
    stem = path.name if path.is_dir() else path.stem
    file = Path(option) if option else path.with_name(f"{stem}.topics.yaml")
    if not option and not file.exists():
        return {}, str(file)
    data = read_yaml(file, "a topic map")
    if not isinstance(data, dict):
        raise InputError(
            f"{file}: expected a mapping of {', '.join(_TYPES)} to topics, got "
            f"{type(data).__name__}"
        )
    settings = {}
    for part, value in data.items():
        if part not in _TYPES:
            raise unknown_name("key", str(part), _TYPES, str(file))
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
    for key, known in (("frame", _FRAMES), ("unit", _UNITS)):
        if key in setting and (not isinstance(setting[key], str) or setting[key] not in known):
            raise unknown_name(key, str(setting[key]), known, f"{where}: {part}")
    if "order" in setting:
        order = setting["order"]
        good = (
            isinstance(order, list)
            and all(type(i) is int and i >= 1 for i in order)
            and len(set(order)) == 4 == len(order)
        )
        if not good:
            raise InputError(
                f"{where}: rotors: order: expected four different elements, counted from 1, such "
                f"as "
                f"[1, 2, 3, 4], got {order!r}"
            )
    return setting


@contextmanager
def _opened(path: Path) -> Iterator[_Bag]:
    """Open a bag of either kind.

    Raises:
        InputError: rosbags is missing or the bag cannot be read.
    """
    ros1 = path.suffix.lower() == ".bag"
    if not (path.is_dir() or path.name.lower().endswith(SUFFIXES)):
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
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(_ACTUATORS_TEXT, _ACTUATORS))
    if not ros1:
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
            for connection in wanted:
                _check_definition(path, connection, store, ros1)
            for _, recorded, raw in reader.messages(wanted):
                if not 0 <= int(recorded) < 2**63:
                    raise ValueError(f"recorded at {recorded} ns")
                yield (
                    int(recorded),
                    store.deserialize_ros1(raw, kind) if ros1 else store.deserialize_cdr(raw, kind),
                )
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


def _check_definition(path: Path, connection: Any, store: Any, ros1: bool) -> None:
    """Raise InputError where a topic was recorded with another definition of its type than the one
    that will decode it.
    """
    digest = connection.digest or ""
    if ros1:
        known = digest == store.generate_msgdef(connection.msgtype)[1]
    else:  # a type hash stands in newer ROS 2 bags only
        known = not digest.startswith("RIHS01") or digest == store.hash_rihs01(connection.msgtype)
    if not known:
        raise InputError(
            f"{path}: topic {connection.topic}: its {connection.msgtype} has another definition "
            f"than the one "
            f"this reader knows (digest {digest}); expected the common one"
        )


def _choose(bag: _Bag, part: str, setting: Mapping[str, Any], where: str) -> str | None:
    """Return the topic of a part: the one named, or the only one that fits; None:
    no voltage, no named IMU.
    """
    fitting = _TYPES[part]
    if part == "imu" and "topic" not in setting:
        return None
    if "topic" in setting:
        topic = str(setting["topic"])
        if topic not in bag.types:
            raise unknown_name("topic", topic, bag.types, f"{bag.path}: {part} (named in {where})")
        if bag.types[topic] not in fitting:
            raise InputError(
                f"{bag.path}: {part}: topic {topic} is of type {bag.types[topic]}; expected "
                f"{' or '.join(fitting)}"
            )
        return topic
    if part == "rotors" and "unit" not in setting:
        fitting = (_ACTUATORS,)  # an array of numbers may be anything until somebody names its unit
    found = sorted(topic for topic, kind in bag.types.items() if kind in fitting)
    if len(found) == 1:
        return found[0]
    if not found and part == "voltage":
        return None
    what = (
        f"{len(found)} topics could be it ({', '.join(found)})"
        if found
        else "no topic of a type that fits"
    )
    listed = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(bag.types.items())) or "none"
    raise InputError(
        f"{bag.path}: {part}: {what}; expected one of {' or '.join(_TYPES[part])}, or its name in "
        f"{where}. "
        f"The bag's topics: {listed}"
    )


def _stream(
    bag: _Bag, part: str, topic: str, setting: Mapping[str, Any], where: str
) -> tuple[NDArray[np.int64], Array, list[str]]:
    """Return times (N,) in ns, values (N, K) in the kit's frames, order and units, and notes of a
    topic.
    """
    kind = bag.types[topic]
    if kind == _ARRAY and "unit" not in setting:
        raise InputError(
            f"{bag.path}: rotors: topic {topic} is a {kind}, which states no unit; expected unit: "
            f"{', '.join(_UNITS)} in {where}"
        )
    recorded, stamped, values = [], [], []
    for index, (received, message) in enumerate(bag.messages(topic)):
        recorded.append(received)
        header = getattr(message, "header", None)
        stamped.append(0 if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec)
        values.append(
            _rotor_values(message, kind, setting, f"{bag.path}: topic {topic}, message {index + 1}")
            if part == "rotors"
            else _values(message, kind)
        )
    if not values:
        raise InputError(
            f"{bag.path}: {part}: topic {topic} has no messages; expected at least two"
        )
    numbers = np.array(values, dtype=np.float64)
    if part == "imu" and setting.get("frame") == "ned":
        numbers = numbers * np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
    if part == "pose" and setting.get("frame") == "ned":
        numbers = np.column_stack(from_ned(numbers[:, :3], numbers[:, 3:]))
    received_at, sampled_at = np.array(recorded, dtype=np.int64), np.array(stamped, dtype=np.int64)
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


def _rotor_values(message: Any, kind: str, setting: Mapping[str, Any], where: str) -> Array:
    """Return rotor speeds (4,) in rad/s in the kit's order."""
    speeds: Array = np.asarray(
        message.data if kind == _ARRAY else message.angular_velocities, dtype=np.float64
    )
    order = setting.get("order")
    if order is None and len(speeds) != 4:
        raise InputError(
            f"{where}: {len(speeds)} rotor speed(s); expected 4, or an order in the topic map"
        )
    if order is not None and len(speeds) < max(order):
        raise InputError(
            f"{where}: {len(speeds)} rotor speed(s); expected at least {max(order)} by the order "
            f"{order}"
        )
    chosen: Array = (
        speeds[np.array(order or [1, 2, 3, 4]) - 1] * _UNITS[setting.get("unit", "rad/s")]
    )
    return chosen


def _values(message: Any, kind: str) -> list[float]:
    """Return position and scalar-first quaternion, the voltage, or specific force and angular
    velocity.
    """
    if kind == "sensor_msgs/msg/BatteryState":
        return [message.voltage]
    if kind == "sensor_msgs/msg/Imu":
        force, turn = message.linear_acceleration, message.angular_velocity
        return [force.x, force.y, force.z, turn.x, turn.y, turn.z]
    if kind == "geometry_msgs/msg/TransformStamped":
        place, turn = message.transform.translation, message.transform.rotation
    else:
        pose = message.pose.pose if kind == "nav_msgs/msg/Odometry" else message.pose
        place, turn = pose.position, pose.orientation
    return [place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z]
