"""A flight in the kit's own form, written as other programs write theirs."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.support import bag_writer
from tests.support.autopilot_flight import FLIP
from tests.support.ulog_writer import esc, odometry, ulog_bytes


def write_ulog(log, path):
    """Motion capture and rotor speeds as PX4 logs them: north, east, down, and its own order of
    motors.
    """
    turned = FLIP @ Rotation.from_quat(log.quaternion, scalar_first=True).as_matrix() @ FLIP
    rpm = np.round(log.rotor_speeds[:, [3, 1, 0, 2]] * 30.0 / np.pi).astype(int)
    pose = {"float position": log.position @ FLIP}
    pose["float q"] = Rotation.from_matrix(turned).as_quat(scalar_first=True)
    speeds = {f"int32_t esc[{i}].esc_rpm": rpm[:, i] for i in range(4)}
    topics = {
        "vehicle_mocap_odometry": odometry(log.t) | pose,
        "esc_status": esc(log.t) | speeds,
    }
    path.write_bytes(ulog_bytes(topics))


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
