"""Measurements in an autopilot's messages, in this kit's frames and units."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.vehicle import Vehicle
from ...identification.logs.what_flew import ORDERS
from ...runtime.arrays import Array
from ..messages import Malformed, Measurement, normalised
from .base import unwrapped

HALF_TURN = np.array([1.0, -1.0, -1.0])  # turns a vector
_ORDER = [motor - 1 for motor in ORDERS["px4-x"]]
_LARGEST_SHARE = 1.5  # largest command in shares of full; larger ones are pulses
_RPM = math.pi / 30.0  # rad/s
_Z_DOWN = (1, 20)  # MAV_FRAME_LOCAL_NED, MAV_FRAME_LOCAL_FRD
_GYRO = 0b111000  # bits of HIGHRES_IMU's fields_updated
_ACCELEROMETER = 0b111
_MISSING_CELL = 65_535  # mV
WRAP = 2**32  # us, of SERVO_OUTPUT_RAW
POSES = ("ATT_POS_MOCAP", "VISION_POSITION_ESTIMATE", "ODOMETRY", "LOCAL_POSITION_NED")
# s after the first pose until the best kind is chosen: at 5 Hz each kind has come by then
_CHOOSING = 0.5
_ATTITUDE_AGE = 0.1  # s, longest prediction of an attitude by its rates: 1 rad at most
_PULSES = 1000.0, 2000.0  # us, default range
_STAMPS = (("time_usec", 1_000), ("usec", 1_000), ("time_boot_ms", 1_000_000))  # fields, their ns


class MessageReader:
    """Makes samples of messages.

    Args:
        vehicle: the vehicle in flight.
        forced: the message for the pose; empty: the best kind.
    """

    def __init__(self, vehicle: Vehicle, forced: str) -> None:
        self._vehicle = vehicle
        self._forced = forced
        self._poses: dict[str, int] = {}  # kinds so far, and their first arrivals, ns
        self._attitude: tuple[int, Array, Array] | None = None  # stamp, quaternion, rates
        self.seen: set[str] = set()  # kinds of messages
        self._servo_time: int | None = None  # us, the newest
        # each fills a measurement from a message, and returns whether to use the measurement
        self._readers: dict[str, Callable[[Any, Measurement], bool]] = {
            "ODOMETRY": self._odometry,
            "ATT_POS_MOCAP": lambda m, sample: self._pose(m, sample, m.q),
            "VISION_POSITION_ESTIMATE": self._vision,
            "LOCAL_POSITION_NED": self._local_position,
            "ATTITUDE_QUATERNION": self._take_attitude,
            "HIGHRES_IMU": self._imu,
            "ESC_STATUS": self._rpm,
            "ESC_TELEMETRY_1_TO_4": self._rpm,
            "ACTUATOR_OUTPUT_STATUS": lambda m, sample: self._command(sample, m.actuator),
            "SERVO_OUTPUT_RAW": self._servo_outputs,
            "BATTERY_STATUS": self._battery,
            "SYS_STATUS": self._system_status,
        }

    def reads(self, kind: str) -> bool:
        """Return whether messages of a kind are read; note the kind."""
        self.seen.add(kind)
        return kind in self._readers

    def read(self, message: Any, arrival: int) -> Measurement | None:
        """Return the measurement in a message with its ``arrival``, ns, or None.

        Raises:
            Malformed: there is none to read.
        """
        kind = message.get_type()
        reader = self._readers.get(kind)
        if reader is None:
            return None
        stamps = [ns * getattr(message, name) for name, ns in _STAMPS if hasattr(message, name)]
        sample = Measurement(kind, stamps[0] if stamps else None, arrival)
        if not reader(message, sample):
            return None
        if not all(np.isfinite(part).all() for part in sample.measured.values()):
            raise Malformed("a number that is not finite")
        return sample

    def _chosen(self, kind: str, arrival: int) -> bool:
        """Return whether poses of a kind are read: the best kind so far."""
        if not self._forced:
            self._poses.setdefault(kind, arrival)
            if arrival - min(self._poses.values()) < _CHOOSING * 1e9:
                return False
            self._forced = min(self._poses, key=POSES.index)
        return kind == self._forced

    def _pose(self, m: Any, sample: Measurement, quaternion: Any) -> bool:
        """Take a pose in north, east, down, if its kind is read."""
        if not self._chosen(sample.kind, sample.arrival):
            return False
        turn = normalised(quaternion)
        # world and body each turn about their own x axis: a quaternion's vector like a position
        sample.position = np.array([m.x, m.y, m.z]) * HALF_TURN
        sample.quaternion = turn * np.append(1.0, HALF_TURN)
        return True

    def _odometry(self, m: Any, sample: Measurement) -> bool:
        if m.frame_id not in _Z_DOWN:
            raise Malformed("an unknown frame")
        return self._pose(m, sample, m.q)

    def _vision(self, m: Any, sample: Measurement) -> bool:
        turn = Rotation.from_euler("ZYX", (m.yaw, m.pitch, m.roll))
        return self._pose(m, sample, turn.as_quat(scalar_first=True))

    def _local_position(self, m: Any, sample: Measurement) -> bool:
        if self._attitude is None or sample.stamp is None:
            return False
        at, quaternion, rates = self._attitude
        age = 1e-9 * (sample.stamp - at)
        if abs(age) > _ATTITUDE_AGE:
            return False
        turn = Rotation.from_quat(quaternion, scalar_first=True) * Rotation.from_rotvec(rates * age)
        return self._pose(m, sample, turn.as_quat(scalar_first=True))

    def _take_attitude(self, m: Any, sample: Measurement) -> bool:
        """Keep an attitude for positions without one."""
        quaternion = np.array([m.q1, m.q2, m.q3, m.q4])
        rates = np.array([m.rollspeed, m.pitchspeed, m.yawspeed])
        normalised(quaternion)
        if not np.isfinite(rates).all():
            raise Malformed("no body rates")
        if sample.stamp is not None:
            self._attitude = sample.stamp, quaternion, rates
        return False

    def _imu(self, m: Any, sample: Measurement) -> bool:
        if m.fields_updated & _GYRO:
            sample.gyro = np.array([m.xgyro, m.ygyro, m.zgyro]) * HALF_TURN
        if m.fields_updated & _ACCELEROMETER:
            sample.accelerometer = np.array([m.xacc, m.yacc, m.zacc]) * HALF_TURN
        return True

    def _rpm(self, m: Any, sample: Measurement) -> bool:
        if getattr(m, "index", 0) != 0 or not any(m.rpm):  # other ESCs, or none
            return False
        sample.rotor_speeds = _motors(m.rpm) * _RPM
        return True

    def _servo_outputs(self, m: Any, sample: Measurement) -> bool:
        if m.port != 0:
            return False
        self._servo_time = unwrapped(m.time_usec, self._servo_time or m.time_usec, WRAP)
        sample.stamp = 1000 * self._servo_time
        return self._command(sample, (m.servo1_raw, m.servo2_raw, m.servo3_raw, m.servo4_raw))

    def _command(self, sample: Measurement, values: Any) -> bool:
        raw = _motors(values)
        curve = self._vehicle.motor_curve
        low, high = (0.0, 1.0) if curve is None else curve.command
        if high <= _LARGEST_SHARE < np.max(raw):
            low, high = _PULSES
        sample.command = np.clip((raw - low) / (high - low), 0.0, 1.0)
        return True

    def _battery(self, m: Any, sample: Measurement) -> bool:
        cells = [v for v in m.voltages if 0 < v < _MISSING_CELL]
        sample.voltage = 1e-3 * sum(cells)
        return bool(cells) and m.id == 0

    def _system_status(self, m: Any, sample: Measurement) -> bool:
        sample.voltage = 1e-3 * m.voltage_battery
        return 0 < m.voltage_battery < _MISSING_CELL and "BATTERY_STATUS" not in self.seen


def _motors(values: Any) -> Array:
    """Return the values of motors 1 to 4 in the order of the kit's rotors."""
    return np.abs([values[i] for i in _ORDER])
