"""A small writer of ULog files, after the format's description in PX4's user guide, and the flight
of ``autopilot_flight`` as PX4 logs it.
"""

import struct

import numpy as np

from tests.support.autopilot_flight import FLIP, PX4, growth, inertial, ned

_TYPES = {"uint64_t": "Q", "float": "f", "uint8_t": "B", "int32_t": "i", "bool": "?"}


def ulog_bytes(topics, parameters=None):
    """Return a ULog.

    Args:
        topics: mapping from a topic's name (``name`` or ``name#instance``) to its fields
            ``{"type name": column}``; a column (N,), or (N, K) for an array; ``timestamp`` comes
            first. Fields named ``item[0].field`` and so on, one item after the other, become an
            array of a nested type.
        parameters: mapping from a parameter's name to its value, int or float.
    """
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]
    for name, fields in topics.items():
        if not name.endswith("#1"):
            out += _formats(name, fields)
    for name, value in (parameters or {}).items():
        kind, code = ("int32_t", "i") if isinstance(value, int) else ("float", "f")
        key = f"{kind} {name}".encode()
        out.append(_message("P", bytes([len(key)]) + key + struct.pack(f"<{code}", value)))
    for number, name in enumerate(topics):
        plain, _, instance = name.partition("#")
        out.append(_message("A", struct.pack("<BH", int(instance or 0), number) + plain.encode()))
    for number, fields in enumerate(topics.values()):
        codes = [_TYPES[key.split()[0]] for key in fields]
        for row in zip(*fields.values(), strict=True):
            data = b"".join(
                struct.pack(f"<{len(_flat(value))}{code}", *_flat(value))
                for code, value in zip(codes, row, strict=True)
            )
            out.append(_message("D", struct.pack("<H", number) + data))
    return b"".join(out)


def _message(kind, payload):
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def _formats(topic, fields):
    """Return the format messages of a topic, its nested type's among them."""
    plain = "".join(_declare(key, column) for key, column in fields.items() if "." not in key)
    nested = [key.split() for key in fields if "." in key]
    if not nested:
        return [_message("F", f"{topic}:{plain}".encode())]
    item = nested[0][1].partition("[")[0]
    first = "".join(
        f"{kind} {name.partition('.')[2]};"
        for kind, name in nested
        if name.startswith(f"{item}[0].")
    )
    count = len({name.partition(".")[0] for _, name in nested})
    return [
        _message("F", f"{topic}:{plain}{item}_report[{count}] {item};".encode()),
        _message("F", f"{item}_report:{first}".encode()),
    ]


def _declare(key, column):
    kind, name = key.split()
    width = getattr(column[0], "shape", ())
    return f"{kind}[{width[0]}] {name};" if width else f"{kind} {name};"


def _flat(value):
    return np.ravel(value).tolist()


def stamps(t):
    return np.round(1e6 * (t + 10.0)).astype(np.uint64)


def by_axis(position):
    """Return positions (N, 3) as the fields x, y and z."""
    return dict(zip(("float x", "float y", "float z"), position.T, strict=True))


def odometry(t, new=True):
    position, turn = ned(t)
    head = {"uint64_t timestamp": stamps(t + 0.02), "uint64_t timestamp_sample": stamps(t)}
    if new:
        return head | {
            "uint8_t pose_frame": np.full(len(t), 2),
            "float position": position,
            "float q": turn.as_quat(scalar_first=True),
        }
    head |= {"uint8_t local_frame": np.full(len(t), 0), "float q": turn.as_quat(scalar_first=True)}
    return head | by_axis(position)


def esc(t, speeds=PX4, **functions):
    rpm = np.multiply.outer(growth(t), speeds) * 30.0 / np.pi
    fields = {"uint64_t timestamp": stamps(t)}
    for i in range(4):
        fields[f"int32_t esc[{i}].esc_rpm"] = np.round(rpm[:, i]).astype(int)
        if functions:
            fields[f"uint8_t esc[{i}].actuator_function"] = np.full(len(t), functions[f"f{i}"])
    return fields


def sensor_combined(t):
    gyro, force = inertial(t)
    return {
        "uint64_t timestamp": stamps(t),
        "float gyro_rad": gyro @ FLIP,
        "float accelerometer_m_s2": force @ FLIP,
    }


def control(t, values):
    """Return actuator_motors: relative thrusts (N, K)."""
    return {"uint64_t timestamp": stamps(t), "float control": values}


def battery(t, volts):
    """Return battery_status: voltages (N,)."""
    return {"uint64_t timestamp": stamps(t), "float voltage_v": volts}
