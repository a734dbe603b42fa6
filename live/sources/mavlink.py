"""MAVLink of PX4 and ArduPilot, by UDP or a serial port, read with pymavlink.

``mavlink:udp://HOST:PORT`` listens there, ``mavlink:udpout://HOST:PORT`` calls there,
``mavlink:/dev/ttyUSB0`` opens a port (``?baud=921600``). With ``?rate=100`` the autopilot is asked
for the messages at that rate, Hz.

**Pose**, the first of these that comes (``?pose=NAME`` chooses): ATT_POS_MOCAP,
VISION_POSITION_ESTIMATE, ODOMETRY (in NED or FRD), or LOCAL_POSITION_NED with the attitude of
ATTITUDE_QUATERNION, carried to its time by the body rates that come with it. The world is turned
from north, east, down to north, west, up, and the body from forward, right, down to forward, left,
up: both by half a turn about x, as in logs of PX4.

**Rotors**: ESC_STATUS, ESC_TELEMETRY_1_TO_4 (rpm), else commands: ACTUATOR_OUTPUT_STATUS or
SERVO_OUTPUT_RAW, which the vehicle's motor curve turns into thrust. Motors 1 to 4 are those of a
quad x, which PX4 and ArduPilot number alike.

**Sent back**, in north, east, down: DEBUG_FLOAT_ARRAY ``wrench`` for each pose (force, torque,
their standard deviations, NIS, status), and ten times a second what ground stations plot:
NAMED_VALUE_FLOAT ``force_n, force_e, force_d, torque_n, torque_e, torque_d``. Where the vehicle
declares a drag (rotor_drag), also WIND_COV: the steady wind whose drag the force would be.
"""

import importlib
import math
import os
import select
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...dynamics.vehicle import Vehicle
from ...estimator.estimate import STATUSES
from ...identification.logs.rotor_orders import ORDERS
from ...runtime.errors import InputError
from ...runtime.extras import need
from ..filtering import Output
from ..messages import Array, Sample
from ..tallies import Tallies
from .base import Address, read_address
from .datagrams import listen
from .esc_status import add_esc_status
from .wind import Wind

_HALF_TURN = np.array([1.0, -1.0, -1.0])
_TURNED = np.array([1.0, 1.0, -1.0, -1.0])  # of a quaternion
_ORDER = [motor - 1 for motor in ORDERS["px4-x"]]
_RPM = math.pi / 30.0  # rad/s
_Z_DOWN = (1, 20)  # MAV_FRAME_LOCAL_NED, MAV_FRAME_LOCAL_FRD
_GYRO, _ACCELEROMETER = 0b111000, 0b111  # bits of HIGHRES_IMU's fields_updated
_MISSING_CELL = 65_535  # mV
_WRAP = 2**32  # us, of SERVO_OUTPUT_RAW
_AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
_OURS = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
_POSES = ("ATT_POS_MOCAP", "VISION_POSITION_ESTIMATE", "ODOMETRY", "LOCAL_POSITION_NED")
_WANTED = (
    *_POSES,
    "ATTITUDE_QUATERNION",
    "HIGHRES_IMU",
    "ESC_STATUS",
    "ACTUATOR_OUTPUT_STATUS",
    "SERVO_OUTPUT_RAW",
    "BATTERY_STATUS",
)


@dataclass(frozen=True)
class MavlinkSettings:
    """What is taken for a pose, and how often things are sent."""

    # s that better poses are waited for once one comes: at 5 Hz and more each kind has come by then
    choosing: float = 0.5
    attitude_age: float = 0.1  # s over which an attitude is carried by its rates; it turns 1 rad
    norm: float = 0.02  # by which a quaternion's length may differ from 1
    heartbeat: float = 1.0  # s
    plotted: float = 0.1  # s between values for plots
    baud: int = 57_600  # of telemetry radios
    pulses: tuple[float, float] = (1000.0, 2000.0)  # us, where the motor curve states no range


class Mavlink:
    """Messages of an autopilot.

    Args:
        text: the address.
        vehicle: that flies.
        tallies: where messages are counted that are lost or say nothing.

    Raises:
        InputError: the address is none, or pymavlink is not installed.
    """

    paced = True

    def __init__(
        self,
        text: str,
        vehicle: Vehicle,
        tallies: Tallies,
        settings: MavlinkSettings | None = None,
    ) -> None:
        need("pymavlink", "mavlink")
        self._settings = settings or MavlinkSettings()
        self._address = read_address(text, "mavlink", ("baud", "rate", "pose"))
        self.name = text
        self._link = _make_link(self._address, self._settings)
        self._rate = self._address.number("rate", 0.0)
        self._forced = self._address.choice("pose", ("", *_POSES), "")
        self._vehicle, self._tallies = vehicle, tallies
        self._mav: Any = None
        self._wind = Wind(vehicle)
        self._pose = ""  # the kind that is read
        self._poses: dict[str, int] = {}  # kinds that have come, and when first, ns
        self._attitude: tuple[int, Array, Array] | None = None  # stamp, quaternion, rates
        self._sequences: dict[tuple[int, int], int] = {}
        self._seen: set[str] = set()
        self._servo_wraps, self._servo_last = 0, 0
        self._pulses_noted = False
        self._requested = False
        self._due_heartbeat = self._due_plot = 0  # ns
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

    def open(self) -> None:
        """Open the link."""
        dialect: Any = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
        self._link.open()
        self._mav = dialect.MAVLink(self._link, srcSystem=1, srcComponent=_OURS)
        self._mav.robust_parsing = True
        add_esc_status(dialect)
        self._dialect = dialect

    def receive(self, timeout: float) -> list[Sample] | None:
        """Return what the messages that are there hold."""
        now = time.monotonic_ns()
        if now >= self._due_heartbeat and self._link.connected:
            self._due_heartbeat = now + round(self._settings.heartbeat * 1e9)
            d = self._dialect
            self._mav.heartbeat_send(
                d.MAV_TYPE_ONBOARD_CONTROLLER, d.MAV_AUTOPILOT_INVALID, 0, 0, 0
            )
        data = self._link.read(timeout)
        arrival = time.monotonic_ns()
        samples = []
        for message in (self._mav.parse_buffer(data) if data else None) or []:
            sample = self._take(message, arrival)
            if sample is not None:
                samples.append(sample)
        return samples

    def _take(self, message: Any, arrival: int) -> Sample | None:
        kind = message.get_type()
        if kind == "BAD_DATA":
            self._tallies.counts["malformed"] += 1
            return None
        self._count(message)
        if message.get_srcComponent() == _OURS:
            return None
        self._seen.add(kind)
        if kind == "HEARTBEAT":
            self._request(message)
        reader = self._readers.get(kind)
        if reader is None:
            return None
        sample = reader(message, arrival)
        if sample is not None and not _finite(sample):
            self._tallies.counts["malformed"] += 1
            return None
        return sample

    def _count(self, message: Any) -> None:
        """Count what is missing in the sender's own count, which is a byte."""
        sender = (message.get_srcSystem(), message.get_srcComponent())
        sequence = int(message.get_seq())
        last = self._sequences.get(sender)
        missing = 0 if last is None else (sequence - last - 1) % 256
        if missing < 128:
            self._sequences[sender] = sequence
            if missing:
                self._tallies.counts["lost"] += missing
        elif missing != 255 and self._tallies.counts["lost"] > 0:
            self._tallies.counts["lost"] -= 1  # it was only late

    def _request(self, heartbeat: Any) -> None:
        """Ask the autopilot for the messages, once, at the rate that the user wants."""
        if not self._rate or self._requested or heartbeat.get_srcComponent() != _AUTOPILOT:
            return
        self._requested = True
        numbers = {m.msgname: number for number, m in self._dialect.mavlink_map.items()}
        for name in _WANTED:
            number = numbers[name]
            self._mav.command_long_send(
                heartbeat.get_srcSystem(),
                _AUTOPILOT,
                self._dialect.MAV_CMD_SET_MESSAGE_INTERVAL,
                0,
                number,
                1e6 / self._rate,
                0,
                0,
                0,
                0,
                0,
            )

    def _chosen(self, kind: str, arrival: int) -> bool:
        """Return whether poses of a kind are read: the best of those that come."""
        if self._forced:
            return kind == self._forced
        if self._pose:
            return kind == self._pose
        self._poses.setdefault(kind, arrival)
        if arrival - min(self._poses.values()) < self._settings.choosing * 1e9:
            return False
        self._pose = min(self._poses, key=_POSES.index)
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
        if abs(age) > self._settings.attitude_age:
            return None
        turn = Rotation.from_quat(quaternion, scalar_first=True) * Rotation.from_rotvec(rates * age)
        place = (m.x, m.y, m.z)
        turned = turn.as_quat(scalar_first=True)
        return self._posed("LOCAL_POSITION_NED", stamp, arrival, place, turned)

    def _take_attitude(self, m: Any, arrival: int) -> Sample | None:
        quaternion = np.array([m.q1, m.q2, m.q3, m.q4], dtype=np.float64)
        if abs(float(np.linalg.norm(quaternion)) - 1.0) <= self._settings.norm:
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
        if not abs(length - 1.0) <= self._settings.norm:
            self._tallies.counts["malformed"] += 1
            return None
        position = np.array(place, dtype=np.float64) * _HALF_TURN
        return Sample(kind, stamp, arrival, position=position, quaternion=turn * _TURNED / length)

    def _imu(self, m: Any, arrival: int) -> Sample | None:
        updated = int(m.fields_updated)
        gyro = np.array([m.xgyro, m.ygyro, m.zgyro], dtype=np.float64) * _HALF_TURN
        force = np.array([m.xacc, m.yacc, m.zacc], dtype=np.float64) * _HALF_TURN
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
        if stamp < self._servo_last - _WRAP // 2:
            self._servo_wraps += 1
        self._servo_last = stamp
        raw = _motors((m.servo1_raw, m.servo2_raw, m.servo3_raw, m.servo4_raw))
        stamp = 1000 * (stamp + self._servo_wraps * _WRAP)
        return self._commanded("SERVO_OUTPUT_RAW", stamp, arrival, raw)

    def _commanded(self, kind: str, stamp: int, arrival: int, raw: Array) -> Sample | None:
        """Return motor commands, 0 to 1 within the range that the motor curve states."""
        curve = self._vehicle.motor_curve
        low, high = (0.0, 1.0) if curve is None else curve.command
        if high <= 1.5 < float(np.max(raw)):
            low, high = self._settings.pulses
        command = np.clip((raw - low) / (high - low), 0.0, 1.0)
        return Sample(kind, stamp, arrival, command=command)

    def _battery(self, m: Any, arrival: int) -> Sample | None:
        cells = [v for v in m.voltages if 0 < v < _MISSING_CELL]
        if not cells or m.id != 0:
            return None
        return Sample("BATTERY_STATUS", None, arrival, voltage=1e-3 * sum(cells))

    def _system_status(self, m: Any, arrival: int) -> Sample | None:
        if not 0 < m.voltage_battery < _MISSING_CELL or "BATTERY_STATUS" in self._seen:
            return None
        return Sample("SYS_STATUS", None, arrival, voltage=1e-3 * m.voltage_battery)

    def send(self, output: Output) -> None:
        """Send the wrench back, in north, east, down."""
        if not self._link.connected or not output.row.has_pose:
            return
        force = output.estimate.force * _HALF_TURN
        torque = output.estimate.torque * _HALF_TURN
        status = float(STATUSES.index(output.estimate.status))
        microseconds = max(round(1e6 * output.t), 0)
        data = [*force, *torque, *output.std, output.estimate.nis, status]
        padded = [float(x) for x in data] + [0.0] * (58 - len(data))
        try:
            self._mav.debug_float_array_send(microseconds, b"wrench", 1, padded)
            now = time.monotonic_ns()
            if now < self._due_plot:
                return
            self._due_plot = now + round(self._settings.plotted * 1e9)
            milliseconds = (microseconds // 1000) % _WRAP
            for name, values in (("force", force), ("torque", torque)):
                for axis, value in zip("ned", values, strict=True):
                    self._mav.named_value_float_send(
                        milliseconds, f"{name}_{axis}".encode(), float(value)
                    )
            wind = self._wind.of(output)
            if wind is not None:
                velocity, std = wind[0] * _HALF_TURN, wind[1]
                horizontal = float(math.hypot(std[0], std[1]) / math.sqrt(2.0))
                self._mav.wind_cov_send(
                    microseconds,
                    *(float(x) for x in velocity),
                    horizontal,
                    float(std[2]),
                    float(output.estimate.position[2]),
                    horizontal,
                    float(std[2]),
                )
        except OSError:
            self._tallies.counts["not sent"] += 1

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def expected(self) -> str:
        """Return what must come."""
        came = f" (came: {', '.join(sorted(self._seen))})" if self._seen else ""
        return (
            f"a pose ({', '.join(_POSES)} with ATTITUDE_QUATERNION) and motors (ESC_STATUS, "
            f"ACTUATOR_OUTPUT_STATUS or SERVO_OUTPUT_RAW){came}; ?rate=100 asks the autopilot"
        )


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


class _Datagrams:
    """A link by UDP: listens, and answers whoever spoke last; or calls an address."""

    def __init__(self, text: str, host: str, port: int, calls: bool) -> None:
        self._text, self._host, self._port, self._calls = text, host, port, calls
        self._socket: socket.socket | None = None
        self._peer: Any = None

    @property
    def connected(self) -> bool:
        """Whether there is someone to send to."""
        return self._peer is not None

    def open(self) -> None:
        if not self._calls:
            self._socket = listen(self._text, self._host, self._port)
            return
        try:
            family, kind, protocol, _, self._peer = socket.getaddrinfo(
                self._host, self._port, type=socket.SOCK_DGRAM
            )[0]
        except OSError as error:
            raise InputError(f"{self._text}: {error.strerror or error}") from error
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)

    def read(self, timeout: float) -> bytes:
        assert self._socket is not None
        if not select.select([self._socket], [], [], timeout)[0]:
            return b""
        try:
            data, peer = self._socket.recvfrom(65_536)
        except (BlockingIOError, ConnectionError):
            return b""
        self._peer = self._peer if self._calls else peer
        return data

    def write(self, data: bytes) -> None:
        if self._socket is not None and self._peer is not None:
            self._socket.sendto(data, self._peer)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class _SerialPort:
    """A link by a serial port, opened with pyserial."""

    def __init__(self, text: str, path: str, baud: int) -> None:
        self._text, self._path, self._baud = text, path, baud
        self._port: Any = None

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port is not None

    def open(self) -> None:
        need("serial", "mavlink")
        serial: Any = importlib.import_module("serial")
        try:
            self._port = serial.Serial(self._path, self._baud, timeout=0, write_timeout=0)
        except (OSError, ValueError) as error:
            raise InputError(f"{self._text}: cannot be opened: {error}") from error

    def read(self, timeout: float) -> bytes:
        if not select.select([self._port], [], [], timeout)[0]:
            return b""
        try:
            return bytes(self._port.read(65_536))
        except OSError as error:
            raise InputError(f"{self._text}: the port went away: {error}") from error

    def write(self, data: bytes) -> None:
        try:
            self._port.write(data)
        except OSError:
            raise
        except Exception as error:  # pyserial's own: it does not take more now
            raise OSError(str(error)) from error

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None


def _make_link(address: Address, settings: MavlinkSettings) -> Any:
    if address.scheme in ("udp", "udpin", "udpout"):
        if address.port is None:
            raise InputError(f"{address.text}: no port; expected mavlink:udp://HOST:PORT")
        calls = address.scheme == "udpout"
        host = address.host or ("127.0.0.1" if calls else "0.0.0.0")
        return _Datagrams(address.text, host, address.port, calls)
    if address.scheme or not address.path:
        raise InputError(
            f"{address.text}: expected mavlink:udp://HOST:PORT, mavlink:udpout://HOST:PORT or a "
            "serial port such as mavlink:/dev/ttyUSB0"
        )
    if not os.path.exists(address.path):
        raise InputError(f"{address.text}: no such port {address.path}")
    return _SerialPort(
        address.text, address.path, int(address.number("baud", settings.baud, least=1.0))
    )
