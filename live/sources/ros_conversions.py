"""Between messages of ROS 2 and this kit's: the types that are read are those of bags.

Written against the fields alone, so that messages of rclpy and of rosbags do alike.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...dynamics.rotation import matrix_of
from ...dynamics.vehicle import Vehicle
from ...identification.logs.log_map import LogMap
from ...identification.logs.readers.ros_topics import Fields, stamp
from ..field_map import FieldMap
from ..filtering import Output
from ..messages import SECOND, Array, Malformed, Sample

WRENCH = "geometry_msgs/msg/WrenchStamped"
ACCELERATION = "geometry_msgs/msg/AccelWithCovarianceStamped"
TypeOf = Callable[[str], Any]  # from a type's name to its class, such as ``get_message``


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
        if not found.measured:
            raise Malformed("nothing")
        return found


def wrench_message(of: TypeOf, output: Output, frame: str) -> Any:
    """Return the external force and torque, N and Nm in the world, as a WrenchStamped."""
    estimate = output.estimate
    return of(WRENCH)(
        header=_header(of, output, frame),
        wrench=of("geometry_msgs/msg/Wrench")(
            force=_vector(of, estimate.force), torque=_vector(of, estimate.torque)
        ),
    )


def acceleration_message(of: TypeOf, output: Output, frame: str, vehicle: Vehicle) -> Any:
    """Return the acceleration that the wrench alone gives the vehicle, with its covariance, as an
    AccelWithCovarianceStamped: ROS has no wrench with a covariance.

    Linear: force over mass, m/s2. Angular: ``R J^-1 R' torque``, rad/s2. Both in the world.
    """
    estimate = output.estimate
    R = matrix_of(estimate.quaternion)
    scale = np.zeros((6, 6))
    scale[:3, :3] = np.eye(3) / vehicle.mass
    scale[3:, 3:] = R @ np.linalg.inv(vehicle.inertia) @ R.T
    covariance = scale @ output.covariance @ scale.T
    values = scale @ output.wrench
    accel = of("geometry_msgs/msg/Accel")(
        linear=_vector(of, values[:3]), angular=_vector(of, values[3:])
    )
    both = of("geometry_msgs/msg/AccelWithCovariance")(
        accel=accel, covariance=covariance.reshape(36)
    )
    return of(ACCELERATION)(header=_header(of, output, frame), accel=both)


def _vector(of: TypeOf, values: Array) -> Any:
    x, y, z = (float(v) for v in values)
    return of("geometry_msgs/msg/Vector3")(x=x, y=y, z=z)


def _header(of: TypeOf, output: Output, frame: str) -> Any:
    ns = output.row.stamp
    if ns is None or ns < 0:
        ns = max(round(output.t * SECOND), 0)
    time = of("builtin_interfaces/msg/Time")(sec=ns // SECOND, nanosec=ns % SECOND)
    return of("std_msgs/msg/Header")(stamp=time, frame_id=frame)
