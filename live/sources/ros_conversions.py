"""Between messages of ROS 2 and this kit's: the types that are read are those of bags.

Written against the fields alone, so that messages of rclpy and of rosbags do alike.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...dynamics.rotation import matrix_of
from ...dynamics.vehicle import Vehicle
from ...identification.logs.log_map import LogMap
from ...identification.logs.readers.ros_messages import Fields, stamp
from ..field_map import FieldMap
from ..filtering import Output
from ..messages import Array, Malformed, Sample

WRENCH = "geometry_msgs/msg/WrenchStamped"
ACCELERATION = "geometry_msgs/msg/AccelWithCovarianceStamped"
_SECOND = 1_000_000_000  # ns


class TopicReader:
    """From a topic's messages to what they hold.

    Args:
        name: of the topic.
        kind: the type of its messages.
        log_map: of all topics.
        vehicle: that flies.
    """

    def __init__(self, name: str, kind: str, log_map: LogMap, vehicle: Vehicle) -> None:
        others = [n for n, part in log_map.sections.items() if part.topic != name]
        left_out: dict[str, Any] = dict.fromkeys(others)
        own = replace(log_map, **left_out)
        wanted = [column for part in own.sections.values() for column in part.named]
        self._name, self._numbers = name, Fields(name, kind, wanted)
        self._fields = FieldMap(own, vehicle, name)

    def sample(self, message: Any, arrival: int) -> Sample:
        """Return what a message holds.

        Raises:
            Malformed: that is nothing that a flight has.
        """
        try:
            columns = self._numbers.columns(np.array([self._numbers.take(message)]))
            fields: dict[str, Any] = {name: float(x[0]) for name, x in columns.items()}
            fields["stamp"] = stamp(message)
            found = self._fields.sample(self._name, fields, arrival)
        except (IndexError, ValueError, AttributeError, TypeError) as error:
            raise Malformed(str(error)) from error
        found.stamp = found.stamp or None
        if not found.parts:
            raise Malformed("nothing")
        return found


def wrench_message(types: Mapping[str, Any], output: Output, frame: str) -> Any:
    """Return the external force and torque, N and Nm in the world, as a WrenchStamped."""
    estimate = output.estimate
    return types[WRENCH](
        header=_header(types, output, frame),
        wrench=types["geometry_msgs/msg/Wrench"](
            force=_vector(types, estimate.force), torque=_vector(types, estimate.torque)
        ),
    )


def acceleration_message(
    types: Mapping[str, Any], output: Output, frame: str, vehicle: Vehicle
) -> Any:
    """Return the acceleration that the wrench alone gives the vehicle, with its covariance, as an
    AccelWithCovarianceStamped: ROS has no wrench with a covariance.

    Linear: force over mass, m/s2. Angular: ``R J^-1 R' torque``, rad/s2. Both in the world.
    """
    estimate = output.estimate
    R = matrix_of(estimate.quaternion)
    scale = np.zeros((6, 6))
    scale[:3, :3] = np.eye(3) / vehicle.mass
    scale[3:, 3:] = R @ np.linalg.inv(vehicle.inertia) @ R.T
    order = [15, 16, 17, 12, 13, 14]  # force, then torque, in the error state
    noise = estimate.covariance[np.ix_(order, order)]
    stated = noise + np.diag(output.std**2 - np.diag(noise))  # with the vehicle's own uncertainty
    covariance = scale @ stated @ scale.T
    values = scale @ np.concatenate([estimate.force, estimate.torque])
    accel = types["geometry_msgs/msg/Accel"](
        linear=_vector(types, values[:3]), angular=_vector(types, values[3:])
    )
    both = types["geometry_msgs/msg/AccelWithCovariance"](
        accel=accel, covariance=covariance.reshape(36)
    )
    return types[ACCELERATION](header=_header(types, output, frame), accel=both)


def _vector(types: Mapping[str, Any], values: Array) -> Any:
    x, y, z = (float(v) for v in values)
    return types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)


def _header(types: Mapping[str, Any], output: Output, frame: str) -> Any:
    ns = output.row.stamp
    if ns is None or ns < 0:
        ns = max(round(output.t * _SECOND), 0)
    time = types["builtin_interfaces/msg/Time"](sec=ns // _SECOND, nanosec=ns % _SECOND)
    return types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


# what is built of what
BUILT = (
    "builtin_interfaces/msg/Time",
    "std_msgs/msg/Header",
    "geometry_msgs/msg/Vector3",
    "geometry_msgs/msg/Wrench",
    "geometry_msgs/msg/Accel",
    "geometry_msgs/msg/AccelWithCovariance",
    WRENCH,
    ACCELERATION,
)
