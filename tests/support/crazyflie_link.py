"""A link driver for cflib behind which a Crazyflie's firmware answers: the protocol of its table of
contents and of its log, without a radio.
"""

import queue
import struct

import numpy as np
from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.exceptions import WrongUriType
from cflib.utils.encoding import compress_quaternion

TYPES = {"uint8_t": 1, "uint16_t": 2, "uint32_t": 3, "float": 7, "FP16": 8}
PACKED = {1: "<B", 2: "<H", 3: "<L", 7: "<f", 8: "<e"}
PLAIN = (
    *((f"stateEstimate.{axis}", "float") for axis in "xyz"),
    ("stateEstimateZ.quat", "uint32_t"),
    *((f"motor.m{i}", "uint16_t") for i in range(1, 5)),
    ("pm.vbat", "float"),
    *((f"gyro.{axis}", "float") for axis in "xyz"),
    *((f"acc.{axis}", "float") for axis in "xyz"),
)
WITH_RPM = (*PLAIN, *((f"rpm.m{i}", "uint16_t") for i in range(1, 5)))
PARAM, MEM, LOG, PLATFORM, LINK = 0x02, 0x04, 0x05, 0x0D, 0x0F


class FakeLink(CRTPDriver):
    """Answers as a Crazyflie of protocol version 10 would."""

    variables = PLAIN
    opened: "list[FakeLink]" = []  # noqa: RUF012 - of the class: cflib makes the instances

    def connect(self, uri, radio_link_statistics_callback, link_error_callback):
        if not uri.startswith("fake://"):
            raise WrongUriType
        self.fail = link_error_callback
        self.answers = queue.Queue()
        self.sent = []  # (port, channel, data) of all that the client sent
        self.blocks = {}  # id: types fetched and variables
        self.started = {}  # id: period, 10 ms
        self.closed = False
        FakeLink.opened.append(self)

    def get_name(self):
        return "fake"

    def close(self):
        self.closed = True

    def receive_packet(self, wait=0):
        try:
            return self.answers.get(timeout=min(wait, 0.05) if wait > 0 else 0.05)
        except queue.Empty:
            return None

    def send_packet(self, pk):
        data = bytes(pk.data)
        self.sent.append((pk.port, pk.channel, data))
        self._answer(pk.port, pk.channel, data)

    def _say(self, port, channel, data):
        packet = CRTPPacket()
        packet.set_header(port, channel)
        packet.data = bytearray(data)
        self.answers.put(packet)

    def _answer(self, port, channel, data):
        if (port, channel) == (LINK, 1):
            self._say(port, channel, b"Bitcraze Crazyflie\0")
        elif (port, channel) == (LINK, 0):
            self._say(port, channel, data)
        elif (port, channel) == (PLATFORM, 1):
            self._say(port, channel, bytes((0, 10)))
        elif (port, channel) == (MEM, 0):
            self._say(port, channel, bytes((data[0], 0)))
        elif (port, channel) == (PARAM, 0):
            self._say(port, channel, struct.pack("<BHI", 3, 0, 0))
        elif (port, channel) == (LOG, 0):
            if data[0] == 3:
                self._say(port, channel, struct.pack("<BHI", 3, len(self.variables), 1))
            else:
                index = struct.unpack("<H", data[1:3])[0]
                name, kind = self.variables[index]
                text = name.replace(".", "\0") + "\0"
                self._say(port, channel, data[:3] + bytes((TYPES[kind],)) + text.encode())
        elif (port, channel) == (LOG, 1):
            if data[0] in (6, 7):
                block = self.blocks.setdefault(data[1], [])
                for i in range(2, len(data), 3):
                    fetched, index = struct.unpack("<BH", data[i : i + 3])
                    block.append((fetched & 0x0F, self.variables[index][0]))
            elif data[0] == 3:
                self.started[data[1]] = data[2]
            self._say(port, channel, bytes((data[0], data[1] if len(data) > 1 else 0, 0)))

    def log(self, milliseconds, values):
        """Send every block that was started, of one time."""
        for number in self.started:
            stamp = struct.pack("<I", milliseconds % 2**24)[:3]
            payload = b"".join(
                struct.pack(PACKED[kind], values[name]) for kind, name in self.blocks[number]
            )
            self._say(LOG, 2, bytes((number,)) + stamp + payload)


def values_of(flown, k):
    """What the firmware's variables hold in row ``k`` of a flight at its kit's rotor speeds."""
    x, y, z = flown["position"][k]
    w, qx, qy, qz = flown["quaternion"][k]
    # motors 1 front-right, 2 rear-right, 3 rear-left, 4 front-left
    motors = flown["rotor_speeds"][k][[3, 2, 1, 0]]
    values = {
        "stateEstimate.x": x,
        "stateEstimate.y": y,
        "stateEstimate.z": z,
        "stateEstimateZ.quat": int(compress_quaternion([qx, qy, qz, w])),
        "pm.vbat": 3.9,
    }
    for i in range(4):
        values[f"rpm.m{i + 1}"] = round(motors[i] * 30.0 / np.pi)
        values[f"motor.m{i + 1}"] = round(65535 * (motors[i] / 2600.0) ** 2)
    return values
