"""Topics of ROS 2 as lines of JSON: a pose, and rotor speeds in rad/s in this kit's order.

python examples/live_ros2.py /vicon/drone /motors | windwrench live - --vehicle my_drone.yaml
"""

import contextlib
import json
import sys

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64MultiArray


def _say(**fields):
    print(json.dumps(fields), flush=True)


def _pose(message):
    stamp, p, q = message.header.stamp, message.pose.position, message.pose.orientation
    _say(t=stamp.sec + 1e-9 * stamp.nanosec, px=p.x, py=p.y, pz=p.z, qw=q.w, qx=q.x, qy=q.y, qz=q.z)


def _rotors(message):  # without a stamp: measured at its arrival
    _say(**{f"omega{i}": float(speed) for i, speed in enumerate(message.data, 1)})


def main(pose="/vicon/drone", rotors="/motors"):
    """Print each message of two topics."""
    rclpy.init()
    node = rclpy.create_node("windwrench_live")
    node.create_subscription(PoseStamped, pose, _pose, qos_profile_sensor_data)
    node.create_subscription(Float64MultiArray, rotors, _rotors, qos_profile_sensor_data)
    rclpy.spin(node)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        main(*sys.argv[1:])
