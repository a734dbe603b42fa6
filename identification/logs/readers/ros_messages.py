"""What messages of ROS hold, in the kit's units: which types carry a pose, rotor speeds, motor
commands, a voltage or an inertial sensor, and how each is read.

Types of PX4, MAVROS and of simulators are defined here, since rosbags knows those of ROS alone; of
a type that changed over the years there is a list, newest first.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPEED_UNITS = {"rad/s": 1.0, "rpm": 2.0 * math.pi / 60.0, "rev/s": 2.0 * math.pi}
COMMAND_UNITS = ("normalized", "us")  # 0 to 1; pulses in microseconds
PULSES = (1000.0, 2000.0)  # us, of the commands 0 and 1 where nothing else is said

_HEADER = "std_msgs/Header header\n"
# of PX4: the fields of a VehicleOdometry since 1.14, of 1.12 and 1.13, and before
_ODOMETRY = (
    "uint64 timestamp\nuint64 timestamp_sample\nuint8 pose_frame\nfloat32[3] position\n"
    "float32[4] q\nuint8 velocity_frame\nfloat32[3] velocity\nfloat32[3] angular_velocity\n"
    "float32[3] position_variance\nfloat32[3] orientation_variance\nfloat32[3] velocity_variance\n"
    "uint8 reset_counter\nint8 quality\n",
    "uint64 timestamp\nuint64 timestamp_sample\nuint8 local_frame\n"
    "float32 x\nfloat32 y\nfloat32 z\nfloat32[4] q\nfloat32[4] q_offset\n"
    "float32[21] pose_covariance\nuint8 velocity_frame\n"
    "float32 vx\nfloat32 vy\nfloat32 vz\nfloat32 rollspeed\nfloat32 pitchspeed\nfloat32 yawspeed\n"
    "float32[21] velocity_covariance\nuint8 reset_counter\n",
    "uint64 timestamp\nuint8 local_frame\nfloat32 x\nfloat32 y\nfloat32 z\n"
    "float32[4] q\nfloat32[4] q_offset\nfloat32[21] pose_covariance\n"
    "float32 vx\nfloat32 vy\nfloat32 vz\nfloat32 rollspeed\nfloat32 pitchspeed\nfloat32 yawspeed\n"
    "float32[21] velocity_covariance\n",
)
_ESC_REPORT = (
    "uint64 timestamp\nuint32 esc_errorcount\nint32 esc_rpm\nfloat32 esc_voltage\n"
    "float32 esc_current\nfloat32 esc_temperature\nuint8 esc_address\nuint8 esc_cmdcount\n"
    "uint8 esc_state\nuint8 actuator_function\nuint16 failures\nint8 esc_power\n",
    "uint64 timestamp\nuint32 esc_errorcount\nint32 esc_rpm\nfloat32 esc_voltage\n"
    "float32 esc_current\nuint8 esc_temperature\nuint8 esc_address\nuint8 esc_cmdcount\n"
    "uint8 esc_state\nuint8 actuator_function\nuint16 failures\nint8 esc_power\n",
)
_DEFINITIONS: dict[str, tuple[str, ...]] = {
    "mav_msgs/msg/Actuators": (
        _HEADER + "float64[] angles\nfloat64[] angular_velocities\nfloat64[] normalized\n",
    ),
    "actuator_msgs/msg/Actuators": (
        _HEADER + "float64[] position\nfloat64[] velocity\nfloat64[] normalized\n",
    ),
    "mavros_msgs/msg/ESCStatusItem": (_HEADER + "int32 rpm\nfloat32 voltage\nfloat32 current\n",),
    "mavros_msgs/msg/ESCStatus": (_HEADER + "mavros_msgs/ESCStatusItem[] esc_status\n",),
    "mavros_msgs/msg/RCOut": (_HEADER + "uint16[] channels\n",),
    "px4_msgs/msg/VehicleOdometry": _ODOMETRY,
    "px4_msgs/msg/EscReport": _ESC_REPORT,
    "px4_msgs/msg/EscStatus": (
        "uint64 timestamp\nuint16 counter\nuint8 esc_count\nuint8 esc_connectiontype\n"
        "uint8 esc_online_flags\nuint8 esc_armed_flags\npx4_msgs/EscReport[8] esc\n",
        "uint64 timestamp\nuint16 counter\nuint8 esc_count\nuint8 esc_connectiontype\n"
        "uint8 esc_online_flags\npx4_msgs/EscReport[8] esc\n",
    ),
    "px4_msgs/msg/ActuatorMotors": (
        "uint64 timestamp\nuint64 timestamp_sample\nuint16 reversible_flags\nfloat32[12] control\n",
    ),
    "px4_msgs/msg/SensorCombined": (
        "uint64 timestamp\nfloat32[3] gyro_rad\nuint32 gyro_integral_dt\n"
        "int32 accelerometer_timestamp_relative\nfloat32[3] accelerometer_m_s2\n"
        "uint32 accelerometer_integral_dt\nuint8 accelerometer_clipping\nuint8 gyro_clipping\n"
        "uint8 accel_calibration_count\nuint8 gyro_calibration_count\n",
        "uint64 timestamp\nfloat32[3] gyro_rad\nuint32 gyro_integral_dt\n"
        "int32 accelerometer_timestamp_relative\nfloat32[3] accelerometer_m_s2\n"
        "uint32 accelerometer_integral_dt\nuint8 accelerometer_clipping\n",
    ),
}
VARIANTS = max(len(texts) for texts in _DEFINITIONS.values())

ARRAYS = tuple(
    f"std_msgs/msg/{kind}MultiArray"
    for kind in (
        "Float32",
        "Float64",
        "Int16",
        "Int32",
        "Int64",
        "UInt8",
        "UInt16",
        "UInt32",
        "UInt64",
    )
)


@dataclass(frozen=True)
class Kind:
    """How one part is read from messages of one type."""

    values: Callable[[Any], Any]  # what a message holds, in the message's own frame and unit
    frame: str = "flu"  # of a pose or an inertial sensor, unless the topic map says another
    unit: str = ""  # of rotor speeds or commands; nothing: the topic map must say it
    order: str = "windwrench"  # of rotors, unless the topic map says another
    range: tuple[float, float] = PULSES


def _pose(place: Any, turn: Any) -> list[float]:
    return [place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z]


def _odometry(message: Any) -> list[float]:
    if hasattr(message, "position"):
        known = message.pose_frame in (1, 2)  # 1 NED, 2 FRD: both have z down
        place = message.position
    else:
        known = message.local_frame in (0, 1)
        place = (message.x, message.y, message.z)
    return [*place, *message.q] if known else [math.nan] * 7


def _esc_rpm(message: Any) -> Array:
    """Return the rpm of motors 1 to 4, by the function that each ESC states where all do."""
    slots = [int(esc.actuator_function) - 101 for esc in message.esc]
    order = [slots.index(i) for i in range(4)] if set(range(4)) <= set(slots) else list(range(4))
    return np.array([message.esc[i].esc_rpm for i in order], dtype=np.float64)


def _imu(message: Any) -> list[float]:
    force, turn = message.linear_acceleration, message.angular_velocity
    return [force.x, force.y, force.z, turn.x, turn.y, turn.z]


POSES: Mapping[str, Kind] = {
    "geometry_msgs/msg/PoseStamped": Kind(lambda m: _pose(m.pose.position, m.pose.orientation)),
    "geometry_msgs/msg/TransformStamped": Kind(
        lambda m: _pose(m.transform.translation, m.transform.rotation)
    ),
    "nav_msgs/msg/Odometry": Kind(lambda m: _pose(m.pose.pose.position, m.pose.pose.orientation)),
    "px4_msgs/msg/VehicleOdometry": Kind(_odometry, frame="ned"),
}
ROTORS: Mapping[str, Kind] = {
    "mav_msgs/msg/Actuators": Kind(lambda m: m.angular_velocities, unit="rad/s"),
    "px4_msgs/msg/EscStatus": Kind(_esc_rpm, unit="rpm", order="px4-x"),
    "mavros_msgs/msg/ESCStatus": Kind(
        lambda m: [item.rpm for item in m.esc_status], unit="rpm", order="px4-x"
    ),
    "actuator_msgs/msg/Actuators": Kind(lambda m: m.velocity, unit="rad/s"),
    **{name: Kind(lambda m: m.data) for name in ARRAYS},
}
COMMANDS: Mapping[str, Kind] = {
    "px4_msgs/msg/ActuatorMotors": Kind(lambda m: m.control, unit="normalized", order="px4-x"),
    "mavros_msgs/msg/RCOut": Kind(lambda m: m.channels, unit="us", order="px4-x"),
    "actuator_msgs/msg/Actuators": Kind(lambda m: m.normalized, unit="normalized"),
    **{name: Kind(lambda m: m.data) for name in ARRAYS},
}
VOLTAGES: Mapping[str, Kind] = {"sensor_msgs/msg/BatteryState": Kind(lambda m: [m.voltage])}
IMUS: Mapping[str, Kind] = {
    "sensor_msgs/msg/Imu": Kind(_imu),
    "px4_msgs/msg/SensorCombined": Kind(
        lambda m: [*m.accelerometer_m_s2, *m.gyro_rad], frame="ned"
    ),
}
PARTS: Mapping[str, Mapping[str, Kind]] = {
    "pose": POSES,
    "rotors": ROTORS,
    "command": COMMANDS,
    "voltage": VOLTAGES,
    "imu": IMUS,
}


def definitions(variant: int) -> dict[str, str]:
    """Return the definitions of the types that rosbags does not know; ``variant`` 0 has the newest
    of each.
    """
    return {name: texts[min(variant, len(texts) - 1)] for name, texts in _DEFINITIONS.items()}


def stamp(message: Any) -> int:
    """Return when a message's sample was taken, in ns of whatever clock its sender has; 0: it does
    not say.
    """
    header = getattr(message, "header", None)
    if header is not None:
        return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)
    microseconds = getattr(message, "timestamp_sample", 0) or getattr(message, "timestamp", 0)
    return 1000 * int(microseconds) if int(microseconds) < 2**63 // 1000 else 0
