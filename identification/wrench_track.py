"""The wrench on a flight as a track for other programs' viewers: an MCAP file of ROS 2 messages,
for Foxglove and PlotJuggler.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..runtime.extras import need
from ..runtime.whole_files import replaced
from .wrench_series import WrenchSeries

_FRAME = "world"
_TOPICS = {
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/wrench_std": "geometry_msgs/msg/WrenchStamped",
    "/pose": "geometry_msgs/msg/PoseStamped",
}
# time, header, vector, point, quaternion, wrench, pose
_PARTS = (
    "builtin_interfaces/msg/Time",
    "std_msgs/msg/Header",
    "geometry_msgs/msg/Vector3",
    "geometry_msgs/msg/Point",
    "geometry_msgs/msg/Quaternion",
    "geometry_msgs/msg/Wrench",
    "geometry_msgs/msg/Pose",
)


def write_mcap(series: WrenchSeries, path: Path) -> None:
    """Write force and torque (``/wrench``), their standard deviations (``/wrench_std``) and the
    pose (``/pose``), world frame, at the log's times; whole or not at all.

    Raises:
        InputError: the logs extra is not installed, or the file cannot be written.
    """
    need("rosbags", "logs", path)
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    time, header, vector, point, quaternion, wrench, pose = (store.types[name] for name in _PARTS)
    begin = min(series.t[0], 0.0)  # a bag's times are not negative
    vectors = series.force, series.torque, series.std_force, series.std_torque
    columns = series.t, series.position, np.roll(series.quaternion, -1, axis=1), *vectors
    with replaced(path) as partial, TemporaryDirectory(dir=partial.parent) as folder:
        bag = Path(folder) / "track"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = [
                writer.add_connection(topic, name, typestore=store)
                for topic, name in _TOPICS.items()
            ]
            for t, place, turn, *row in zip(*(x.tolist() for x in columns), strict=True):
                at = round(1e9 * (t - begin))
                stamped = header(time(at // 10**9, at % 10**9), _FRAME)
                force, torque, std_force, std_torque = (vector(*x) for x in row)
                parts = (
                    wrench(force, torque),
                    wrench(std_force, std_torque),
                    pose(point(*place), quaternion(*turn)),
                )
                for topic, part in zip(topics, parts, strict=True):
                    message = store.types[topic.msgtype](stamped, part)
                    writer.write(topic, at, store.serialize_cdr(message, topic.msgtype))
        (bag / "track.mcap").replace(partial)
