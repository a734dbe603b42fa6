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

Which types hold what, and in which frame, unit and order, says ``maps/recordings/ros.yaml``; a
multi-array of std_msgs holds rotor speeds or commands where a ``unit`` is given: ``rad/s``, ``rpm``
or ``Hz``, ``normalised`` or ``us``. ``order`` has a name (``px4-x``, ``betaflight`` ...), or the
elements, from 1, that are rotors 1 front-left, 2 rear-left, 3 rear-right, 4 front-right. ``range``
has the values of the commands 0 and 1, of pulses 1000 and 2000 us unless it is given. Without a
pose, an inertial sensor must be there. Of sensor_msgs/Imu the attitude is not read.

A sample's time is its header's (of PX4's types its ``timestamp_sample`` or ``timestamp``), where that runs within a second of the
bag's clock, else the time it was recorded.
Messages are decoded by rosbags' own definitions and those in ``ros_messages``, never by those in the bag,
so that nothing in a file decides what code runs; a bag whose definitions differ is refused.
"""  # noqa: E501

import os
from array import array
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ....runtime.extras import need
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import open_regular
from ..channels import Samples
from ..flight_log import FlightLog
from ..mapped_log import recording_of
from ..table import Array
from ..what_flew import UNSTATED, WhatFlew, running
from .ros_messages import MOTORS, definitions, stamp
from .topic_map import Topic, chosen_topics, joined, topic_map
from .unpacking import check_bag_files, limited_unpacking

WHAT = "a ROS bag (ROS 1, SQLite or MCAP)"
SUFFIXES = (".bag", ".db3", ".mcap")
_ROS1 = b"#ROSBAG V2.0"
BEGINS = (_ROS1, b"\x89MCAP0\r\n", b"SQLite format 3\0")

_Messages = Callable[[str], Iterator[tuple[int, Any]]]  # topic to (recorded at ns, message)

_SAME_CLOCK = 1_000_000_000  # ns between a header's time and the recording's
_NANOSECOND = 1e-9  # s


def read(
    path: Path, vehicle: Vehicle | None = None, option: str = "", piece: int | None = None
) -> FlightLog:
    """Read a bag; ``option`` is the path of a topic map, the default ``NAME.topics.yaml`` beside
    the bag if it is there.

    Raises:
        InputError: rosbags is missing, the bag or the map cannot be read, a topic is missing,
            ambiguous or of another type, or a message cannot be used.
    """
    settings, where = topic_map(path, option)
    flown, decoded = UNSTATED, []
    with _opened(path) as (types, messages):
        topics, doubts = chosen_topics(path, types, settings, where)
        for part, topic in list(topics.items()):
            try:
                times, columns, doubt, count = _decoded_topic(path, topic, messages)
                decoded.append((times, columns, topic.name))
                doubts += [doubt] if doubt else []
                flown = flown if count is None else WhatFlew(running=count)
            except InputError as error:
                if part in settings or part in ("pose", "rotors"):
                    raise
                doubts.append(f"no {part}: {error}")  # nobody asked for it
                del topics[part]
    if not topics:
        raise InputError(f"{path}: {doubts[0] if doubts else 'nothing in it can be read'}")
    notes = [note for topic in topics.values() for note in _notes(topic, types[topic.name])]
    origin = min(int(times[0]) for times, _, _ in decoded)
    recorded = [
        Samples(_NANOSECOND * (times - origin).astype(float), columns, name)
        for times, columns, name in decoded
    ]
    said = (*notes, *doubts)
    return recording_of(path, recorded, joined(topics), "rosbag", said, piece, flown).log(vehicle)


def _notes(topic: Topic, kind: str) -> Iterator[str]:
    """Yield which topic holds a part, and what was assumed of its frame or order."""
    part, frame = topic.part, topic.kind.frame
    yield f"{part}: topic {topic.name} ({kind}){topic.why}"
    if part in MOTORS:
        said = f", as on {topic.assumed_order}, which the bag does not state"
        said = said if topic.assumed_order else ""
        if part == "command" and topic.kind.unit == "us":
            low, high = topic.kind.range
            said += f"; pulses of {low:g} to {high:g} us are the commands 0 to 1"
        elements = ", ".join(map(str, topic.elements))
        yield f"{part}: rotors 1, 2, 3, 4 are elements {elements} of the message{said}"
    elif part != "voltage" and frame == "flu":
        world = "world z up, " if part == "pose" else ""
        yield f"{part}: {world}body forward, left, up, as the bag has it"
    elif part != "voltage":
        yield f"{part}: turned half a turn about x, from z down to z up"


@contextmanager
def _one_line(what: str, expected: str) -> Iterator[None]:
    """Make one line of whatever a parser raises of bytes that are none of its own."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        words = f"{what}: {error or type(error).__name__}; expected {expected}"
        raise InputError(words) from error


@contextmanager
def _opened(path: Path) -> Iterator[tuple[dict[str, str], _Messages]]:
    """Open a bag of either kind; give the types of its topics, and how to read the messages of one.

    Raises:
        InputError: rosbags is missing or the bag cannot be read.
    """
    is_folder = os.path.isdir(path)
    is_ros1 = not is_folder and path.suffix.lower() == ".bag"
    if not is_folder:
        with open_regular(path, "a ROS bag") as file:
            is_ros1 |= file.read(len(_ROS1)) == _ROS1
    if not (is_folder or is_ros1 or path.name.lower().endswith(SUFFIXES)):
        raise InputError(
            f"{path}: unknown kind of bag; expected {', '.join(SUFFIXES)} or the folder of a ROS 2 "
            f"bag"
        )
    need("rosbags", "logs", path)
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    stores = []
    for variant in definitions():
        store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
        for name, text in variant.items():
            store.register(get_types_from_msg(text, name))
        stores.append(store)
    if not is_ros1:
        check_bag_files(path)

    def messages(topic: str) -> Iterator[tuple[int, Any]]:
        kind = types[topic]
        where = f"{path}: topic {topic}"
        with _one_line(f"{where}: a message cannot be read", kind):
            wanted = [connection for connection in reader.connections if connection.topic == topic]
            fitting = [s for s in stores if all(_same(c, s, is_ros1) for c in wanted)]
            if not fitting:
                raise InputError(
                    f"{where}: its {kind} has another definition than the one this reader knows "
                    f"(digest {wanted[0].digest}); expected the common one"
                )
            for _, recorded, raw in reader.messages(wanted):
                if not 0 <= int(recorded) < 2**63:
                    raise ValueError(f"recorded at {recorded} ns")
                yield int(recorded), _decoded(raw, kind, fitting, is_ros1)

    with ExitStack() as opened:
        what = f"{path}: cannot be read as a ROS {1 if is_ros1 else 2} bag"
        with _one_line(what, "a whole bag"):
            opened.enter_context(limited_unpacking())
            reader = opened.enter_context((rosbag1 if is_ros1 else rosbag2).Reader(path))
            types = {connection.topic: connection.msgtype for connection in reader.connections}
        yield types, messages


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
            return getattr(stores[0], f"deserialize_{'ros1' if ros1 else 'cdr'}")(raw, kind)
        except Exception:
            if len(stores) == 1:
                raise
            del stores[0]


def _decoded_topic(
    path: Path, topic: Topic, messages: _Messages
) -> tuple[NDArray[np.int64], dict[str, Array], str, int | None]:
    """Return times (N,) in ns and columns (N,) of a topic by name, and what is wrong with its time
    stamps; and of more than four commands, whose order nobody stated, how many run as motors do.

    Raises:
        InputError: it has no message or too many, or one that cannot be used.
    """
    recorded, stamped, values = array("q"), array("q"), array("d")
    every: list[Array] = []
    where = f"{path}: topic {topic.name}"
    for index, (received, message) in enumerate(messages(topic.name)):
        check_count(where, index + 1, LIMITS.table_rows, "messages")
        recorded.append(received)
        stamped.append(stamp(message))
        try:
            values.extend(topic.values(message))
            if topic.part == "command" and topic.assumed_order:
                every.append(topic.kind.values(message))
        except ValueError as error:
            raise InputError(f"{where}, message {index + 1}: {error}") from error
    if not recorded:
        raise InputError(
            f"{path}: {topic.part}: topic {topic.name} has no messages; expected at least two"
        )
    table = np.array(values).reshape(len(recorded), -1)
    columns = dict(zip(topic.columns, table.T, strict=True))
    received_at, sampled_at, doubt = np.array(recorded), np.array(stamped), ""
    if not np.any(sampled_at):
        doubt = "no time stamps"
    elif np.max(np.abs(sampled_at - received_at)) > _SAME_CLOCK:
        doubt = "its time stamps are of another clock than the bag's"
    times = received_at if doubt else sampled_at
    doubt = f"{topic.name}: {doubt}; the times of recording were taken" if doubt else ""
    running_outputs = None
    if len({len(one) for one in every}) == 1 and len(every[0]) > 4:
        motors = [element - 1 for element in topic.elements]
        running_outputs = running(np.array(every), motors, *topic.kind.range)
    return times, columns, doubt, running_outputs
