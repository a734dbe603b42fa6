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
import time
from typing import Any

from ...dynamics.vehicle import Vehicle
from ...runtime.extras import need
from ..filtering import Output
from ..messages import Sample
from ..tallies import Tallies
from .base import read_address
from .esc_status import add_esc_status
from .mavlink_answer import WrenchSender
from .mavlink_links import make_link
from .mavlink_messages import POSES, MavlinkSettings, MessageReader

_AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
_OURS = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
_WANTED = (
    *POSES,
    "ATTITUDE_QUATERNION",
    "HIGHRES_IMU",
    "ESC_STATUS",
    "ACTUATOR_OUTPUT_STATUS",
    "SERVO_OUTPUT_RAW",
    "BATTERY_STATUS",
)


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
        self._link = make_link(self._address, self._settings.baud)
        self._rate = self._address.number("rate", 0.0)
        self._tallies = tallies
        self._reader = MessageReader(
            vehicle, tallies, self._settings, self._address.choice("pose", ("", *POSES), "")
        )
        self._sender = WrenchSender(vehicle, self._settings.plotted)
        self._mav: Any = None
        self._sequences: dict[tuple[int, int], int] = {}
        self._requested = False
        self._due_heartbeat = 0  # ns

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
        if kind == "HEARTBEAT":
            self._request(message)
        return self._reader.read(message, arrival)

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

    def send(self, output: Output) -> None:
        """Send the wrench back, in north, east, down."""
        if not self._link.connected or not output.row.has_pose:
            return
        try:
            self._sender.send(self._mav, output)
        except OSError:
            self._tallies.counts["not sent"] += 1

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def expected(self) -> str:
        """Return what must come."""
        seen = self._reader.seen
        came = f" (came: {', '.join(sorted(seen))})" if seen else ""
        return (
            f"a pose ({', '.join(POSES)} with ATTITUDE_QUATERNION) and motors (ESC_STATUS, "
            f"ACTUATOR_OUTPUT_STATUS or SERVO_OUTPUT_RAW){came}; ?rate=100 asks the autopilot"
        )
