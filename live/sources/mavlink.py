"""MAVLink of PX4 and ArduPilot, by UDP or a serial port, read with pymavlink.

``mavlink:udp://HOST:PORT`` listens there (without a host, to this machine alone).
``mavlink:udpout://HOST:PORT`` calls there. ``mavlink:/dev/ttyUSB0`` opens a port
(``?baud=921600``). ``?rate=100`` asks the autopilot for the messages at 100 Hz.

**Pose**, the first of these messages (``?pose=NAME`` chooses): ATT_POS_MOCAP,
VISION_POSITION_ESTIMATE, ODOMETRY (in NED or FRD), or LOCAL_POSITION_NED. The last takes its
attitude from ATTITUDE_QUATERNION, carried to the position's time by that message's body rates. The
world is turned from north, east, down to north, west, up, and the body from forward, right, down to
forward, left, up: both by half a turn about x, as in logs of PX4.

**Rotors**: ESC_STATUS, ESC_TELEMETRY_1_TO_4 (rpm), else commands: ACTUATOR_OUTPUT_STATUS or
SERVO_OUTPUT_RAW, turned into thrust by the vehicle's motor curve. PX4 and ArduPilot number motors 1
to 4 of a quad x alike.

**Sent back**, in north, east, down: DEBUG_FLOAT_ARRAY ``wrench`` for each pose (force, torque,
their standard deviations, NIS, status). Ten times a second NAMED_VALUE_FLOAT ``force_n, force_e,
force_d, torque_n, torque_e, torque_d`` follow, for plots of ground stations. A vehicle with a
declared drag (rotor_drag) also gets WIND_COV: the steady wind whose drag equals the force.
"""

import importlib
import time
from typing import Any

from ...runtime.extras import need
from ..filtering import Output
from ..messages import SECOND, Malformed, Measurement
from .base import Source
from .esc_status import add_esc_status
from .links import make_link, sender_name
from .mavlink_answer import send_wrench
from .mavlink_messages import POSES, MessageReader
from .senders import Senders

_AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
_OURS = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
_PLOTTED = 100_000_000  # ns, between values for plots
_WANTED = (
    *POSES,
    "ATTITUDE_QUATERNION",
    "HIGHRES_IMU",
    "ESC_STATUS",
    "ESC_TELEMETRY_1_TO_4",
    "ACTUATOR_OUTPUT_STATUS",
    "SERVO_OUTPUT_RAW",
    "BATTERY_STATUS",
)


class Mavlink(Source):
    """Messages of an autopilot."""

    kind = "mavlink"
    options = ("baud", "rate", "pose")
    answers = True

    def _prepare(self) -> None:
        need("pymavlink", "mavlink")
        self.link = make_link(self.address)
        self._rate = self.address.number("rate", 0.0)
        self._reader = MessageReader(self.vehicle, self.address.choice("pose", ("", *POSES)))
        self._senders = Senders(self.name, self.tallies)
        self._mav: Any = None
        self._requested = False
        self._due_heartbeat = self._due_plot = 0  # ns

    def open(self) -> None:
        """Open the link."""
        dialect: Any = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
        super().open()
        self._mav = dialect.MAVLink(self.link, srcSystem=1, srcComponent=_OURS)
        self._mav.robust_parsing = True
        add_esc_status(dialect)
        self._dialect = dialect

    def read(self, timeout: float) -> list[tuple[Any, int]] | None:
        """Return the messages so far."""
        now = time.monotonic_ns()
        if now >= self._due_heartbeat and self.link.peer is not None:
            self._due_heartbeat = now + SECOND
            d = self._dialect
            self._mav.heartbeat_send(
                d.MAV_TYPE_ONBOARD_CONTROLLER, d.MAV_AUTOPILOT_INVALID, 0, 0, 0
            )
        data = self.unless_malformed(self.link.read, timeout)
        arrival = time.monotonic_ns()
        messages = self.unless_malformed(self._mav.parse_buffer, data) if data else None
        return [(message, arrival) for message in messages or ()]

    def decode(self, message: Any, arrival: int) -> Measurement | None:
        """Return the measurement in a message of the autopilot, or None."""
        kind = message.get_type()
        if kind == "BAD_DATA":
            raise Malformed("bytes that are no message")
        system = message.get_srcSystem()
        component = message.get_srcComponent()
        who = f"system {system} at {sender_name(self.link.sender)}"
        if not self._senders.leaves_out(who):
            self.count_lost((system, component), int(message.get_seq()), 256)
        if component == _OURS:
            return None
        alive = kind == "HEARTBEAT" and component == _AUTOPILOT
        if not (alive or self._reader.reads(kind)):
            return None
        if not self._senders.take(who, (kind,), arrival):
            return None
        self.link.answer(self.link.sender)
        if alive:
            self._request(message)
        sample = self._reader.read(message, arrival)
        if sample is not None:
            sample.anew = self._senders.changed()
        return sample

    def _request(self, heartbeat: Any) -> None:
        """Ask the autopilot once for the messages at the user's rate."""
        if not self._rate or self._requested:
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
                *[0] * 5,
            )

    def send(self, output: Output) -> None:
        """Send the wrench back, in north, east, down."""
        if self.link.peer is not None and output.row.has_pose:
            now = time.monotonic_ns()
            plotted = now >= self._due_plot
            self._due_plot = now + _PLOTTED if plotted else self._due_plot
            send_wrench(self._mav, output, self.vehicle, plotted)

    @property
    def expected(self) -> str:  # type: ignore[override]
        """The messages needed, and the kinds so far."""
        seen = self._reader.seen
        came = f" (came: {', '.join(sorted(seen))})" if seen else ""
        return (
            f"a pose ({', '.join(POSES)} with ATTITUDE_QUATERNION) and motors (ESC_STATUS, "
            f"ACTUATOR_OUTPUT_STATUS or SERVO_OUTPUT_RAW){came}; ?rate=100 asks the autopilot"
        )
