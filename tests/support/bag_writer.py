"""A writer of ROS bags: messages are mappings of fields; what is not given is zero."""

from functools import cache

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from windwrench.identification.logs.readers.ros_topics import definitions

START = 1_700_000_000_000_000_000  # ns


@cache
def typestore(is_ros1, variant=0):
    """The types of ROS and those that the kit defines."""
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    for name, text in definitions()[variant].items():
        store.register(get_types_from_msg(text, name))
    return store


def stamp(t):
    """A header that was stamped t seconds after the start."""
    at = START + round(1e9 * t)
    return {"stamp": {"sec": at // 10**9, "nanosec": at % 10**9}}


def write_bag(path, topics, kind="mcap", variant=0, delay=0.0, packed=()):
    """Write ``{topic: (type, times, fields of a message at t[, its definition in the bag])}`` into
    a bag of ROS 1 (kind bag) or ROS 2 (db3, mcap); messages are recorded ``delay`` s late.
    """
    is_ros1 = kind == "bag"
    store = typestore(is_ros1, variant)
    plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
    writer = (
        rosbag1.Writer(path) if is_ros1 else rosbag2.Writer(path, version=9, storage_plugin=plugin)
    )
    if packed:
        writer.set_compression(*packed)
    serialize = store.serialize_ros1 if is_ros1 else store.serialize_cdr
    with writer:
        for topic, (name, times, fields, *definition) in topics.items():
            how = {"msgdef": definition[0], "md5sum": 32 * "0"} if definition else {}
            how = how or {"typestore": store}
            connection = writer.add_connection(topic, name, **how)
            for t in times:
                raw = serialize(message(store, name, fields(t)), name)
                writer.write(connection, START + round(1e9 * (t + delay)), raw)
    return path


def pose_fields(position, quaternion):
    """Return the fields of a pose: position (3,) in m, quaternion (4,) with the scalar first."""
    place = dict(zip("xyz", map(float, position), strict=True))
    return {
        "position": place,
        "orientation": dict(zip("wxyz", map(float, quaternion), strict=True)),
    }


def message(store, name, given):
    """Return a message of a type from some of its fields; the others are zero."""
    _, known = store.fielddefs[name]
    values = {field: _value(store, kind, given.get(field)) for field, kind in known}
    assert set(given) <= set(values)
    return store.types[name](**values)


def _value(store, kind, given):
    node, what = kind
    if node is Nodetype.BASE:
        number = "" if what[0] == "string" else 0
        return given if given is not None else number
    if node is Nodetype.NAME:
        return message(store, what, given or {})
    (inner, name), count = what
    if inner is Nodetype.NAME:
        items = given if given is not None else [{}] * (count if node is Nodetype.ARRAY else 0)
        return [message(store, name, item) for item in items]
    numbers = given if given is not None else np.zeros(count if node is Nodetype.ARRAY else 0)
    return np.asarray(numbers, dtype=name[0])
