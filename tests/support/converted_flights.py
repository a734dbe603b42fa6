"""A flight in the kit's own form, written as other programs write theirs."""

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from tests.support.ulog_writer import ulog_bytes

FLIP = np.diag([1.0, -1.0, -1.0])  # our world and body seen from PX4's, each half a turn about x
START = 1_700_000_000_000_000_000  # ns


def write_ulog(log, path):
    """Motion capture and rotor speeds as PX4 logs them: north, east, down, and its own order of
    motors.
    """
    stamps = np.round(1e6 * (log.t + 10.0)).astype(np.uint64)
    turned = FLIP @ Rotation.from_quat(log.quaternion, scalar_first=True).as_matrix() @ FLIP
    rpm = np.round(log.rotor_speeds[:, [3, 1, 0, 2]] * 30.0 / np.pi).astype(int)
    path.write_bytes(
        ulog_bytes(
            {
                "vehicle_mocap_odometry": {
                    "uint64_t timestamp": stamps,
                    "uint64_t timestamp_sample": stamps,
                    "uint8_t pose_frame": np.full(len(log.t), 2),
                    "float position": log.position @ FLIP,
                    "float q": Rotation.from_matrix(turned).as_quat(scalar_first=True),
                },
                "esc_status": {
                    "uint64_t timestamp": stamps,
                    **{f"int32_t esc[{i}].esc_rpm": rpm[:, i] for i in range(4)},
                },
            }
        )
    )


def write_bag(log, path, kind="db3", pose_topic="/vicon/drone"):
    """A bag with poses and with rotor speeds on /motors: of ROS 1 (``kind`` bag), or a folder of
    ROS 2 with SQLite (db3) or MCAP (mcap).
    """
    ros1 = kind == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    types = store.types
    pose_name, array_name = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/Float32MultiArray"
    with (
        rosbag1.Writer(path) if ros1 else rosbag2.Writer(path, version=9, storage_plugin=plugin)
    ) as writer:
        poses = writer.add_connection(pose_topic, pose_name, typestore=store)
        rotors = writer.add_connection("/motors", array_name, typestore=store)
        for t, p, q, speeds in zip(
            log.t, log.position, log.quaternion, log.rotor_speeds, strict=True
        ):
            now = START + round(1e9 * t)
            stamp = types["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
            header = types["std_msgs/msg/Header"](*([0] if ros1 else []), stamp, "world")
            pose = types["geometry_msgs/msg/Pose"](
                types["geometry_msgs/msg/Point"](*p),
                types["geometry_msgs/msg/Quaternion"](q[1], q[2], q[3], q[0]),
            )
            message = types[pose_name](header, pose)
            writer.write(poses, now, serialize(message, pose_name))
            layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
            message = types[array_name](layout, speeds.astype(np.float32))
            writer.write(rotors, now, serialize(message, array_name))
