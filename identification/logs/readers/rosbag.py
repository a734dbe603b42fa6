"""ROS 1 and ROS 2 bags (``.bag``, ``.db3``, ``.mcap`` or a ROS 2 bag's folder), read with rosbags; no ROS is needed.

A log map may name topics (``log_map``): ``NAME.topics.yaml`` beside the bag ``NAME.bag`` (or folder ``NAME``), or the file given as
``--map`` or as the reader's option, ``rosbag:FILE.yaml``. A section names its topic, and, for types without known columns, its
columns, as fields of a message::

    position: {topic: /vicon/drone}                # and attitude, where nothing else is said
    rotors: {topic: /motors, unit: rad/s, order: px4-x}
    commands: {topic: /pwm, columns: ["data[2]", "data[3]", "data[4]", "data[5]"], unit: us, range: [1000, 2000]}
    battery: {topic: /battery}
    accelerometer: {topic: /imu, body: frd}        # and gyro; where body axes are forward, right, down

``/topic`` alone stands for ``{topic: /topic}``. Rules for sections without a topic:

1. topics named as set-points (setpoint, reference, command ...) are not taken for a pose or for rotor speeds;
2. the bag's only topic of a fitting type is taken;
3. among several poses, a name of motion capture or ground truth (vicon, vrpn, mocap, optitrack ...) wins; among several inertial
   sensors or others, a name without ``_raw``. A note says so;
4. with several topics left, the bag is refused, and the topics are listed.

``maps/recordings/ros.yaml`` states the types' sections, frames, units and orders. A multi-array of std_msgs holds rotor speeds or
commands, if a ``unit`` is given. Without a pose, an inertial sensor must be there. The attitude of sensor_msgs/Imu is not read.

A sample's time is its header's (``timestamp_sample`` or ``timestamp`` of PX4's types), if within a second of the bag's clock, else the
time of recording. Messages are decoded by definitions of rosbags and of ``maps/recordings/ros.yaml``, never by the bag's: no file
chooses the code that runs. A bag with different definitions is refused. A few kilobytes may unpack to any size, so unpacking has a
limit.
"""  # noqa: E501

import bz2
import os
import re
import sqlite3
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from ....runtime.errors import InputError
from ....runtime.extras import need
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import check_regular, open_regular
from ....runtime.yaml_file import read_yaml
from ..channels import ChannelGroup
from ..flight_log import FlightLog, SomeVehicle
from ..mapped_log import flight_log, sections_of
from ..table import NamedArrays, Piece, one_line
from .ros_topics import MessageFields, Stated, Types, definitions, map_of, stamp

WHAT = "a ROS bag (ROS 1, SQLite or MCAP)"
SUFFIXES = (".bag", ".db3", ".mcap")
_ROS1 = b"#ROSBAG V2.0"
BEGINS = _ROS1 + rb"|\x89MCAP0\r\n|SQLite format 3\0"

_Received = Iterator[tuple[int, Any]]  # recorded at ns, and message
_Messages = Callable[[str], _Received]  # by topic

# times (N,) in ns, columns by name, and a topic, or a doubt on its time stamps
_Decoded = tuple[NDArray[np.int64], NamedArrays, str]
LARGEST = LIMITS.bag_chunk
_TABLES = 100  # a bag has four or five
_COMPUTED = re.compile(r"\bAS\s*\(|\bVIRTUAL\b", re.IGNORECASE)
_LISTED = re.compile(r"^\s*-\s*['\"]?(.+\.(?:db3|mcap))['\"]?\s*$", re.MULTILINE)
_WHOLE = re.compile(r"compression_mode:\s*['\"]?(file|message)", re.IGNORECASE)


def read(
    path: Path, vehicle: SomeVehicle = None, option: str = "", piece: Piece = None
) -> FlightLog:
    """Read a bag; ``option`` is the path of a map, by default ``NAME.topics.yaml`` beside the bag,
    if any.

    Raises:
        InputError: rosbags is missing, the bag or the map is unreadable, a message cannot be used,
            or a topic is missing, ambiguous or of another type.
    """
    named = path if path.name.strip(".") else Path(os.path.abspath(path))  # "." has no name
    stem = named.name if os.path.isdir(path) else named.stem
    file = Path(option) if option else named.parent / f"{stem}.topics.yaml"
    given = given_map(file) if option or os.path.exists(file) else {}
    path = _bag_in(path)
    decoded: list[_Decoded] = []
    with _opened(path) as (types, messages):
        log_map, notes = map_of(types, given, str(path), str(file))
        for topic in sorted(log_map.topics - {""}):
            held = {name: part for name, part in log_map.sections.items() if part.topic == topic}
            wanted = [name for part in held.values() for name in part.named]
            fields = MessageFields(f"{path}: topic {topic}", types[topic], wanted)
            try:
                times, columns, doubt = _decoded_topic(fields, messages(topic))
                left_out = {
                    name: f"{topic} has no {part.columns[0]} ..."
                    for name, part in held.items()
                    if not columns.keys() >= {*part.named}
                }
                if len(left_out) == len(held) or left_out.keys() & {*given}:
                    raise fields.lack(columns)
            except InputError as error:
                if held.keys() & {*given, "position", "rotors"}:
                    raise
                left_out = dict.fromkeys(held, str(error))  # the map did not ask for it
            notes += [f"no {name}: {why}" for name, why in left_out.items()]
            log_map = log_map.with_ways(dict.fromkeys(left_out, ()))
            if len(left_out) < len(held):
                decoded.append((times, columns, topic))
                notes += [f"{topic}: {doubt}; the times of recording were taken"] if doubt else []
    if not decoded:
        raise InputError(f"{path}: {notes[-1]}")
    origin = min(times[0] for times, _, _ in decoded)
    recorded = [
        ChannelGroup(1e-9 * (times - origin), columns, name) for times, columns, name in decoded
    ]
    sections = sections_of(path, recorded, log_map, "rosbag", notes, piece)
    return flight_log(path, "rosbag", sections, vehicle)


def _bag_in(path: Path) -> Path:
    """Return the bag's path: the only file of a folder without metadata, else the path itself.

    Raises:
        InputError: the folder has no metadata, and several files of bags or none.
    """
    if not os.path.isdir(path) or os.path.lexists(path / "metadata.yaml"):
        return path
    files = [x for x in path.iterdir() if x.suffix.lower() in (".db3", ".mcap") and not x.is_dir()]
    if len(files) != 1:
        raise InputError(
            f"{path}: no metadata.yaml, and {len(files)} .db3 or .mcap files; expected "
            f"metadata.yaml (ros2 bag reindex {path} writes one), or the name of one file"
        )
    return files[0]


def given_map(file: Path) -> Stated:
    """Return the content of a map file of topics.

    Raises:
        InputError: the file is unreadable, or no map.
    """
    content = read_yaml(file, "a map file")
    if not isinstance(content, Mapping):
        raise InputError(
            f"{file}: expected a mapping of position, rotors and so on to topics, got "
            f"{type(content).__name__}"
        )
    return content


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Types, _Messages]]:
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
        stores.append(get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE))
        for name, text in variant.items():
            stores[-1].register(get_types_from_msg(text, name))
    if not is_ros1:
        _check_bag_files(path)

    def messages(topic: str) -> _Received:
        kind = types[topic]
        where = f"{path}: topic {topic}"
        with one_line(f"{where}: a message cannot be read", kind):
            wanted = [one for one in reader.connections if one.topic == topic]
            fitting = [s for s in stores if all(_same(one, s, is_ros1) for one in wanted)]
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
        with one_line(what, "a whole bag"):
            opened.enter_context(_limited_unpacking())
            reader = opened.enter_context((rosbag1 if is_ros1 else rosbag2).Reader(path))
            types = {connection.topic: connection.msgtype for connection in reader.connections}
        yield types, messages


def _same(connection: Any, store: Any, ros1: bool) -> bool:
    """Return whether a topic was recorded with a store's definition of its type, by the bag's
    digest.
    """
    digest = connection.digest or ""
    if ros1:
        return bool(digest == store.generate_msgdef(connection.msgtype)[1])
    # a type hash stands in newer ROS 2 bags only
    return not digest.startswith("RIHS01") or bool(digest == store.hash_rihs01(connection.msgtype))


def _decoded(raw: Any, kind: str, stores: list[Any], ros1: bool) -> Any:
    """Return a message, decoded by the first fitting definition; the definitions before are
    dropped.
    """
    while True:
        try:
            return getattr(stores[0], f"deserialize_{'ros1' if ros1 else 'cdr'}")(raw, kind)
        except Exception:
            if len(stores) == 1:
                raise
            del stores[0]


def _decoded_topic(fields: MessageFields, messages: _Received) -> _Decoded:
    """Return times (N,) in ns and columns (N,) of a topic by name, and a doubt on its time stamps.

    Raises:
        InputError: the topic has no message, too many, or an unusable one.
    """
    recorded, stamped = array("q"), array("q")
    for index, (received, message) in enumerate(messages):
        check_count(fields.where, index + 1, LIMITS.table_rows, "messages")
        recorded.append(received)
        stamped.append(stamp(message))
        fields.take(message)
    if not recorded:
        raise InputError(f"{fields.where} has no messages; expected at least two")
    received_at, sampled_at, doubt = np.array(recorded), np.array(stamped), ""
    if not sampled_at.any():
        doubt = "no time stamps"
    elif abs(sampled_at - received_at).max() > 1_000_000_000:  # ns
        doubt = "its time stamps are of another clock than the bag's"
    return received_at if doubt else sampled_at, fields.columns(), doubt


def _at_most(make: Callable[[], Any], spent: list[int]) -> Callable[..., bytes]:
    """Return a decompression of ``make()``'s kind with limits: ``LARGEST`` bytes of a chunk, and a
    bag's limit on all chunks. ``spent`` keeps the count, since an index may name the same chunk
    over and over.
    """

    def unpack(data: bytes, *_: object) -> bytes:
        machine = make()
        out: bytes = machine.decompress(data, max_length=LARGEST)
        if not machine.eof:
            raise ValueError(f"a chunk unpacks to more than {LARGEST} bytes, or ends too soon")
        spent[0] += len(out)
        if spent[0] > LIMITS.bag_unpacked:
            raise ValueError(
                f"its chunks unpack to more than {LIMITS.bag_unpacked} bytes; copy the topics of "
                f"pose and rotors to a bag of their own"
            )
        return out

    return unpack


@contextmanager
def _limited_unpacking() -> Iterator[None]:
    """Limit rosbags' unpacking within the block: a chunk to ``LARGEST`` bytes, all chunks and their
    index by ``FileLimits``.
    """
    import lz4.frame
    from rosbags.rosbag1 import reader
    from rosbags.rosbag2 import storage_mcap

    spent, entries = [0], count()

    class Entry(reader.IndexData):  # type: ignore[misc]
        """An entry of the index, counted."""

        __slots__ = ()

        def __new__(cls, *values: int) -> Any:
            if next(entries) >= LIMITS.bag_index:
                raise ValueError(f"its index has more than {LIMITS.bag_index} entries")
            return super().__new__(cls, *values)

    unpacks = {
        "bz2": _at_most(bz2.BZ2Decompressor, spent),
        "lz4": _at_most(lz4.frame.LZ4FrameDecompressor, spent),
        "zstd": _at_most(storage_mcap.zstd.ZstdDecompressor, spent),
    }
    with (
        patch.object(reader, "IndexData", Entry),
        patch.dict(reader.decompressors, unpacks),
        patch.dict(storage_mcap.DECOMPRESSORS, unpacks),
    ):
        yield


def _check_bag_files(path: Path) -> None:
    """Check the files of a ROS 2 bag, a file or a folder, before a library opens them by name.

    Raises:
        InputError: one is no regular file, or a database with computed columns. Or files or
            messages are packed one by one, without a limit on unpacking.
    """
    is_folder = os.path.isdir(path)
    metadata = (path if is_folder else path.parent) / "metadata.yaml"
    files, text = [path], ""
    if metadata.exists():
        check_regular(metadata, "the metadata of a ROS 2 bag", 1_000_000)
        text = metadata.read_bytes().decode("utf-8", "replace")
    if is_folder:
        listed = (path / name for name in _LISTED.findall(text))
        files = [x for x in (*path.iterdir(), *filter(Path.exists, listed)) if not x.is_dir()]
    for file in files:
        check_regular(file, "a file of a ROS 2 bag")
        if file.suffix.lower() != ".db3":
            continue
        # a view or a computed column of a few bytes of SQL may give any number of rows of any size
        tables = []
        # the reader states the error, of any letters
        with suppress(sqlite3.Error, UnicodeDecodeError):
            uri = f"{file.resolve().as_uri()}?mode=ro&immutable=1"
            with closing(sqlite3.connect(uri, uri=True)) as database:
                database.text_factory = partial(str, errors="replace")
                tables = database.execute(
                    "SELECT name, type, sql FROM sqlite_master WHERE type IN ('table', 'view')"
                ).fetchmany(_TABLES)
        for name, kind, sql in tables:
            if kind == "view" or _COMPUTED.search(sql or "") or len(tables) == _TABLES:
                raise InputError(
                    f"{file}: its {kind} {name!r} is computed; expected a ROS 2 bag, whose tables "
                    "hold what was recorded"
                )
    if packed := _WHOLE.search(text):
        raise InputError(
            f"{metadata}: compression_mode {packed[1].lower()}: expected a bag that is not "
            "packed, or by chunks (MCAP); `ros2 bag convert` makes one"
        )
