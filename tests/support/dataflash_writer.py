"""A small writer of ArduPilot's DataFlash logs, after the format's description in its wiki, and
the flight of ``autopilot_flight`` as ArduPilot logs it.
"""

import struct

import numpy as np

from tests.support.autopilot_flight import FLIP, inertial, ned

_CODES = {"N": "16s", "c": "h", "L": "i", "C": "H"}  # letters other than those of ``struct``
_FACTORS = {"c": 100.0, "C": 100.0, "L": 1e7}


def dataflash(messages):
    """Return a log.

    Args:
        messages: of each type its name, the letters of its columns, and the columns, all of one
            length; they are written one type after the other.
    """
    out = [_format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    for number, (name, letters, columns) in enumerate(messages, 10):
        layout = "<" + "".join(_CODES.get(letter, letter) for letter in letters)
        length = 3 + struct.calcsize(layout)
        out.append(_format(number, length, name, letters, ",".join(columns)))
        for row in zip(*columns.values(), strict=True):
            values = [_stored(letter, value) for letter, value in zip(letters, row, strict=True)]
            out.append(bytes([0xA3, 0x95, number]) + struct.pack(layout, *values))
    return b"".join(out)


def dataflash_text(messages, first="ArduCopter V3.4"):
    """Return the same log as a ground station writes it as text."""
    lines = [first, "", "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    for number, (name, letters, columns) in enumerate(messages, 10):
        lines.append(f"FMT, {number}, 89, {name}, {letters}, {','.join(columns)}")
        for row in zip(*columns.values(), strict=True):
            values = [x.decode() if isinstance(x, bytes) else f"{x:.12g}" for x in row]
            lines.append(", ".join([name, *values]))
    return "\r\n".join(lines)


def _stored(letter, value):
    if isinstance(value, bytes) or letter == "f":
        return value
    return round(value * _FACTORS.get(letter, 1.0))


def _format(number, length, name, letters, columns):
    packed = struct.pack(
        "<BB4s16s64s", number, length, name.encode(), letters.encode(), columns.encode()
    )
    return b"\xa3\x95\x80" + packed


PARAMETERS = {
    "FRAME_CLASS": 1.0,
    "FRAME_TYPE": 1.0,
    "MOT_PWM_MIN": 1100.0,
    "MOT_PWM_MAX": 1900.0,
    "MOT_THST_EXPO": 0.5,
    "MOT_SPIN_MIN": 0.1,
    "MOT_SPIN_MAX": 0.9,
    "SERVO9_FUNCTION": 33.0,
    "SERVO10_FUNCTION": 34.0,
    "SERVO11_FUNCTION": 35.0,
    "SERVO12_FUNCTION": 36.0,
}
COMMAND = np.array([0.50, 0.52, 0.54, 0.56])  # ours: front-left, rear-left, rear-right, front-right


def micro(t):
    return 1e6 * t


def xkf1(t):
    position, _ = ned(t)
    angles = {name: np.zeros(len(t)) for name in ("Roll", "Pitch", "Yaw")}
    places = {name: position[:, i] for i, name in enumerate(("PN", "PE", "PD"))}
    return "XKF1", "QBcccfff", {"TimeUS": micro(t), "C": np.zeros(len(t)), **angles, **places}


def xkq(t):
    q = ned(t)[1].as_quat(scalar_first=True)
    return (
        "XKQ",
        "QBffff",
        {
            "TimeUS": micro(t),
            "C": np.zeros(len(t)),
            **{f"Q{i + 1}": q[:, i] for i in range(4)},
        },
    )


def att(t):
    yaw, pitch, roll = ned(t)[1].as_euler("ZYX", degrees=True).T
    angles = {"Roll": roll, "Pitch": pitch, "Yaw": yaw % 360.0}
    return "ATT", "QccC", {"TimeUS": micro(t), **angles}


def imu(t):
    gyro, force = inertial(t)
    columns = {f"Gyr{a}": (gyro @ FLIP)[:, i] for i, a in enumerate("XYZ")}
    columns |= {f"Acc{a}": (force @ FLIP)[:, i] for i, a in enumerate("XYZ")}
    return "IMU", "QBffffff", {"TimeUS": micro(t), "I": np.zeros(len(t)), **columns}


def rcou(t, channels=(9, 10, 11, 12)):
    pulses = {f"C{i}": np.zeros(len(t)) for i in range(1, 15)}
    for channel, u in zip(channels, COMMAND[[3, 1, 0, 2]], strict=True):
        pulses[f"C{channel}"] = np.full(len(t), 1100.0 + 800.0 * u)
    return "RCOU", "Q" + "H" * 14, {"TimeUS": micro(t), **pulses}


def parm(**changes):
    values = {k: v for k, v in (PARAMETERS | changes).items() if v is not None}
    return (
        "PARM",
        "QNf",
        {
            "TimeUS": [1.0] * len(values),
            "Name": [name.encode() for name in values],
            "Value": list(values.values()),
        },
    )
