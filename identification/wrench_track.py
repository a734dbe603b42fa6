"""The wrench on a flight as a track for other programs' viewers: an MCAP file of ROS 2 messages,
for Foxglove and PlotJuggler.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..runtime.extras import need
from ..runtime.whole_files import replaced
from .wrench_series import WrenchSeries

_FRAME = "world"
_WRENCH, _POSE = "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/PoseStamped"


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

    def made(name: str, *values: Any) -> Any:
        package, kind = name.split("/")
        return store.types[f"{package}/msg/{kind}"](*values)

    def vector(x: Any, kind: str = "Vector3") -> Any:
        return made(f"geometry_msgs/{kind}", *x)

    names = {"/wrench": _WRENCH, "/wrench_std": _WRENCH, "/pose": _POSE}
    begin = min(float(series.t[0]), 0.0)  # a bag's times are not negative
    columns = (
        *(series.force, series.torque, series.std_force, series.std_torque),
        *(series.position, series.quaternion[:, [1, 2, 3, 0]]),
    )
    with replaced(path) as partial, TemporaryDirectory(dir=partial.parent) as folder:
        bag = Path(folder) / "track"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = {
                topic: writer.add_connection(topic, name, typestore=store)
                for topic, name in names.items()
            }
            rows = zip(series.t.tolist(), *(x.tolist() for x in columns), strict=True)
            for t, force, torque, std_force, std_torque, position, quaternion in rows:
                at = round(1e9 * (t - begin))
                stamp = made("builtin_interfaces/Time", at // 10**9, at % 10**9)
                header = made("std_msgs/Header", stamp, _FRAME)
                turned = made("geometry_msgs/Quaternion", *quaternion)
                parts = {
                    "/wrench": made("geometry_msgs/Wrench", vector(force), vector(torque)),
                    "/wrench_std": made(
                        "geometry_msgs/Wrench", vector(std_force), vector(std_torque)
                    ),
                    "/pose": made("geometry_msgs/Pose", vector(position, "Point"), turned),
                }
                for topic, part in parts.items():
                    message = store.types[names[topic]](header, part)
                    writer.write(topics[topic], at, store.serialize_cdr(message, names[topic]))
        (bag / "track.mcap").replace(partial)
