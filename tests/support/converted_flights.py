"""A flight in the kit's own form, written as other programs write theirs."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.support import bag_writer
from tests.support.autopilot_flight import FLIP
from tests.support.ulog_writer import ulog_bytes


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
    row = {t: k for k, t in enumerate(log.t.tolist())}

    def pose(t):
        here = bag_writer.pose_fields(log.position[row[t]], log.quaternion[row[t]])
        return {"header": bag_writer.stamp(t), "pose": here}

    def motors(t):
        return {"data": log.rotor_speeds[row[t]]}

    topics = {
        pose_topic: ("geometry_msgs/msg/PoseStamped", row, pose),
        "/motors": ("std_msgs/msg/Float32MultiArray", row, motors),
    }
    bag_writer.write_bag(path, topics, kind)
