"""What messages of an autopilot say, in this kit's frames and units."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.vehicle import Vehicle
from ...identification.logs.rotor_orders import ORDERS
from ..messages import Array, Sample
from ..tallies import Tallies
from .base import unwrapped

HALF_TURN = np.array([1.0, -1.0, -1.0])  # of a vector
_TURNED = np.array([1.0, 1.0, -1.0, -1.0])  # of a quaternion
_ORDER = [motor - 1 for motor in ORDERS["px4-x"]]
_RPM = math.pi / 30.0  # rad/s
_Z_DOWN = (1, 20)  # MAV_FRAME_LOCAL_NED, MAV_FRAME_LOCAL_FRD
_GYRO, _ACCELEROMETER = 0b111000, 0b111  # bits of HIGHRES_IMU's fields_updated
_MISSING_CELL = 65_535  # mV
WRAP = 2**32  # us, of SERVO_OUTPUT_RAW
POSES = ("ATT_POS_MOCAP", "VISION_POSITION_ESTIMATE", "ODOMETRY", "LOCAL_POSITION_NED")


# s that better poses are waited for once one comes: at 5 Hz and more each kind has come by then
_CHOOSING = 0.5
_ATTITUDE_AGE = 0.1  # s over which an attitude is carried by its rates; it turns 1 rad
_NORM_TOLERANCE = 0.02  # of a quaternion's length
_PULSES = 1000.0, 2000.0  # us, where the motor curve states no range


class MessageReader:
    """Makes samples of messages.

    Args:
        vehicle: that flies.
        tallies: where messages are counted that say nothing.
        forced: the message that is read for the pose; empty: the best that comes.
    """

    def __init__(self, vehicle: Vehicle, tallies: Tallies, forced: str) -> None:
        self._vehicle, self._tallies, self._forced = vehicle, tallies, forced
        self._pose = ""  # the kind that is read
        self._poses: dict[str, int] = {}  # kinds that have come, and when first, ns
        self._attitude: tuple[int, Array, Array] | None = None  # stamp, quaternion, rates
        self.seen: set[str] = set()  # kinds of messages
        self._servo_time: int | None = None  # us, of the newest
        self._readers: dict[str, Callable[[Any, int], Sample | None]] = {
            "ODOMETRY": self._odometry,
            "ATT_POS_MOCAP": self._mocap,
            "VISION_POSITION_ESTIMATE": self._vision,
            "LOCAL_POSITION_NED": self._local_position,
            "ATTITUDE_QUATERNION": self._take_attitude,
            "HIGHRES_IMU": self._imu,
            "ESC_STATUS": self._esc_status,
            "ESC_TELEMETRY_1_TO_4": self._esc_telemetry,
            "ACTUATOR_OUTPUT_STATUS": self._actuator_outputs,
            "SERVO_OUTPUT_RAW": self._servo_outputs,
            "BATTERY_STATUS": self._battery,
            "SYS_STATUS": self._system_status,
        }

    def read(self, message: Any, arrival: int) -> Sample | None:
        """Return what a message that arrived at ``arrival`` ns holds, or None."""
        kind = message.get_type()
        self.seen.add(kind)
        reader = self._readers.get(kind)
        if reader is None:
            return None
        sample = reader(message, arrival)
        if sample is not None and not _finite(sample):
            self._tallies.counts["malformed"] += 1
            return None
        return sample

    def _chosen(self, kind: str, arrival: int) -> bool:
        """Return whether poses of a kind are read: the best of those that come."""
        if self._forced:
            return kind == self._forced
        if self._pose:
            return kind == self._pose
        self._poses.setdefault(kind, arrival)
        if arrival - min(self._poses.values()) < _CHOOSING * 1e9:
            return False
        self._pose = min(self._poses, key=POSES.index)
        return kind == self._pose

    def _odometry(self, m: Any, arrival: int) -> Sample | None:
        if m.frame_id not in _Z_DOWN:
            self._tallies.counts["malformed"] += 1
            return None
        return self._posed("ODOMETRY", 1000 * m.time_usec, arrival, (m.x, m.y, m.z), m.q)

    def _mocap(self, m: Any, arrival: int) -> Sample | None:
        return self._posed("ATT_POS_MOCAP", 1000 * m.time_usec, arrival, (m.x, m.y, m.z), m.q)

    def _vision(self, m: Any, arrival: int) -> Sample | None:
        turn = Rotation.from_euler("ZYX", (m.yaw, m.pitch, m.roll))
        quaternion = turn.as_quat(scalar_first=True)
        place = (m.x, m.y, m.z)
        return self._posed("VISION_POSITION_ESTIMATE", 1000 * m.usec, arrival, place, quaternion)

    def _local_position(self, m: Any, arrival: int) -> Sample | None:
        stamp = 1_000_000 * m.time_boot_ms
        if self._attitude is None:
            return None
        at, quaternion, rates = self._attitude
        age = 1e-9 * (stamp - at)
        if abs(age) > _ATTITUDE_AGE:
            return None
        turn = Rotation.from_quat(quaternion, scalar_first=True) * Rotation.from_rotvec(rates * age)
        place = (m.x, m.y, m.z)
        turned = turn.as_quat(scalar_first=True)
        return self._posed("LOCAL_POSITION_NED", stamp, arrival, place, turned)

    def _take_attitude(self, m: Any, arrival: int) -> Sample | None:
        quaternion = np.array([m.q1, m.q2, m.q3, m.q4], dtype=np.float64)
        if abs(float(np.linalg.norm(quaternion)) - 1.0) <= _NORM_TOLERANCE:
            rates = np.array([m.rollspeed, m.pitchspeed, m.yawspeed], dtype=np.float64)
            self._attitude = 1_000_000 * m.time_boot_ms, quaternion, rates
        return None

    def _posed(
        self, kind: str, stamp: int, arrival: int, place: Any, quaternion: Any
    ) -> Sample | None:
        """Return a pose in this kit's frames, if its kind is read."""
        if not self._chosen(kind, arrival):
            return None
        turn = np.array(quaternion, dtype=np.float64)
        length = float(np.linalg.norm(turn))
        if not abs(length - 1.0) <= _NORM_TOLERANCE:
            self._tallies.counts["malformed"] += 1
            return None
        position = np.array(place, dtype=np.float64) * HALF_TURN
        return Sample(kind, stamp, arrival, position=position, quaternion=turn * _TURNED / length)

    def _imu(self, m: Any, arrival: int) -> Sample | None:
        updated = int(m.fields_updated)
        gyro = np.array([m.xgyro, m.ygyro, m.zgyro], dtype=np.float64) * HALF_TURN
        force = np.array([m.xacc, m.yacc, m.zacc], dtype=np.float64) * HALF_TURN
        return Sample(
            "HIGHRES_IMU",
            1000 * m.time_usec,
            arrival,
            gyro=gyro if updated & _GYRO else None,
            accelerometer=force if updated & _ACCELEROMETER else None,
        )

    def _esc_status(self, m: Any, arrival: int) -> Sample | None:
        if m.index != 0 or not any(m.rpm):
            return None
        return Sample("ESC_STATUS", 1000 * m.time_usec, arrival, rotor_speeds=_motors(m.rpm) * _RPM)

    def _esc_telemetry(self, m: Any, arrival: int) -> Sample | None:
        if not any(m.rpm):
            return None
        return Sample("ESC_TELEMETRY_1_TO_4", None, arrival, rotor_speeds=_motors(m.rpm) * _RPM)

    def _actuator_outputs(self, m: Any, arrival: int) -> Sample | None:
        raw = _motors(m.actuator)
        return self._commanded("ACTUATOR_OUTPUT_STATUS", 1000 * m.time_usec, arrival, raw)

    def _servo_outputs(self, m: Any, arrival: int) -> Sample | None:
        if m.port != 0:
            return None
        stamp = int(m.time_usec)
        self._servo_time = unwrapped(stamp, self._servo_time or stamp, WRAP)
        raw = _motors((m.servo1_raw, m.servo2_raw, m.servo3_raw, m.servo4_raw))
        return self._commanded("SERVO_OUTPUT_RAW", 1000 * self._servo_time, arrival, raw)

    def _commanded(self, kind: str, stamp: int, arrival: int, raw: Array) -> Sample | None:
        """Return motor commands, 0 to 1 within the range that the motor curve states."""
        curve = self._vehicle.motor_curve
        low, high = (0.0, 1.0) if curve is None else curve.command
        if high <= 1.5 < float(np.max(raw)):
            low, high = _PULSES
        command = np.clip((raw - low) / (high - low), 0.0, 1.0)
        return Sample(kind, stamp, arrival, command=command)

    def _battery(self, m: Any, arrival: int) -> Sample | None:
        cells = [v for v in m.voltages if 0 < v < _MISSING_CELL]
        if not cells or m.id != 0:
            return None
        return Sample("BATTERY_STATUS", None, arrival, voltage=1e-3 * sum(cells))

    def _system_status(self, m: Any, arrival: int) -> Sample | None:
        if not 0 < m.voltage_battery < _MISSING_CELL or "BATTERY_STATUS" in self.seen:
            return None
        return Sample("SYS_STATUS", None, arrival, voltage=1e-3 * m.voltage_battery)


def _motors(values: Any) -> Array:
    """Return what belongs to the kit's rotors of motors 1 to 4."""
    return np.abs(np.array([values[i] for i in _ORDER], dtype=np.float64))


def _finite(sample: Sample) -> bool:
    parts = (
        sample.position,
        sample.quaternion,
        sample.rotor_speeds,
        sample.command,
        sample.gyro,
        sample.accelerometer,
    )
    return all(part is None or bool(np.isfinite(part).all()) for part in parts)
