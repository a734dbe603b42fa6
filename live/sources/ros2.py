"""Topics of ROS 2, where rclpy is there (it comes with a ROS 2 installation, not from PyPI).

``ros2:TOPICS.yaml`` names them as the map of a bag does (``identification.logs.readers.rosbag``);
``ros2:?pose=/vicon/drone&rotors=/motors`` does so on the command line (pose, rotors, command,
voltage, imu), for messages that state their units. Published are ``windwrench/wrench``
(geometry_msgs/WrenchStamped) and its twin with a covariance, ``windwrench/external_acceleration``
(geometry_msgs/AccelWithCovarianceStamped), in the frame ``?frame=world``.
"""

import importlib
import time
from collections.abc import Mapping
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...identification.logs.readers.ros_topics import SECTIONS, map_of
from ...identification.logs.readers.rosbag import given_map
from ...runtime.errors import InputError
from ..filtering import Output
from ..messages import Sample
from .base import Source
from .ros_conversions import (
    ACCELERATION,
    WRENCH,
    TopicReader,
    acceleration_message,
    wrench_message,
)

_SECTIONS = {  # of a map, by the options
    "pose": "position",
    "rotors": "rotors",
    "command": "commands",
    "voltage": "battery",
    "imu": "accelerometer",
}
_FOUND = 10.0  # s that topics are waited for
_AT_ONCE = 64  # messages taken before their estimates are out


class Ros2(Source):
    """Messages of topics."""

    kind, options, answers = "ros2", (*_SECTIONS, "frame"), True

    def _prepare(self) -> None:
        text, address = self.name, self.address
        self._frame = address.options.get("frame", "world")
        given: dict[str, Any] = dict(given_map(Path(address.path))) if address.path else {}
        given |= {
            section: {"topic": address.options[option]}
            for option, section in _SECTIONS.items()
            if option in address.options
        }
        self._topics: dict[str, str] = {}  # by section
        for section in SECTIONS:
            said = given.get(section)
            topic = said.get("topic") if isinstance(said, Mapping) else said
            if isinstance(topic, str):
                self._topics[section] = topic
        if "position" not in self._topics or not {"rotors", "commands"} & set(self._topics):
            raise InputError(
                f"{text}: expected topics of a pose and of rotors or command: ros2:TOPICS.yaml, or "
                "ros2:?pose=/vicon/drone&rotors=/motors"
            )
        if find_spec("rclpy") is None:
            raise InputError(
                f"{text}: rclpy is not there; expected a ROS 2 installation whose setup.bash was "
                "sourced in this shell (it is not on PyPI)"
            )
        topics = ", ".join(f"{topic} ({section})" for section, topic in self._topics.items())
        self.expected = f"messages on {topics}"
        self._given = given
        self._node: Any = None
        self._executor: Any = None
        self._rclpy: Any = None
        self._came: list[tuple[Any, int]] = []  # topics with their messages, and arrivals
        self._publishers: tuple[Any, Any] | None = None

    def open(self) -> None:
        """Make a node, and subscribe.

        Raises:
            InputError: a topic is not published, or its messages are of another kind.
        """
        self._rclpy = importlib.import_module("rclpy")
        executors: Any = importlib.import_module("rclpy.executors")
        qos: Any = importlib.import_module("rclpy.qos")
        get_message = importlib.import_module("rosidl_runtime_py.utilities").get_message
        self._rclpy.init()
        self._node = self._rclpy.create_node("windwrench_live")
        self._executor = executors.SingleThreadedExecutor()
        self._executor.add_node(self._node)
        kinds = self._kinds(set(self._topics.values()))
        log_map, _ = map_of(kinds, self._given, "ros2", "the map of topics")
        for topic, kind in kinds.items():
            read = TopicReader(topic, kind, log_map, self.vehicle)
            self._node.create_subscription(
                get_message(kind),
                topic,
                partial(self._take, read),
                qos.qos_profile_sensor_data,
            )
        self._type_of = cache(get_message)
        self._publishers = (
            self._node.create_publisher(get_message(WRENCH), "windwrench/wrench", 10),
            self._node.create_publisher(
                get_message(ACCELERATION), "windwrench/external_acceleration", 10
            ),
        )

    def _kinds(self, topics: set[str]) -> dict[str, str]:
        """Return the type of each topic, once all are published."""
        deadline = time.monotonic() + _FOUND
        while True:
            known = {name: kinds[0] for name, kinds in self._node.get_topic_names_and_types()}
            missing = sorted(topics - set(known))
            if not missing:
                return {name: known[name] for name in sorted(topics)}
            if time.monotonic() > deadline:
                raise InputError(
                    f"{self.name}: no topic {', '.join(missing)}; found "
                    f"{', '.join(sorted(known)) or 'none'}"
                )
            self._executor.spin_once(timeout_sec=0.1)

    def _take(self, topic: TopicReader, message: Any) -> None:
        self._came.append(((topic, message), time.monotonic_ns()))

    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return what has come."""
        if not self._rclpy.ok():
            return None
        self._came = []
        self._executor.spin_once(timeout_sec=timeout)
        for _ in range(_AT_ONCE):
            before = len(self._came)
            self._executor.spin_once(timeout_sec=0.0)
            if len(self._came) == before:
                break
        return self._came

    def decode(self, message: tuple[TopicReader, Any], arrival: int) -> Sample:
        """Return what a topic's message holds."""
        return message[0].sample(message[1], arrival)

    def send(self, output: Output) -> None:
        """Publish the wrench."""
        if self._publishers is None or not output.row.has_pose:
            return
        wrench, acceleration = self._publishers
        wrench.publish(wrench_message(self._type_of, output, self._frame))
        acceleration.publish(acceleration_message(self._type_of, output, self._frame, self.vehicle))

    def close(self) -> None:
        """Take the node down."""
        if self._node is not None:
            self._node.destroy_node()
            self._node, self._publishers = None, None
            if self._rclpy.ok():
                self._rclpy.shutdown()
