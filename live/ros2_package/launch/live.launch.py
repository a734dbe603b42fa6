"""Runs windwrench live on topics.

ros2 launch windwrench_live live.launch.py topics:=topics.yaml vehicle:=my_drone.yaml
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration


def generate_launch_description():
    """Return the one process, and its arguments."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("topics", description="map of topics, a YAML file"),
            DeclareLaunchArgument("vehicle", description="preset, or a YAML file"),
            DeclareLaunchArgument("record", default_value="flight.csv", description="new log"),
            ExecuteProcess(
                cmd=[
                    "windwrench",
                    "live",
                    ["ros2:", LaunchConfiguration("topics")],
                    "--vehicle",
                    LaunchConfiguration("vehicle"),
                    "--record",
                    LaunchConfiguration("record"),
                    "--quiet",
                ],
                output="screen",
            ),
        ]
    )
