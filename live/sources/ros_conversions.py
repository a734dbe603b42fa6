"""Between messages of ROS 2 and this kit's: the types that are read are those of bags.

Written against the fields alone, so that messages of rclpy and of rosbags do alike.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...dynamics.rotation import matrix_of
from ...dynamics.vehicle import Vehicle
from ...identification.logs.readers.ros_messages import PARTS, SPEED_UNITS, Kind, stamp
from ...identification.logs.readers.streams import from_ned
from ...identification.logs.rotor_orders import ORDERS
from ...runtime.errors import InputError, unknown_name
from ..filtering import Output
from ..messages import Array, Sample

WRENCH = "geometry_msgs/msg/WrenchStamped"
ACCELERATION = "geometry_msgs/msg/AccelWithCovarianceStamped"
_SECOND = 1_000_000_000  # ns
_HALF_TURN = np.array([1.0, -1.0, -1.0])
_NORM_TOLERANCE = 0.02  # of a quaternion's length


@dataclass(frozen=True)
class Converter:
    """Reads messages of one topic."""

    part: str  # pose, rotors, command, voltage or imu
    topic: str
    kind: Kind
    frame: str  # flu or ned
    order: tuple[int, ...]  # elements, from 0, of rotors 1 to 4
    unit: float  # of rotor speeds, rad/s
    range: tuple[float, float]  # of commands

    def sample(self, message: Any, arrival: int) -> Sample | None:
        """Return what a message holds; None where that is nothing that a flight has."""
        found = Sample(self.topic, stamp(message) or None, arrival)
        try:
            values = np.array(self.kind.values(message), dtype=np.float64)
            if self.part == "pose":
                self._pose(found, values)
            elif self.part == "rotors":
                found.rotor_speeds = np.abs(values[list(self.order)]) * self.unit
            elif self.part == "command":
                low, high = self.range
                u = (np.nan_to_num(values[list(self.order)], nan=low) - low) / (high - low)
                found.command = np.clip(u, 0.0, 1.0)
            elif self.part == "voltage":
                found.voltage = float(values[0]) if values[0] > 0.0 else None
            else:
                turn = _HALF_TURN if self.frame == "ned" else np.ones(3)
                found.accelerometer, found.gyro = values[:3] * turn, values[3:6] * turn
            good = bool(np.isfinite(values[: 4 if self.part == "rotors" else None]).all())
        except (IndexError, ValueError, AttributeError, TypeError):
            return None
        empty = self.part == "voltage" and found.voltage is None
        return found if (good or self.part == "command") and not empty else None

    def _pose(self, found: Sample, values: Array) -> None:
        length = float(np.linalg.norm(values[3:7]))
        if not abs(length - 1.0) <= _NORM_TOLERANCE:
            raise ValueError
        found.position, found.quaternion = values[:3], values[3:7] / length
        if self.frame == "ned":
            found.position, found.quaternion = from_ned(found.position, found.quaternion)


def make_converter(part: str, topic: str, kind: str, setting: Mapping[str, Any]) -> Converter:
    """Return what reads a topic.

    Args:
        part: that it holds.
        topic: its name.
        kind: the type of its messages.
        setting: of it in the map of topics.

    Raises:
        InputError: messages of this type hold no such part, or need a unit that is not given.
    """
    if kind not in PARTS[part]:
        raise unknown_name("type", kind, PARTS[part], f"{topic}, for {part}")
    how = PARTS[part][kind]
    unit = setting.get("unit", how.unit)
    if part in ("rotors", "command") and not unit:
        expected = tuple(SPEED_UNITS) if part == "rotors" else ("normalized", "us")
        raise InputError(
            f"{topic}: {kind} does not say its unit; expected unit: one of {', '.join(expected)} "
            f"for {part} in the map of topics"
        )
    order = setting.get("order") or ORDERS[how.order]
    limits = setting.get("range") or (how.range if unit == "us" else (0.0, 1.0))
    return Converter(
        part,
        topic,
        how,
        setting.get("frame", how.frame),
        tuple(int(i) - 1 for i in order),
        SPEED_UNITS[unit] if part == "rotors" else 1.0,
        (float(limits[0]), float(limits[1])),
    )


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
    covariance = scale @ estimate.covariance[np.ix_(order, order)] @ scale.T
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
    seconds = math.floor(ns // _SECOND)
    time = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=ns % _SECOND)
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
