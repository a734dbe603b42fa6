"""A small writer of Betaflight blackboxes, with each encoding and predictor that a quadrotor's log
has, after the format's description in Betaflight's documentation.
"""

from numpy.random import default_rng

# field: predictor and encoding in I frames, predictor and encoding in P frames
FIELDS = {
    "loopIteration": (0, 1, 6, 9),
    "time": (0, 1, 2, 0),
    "axisP[0]": (0, 0, 1, 0),
    **{f"axisI[{i}]": (0, 0, 1, 7) for i in range(3)},
    **{f"axisD[{i}]": (0, 0, 1, 10) for i in range(3)},
    **{f"rcCommand[{i}]": (0, 0, 1, 8) for i in range(3)},
    "rcCommand[3]": (4, 1, 1, 8),
    "vbatLatest": (9, 3, 1, 6),
    "amperageLatest": (0, 0, 1, 6),
    "rssi": (0, 1, 1, 6),
    **{f"{name}[{i}]": (0, 0, 3, 0) for name in ("gyroADC", "accSmooth") for i in range(3)},
    "motor[0]": (11, 1, 3, 0),
    **{f"motor[{i}]": (5, 0, 3, 0) for i in range(1, 4)},
    **{f"eRPM[{i}]": (0, 1, 1, 0) for i in range(4)},
}
VBATREF = 2520
MINTHROTTLE = 1070
LEAST_MOTOR = 158
HEADERS = {
    "Data version": "2",
    "Firmware revision": "Betaflight 4.4.2",
    "I interval": "32",
    "P interval": "1/2",
    "acc_1G": "2048",
    "motorOutput": f"{LEAST_MOTOR},2047",
    "vbatref": str(VBATREF),
    "minthrottle": str(MINTHROTTLE),
    "motor_poles": "14",
}


def flight(count=400, seed=0):
    """Rows of a flight at 1 kHz: half a second on the ground, then all fields wander, now and then
    by a leap.
    """
    rng = default_rng(seed)
    values = dict.fromkeys(FIELDS, 0) | {
        "accSmooth[2]": 2048,
        "rcCommand[3]": 1200,
        "vbatLatest": 2480,
    }
    values |= {f"motor[{i}]": 300 + 100 * i for i in range(4)}
    values |= {f"eRPM[{i}]": 900 + 10 * i for i in range(4)}
    rows = []
    for k in range(count):
        if k:
            leap = rng.choice([0, 1, 5, 20, 300], size=len(FIELDS), p=[0.3, 0.3, 0.2, 0.15, 0.05])
            for name, size in zip(FIELDS, leap, strict=True):
                still = name.startswith(("accSmooth", "gyroADC")) and k < 0.6 * count
                if not still:
                    values[name] += int(rng.integers(-size, size + 1))
        for name in values:
            low = LEAST_MOTOR if name.startswith("motor") else 0
            if name.startswith(("motor", "eRPM", "rssi", "rcCommand[3]", "vbat")):
                values[name] = min(max(values[name], low), 2047)
        rows.append(values | {"loopIteration": 2 * k, "time": 5_000_000 + 1000 * k + k % 3})
    return rows


def blackbox(rows, headers=None, variable=True):
    """Return a log of rows, each with every field; loopIteration counts by two. Encoding 10 is left
    out where not ``variable``.
    """
    stated = HEADERS | dict(headers or {})
    fields = FIELDS
    if not variable:
        fields = {k: (a, b, c, 7 if d == 10 else d) for k, (a, b, c, d) in FIELDS.items()}
    lists = {
        "I name": fields,
        "I signed": [0] * len(fields),
        "I predictor": [f[0] for f in fields.values()],
        "I encoding": [f[1] for f in fields.values()],
        "P predictor": [f[2] for f in fields.values()],
        "P encoding": [f[3] for f in fields.values()],
    }
    lists |= {"S name": ["flightModeFlags", "stateFlags"], "S encoding": [1, 1]}
    lists |= {"S signed": [0, 0], "S predictor": [0, 0]}
    lines = [
        "H Product:Blackbox flight data recorder by Nicholas Sherlock",
        *(f"H Field {key}:{','.join(map(str, values))}" for key, values in lists.items()),
        *(f"H {key}:{value}" for key, value in stated.items()),
    ]
    out = ["\n".join(lines).encode() + b"\n"]
    before = {}
    older = {}
    for row in rows:
        if row["loopIteration"] % 32 == 0:
            out.append(b"I" + _frame(fields, row, {}, {}, 0))
            older = row
        else:
            out.append(b"P" + _frame(fields, row, before, older, 2))
            older = before
        if not before:
            out.append(b"S" + _unsigned(3) + _unsigned(1))
        before = row
        if row["loopIteration"] % 64 == 0:
            out.append(b"E\x1e" + _unsigned(5) + _unsigned(1))  # a flight mode
    out.append(b"E\xffEnd of log\x00")
    return b"".join(out)


def _frame(fields, row, before, older, which):
    out = b""
    names = list(fields)
    i = 0
    while i < len(names):
        encoding = fields[names[i]][which + 1]
        group = [names[i]]
        while (
            i + len(group) < len(names)
            and fields[names[i + len(group)]][which + 1] == encoding
            and len(group) < {6: 8, 7: 3, 10: 3, 8: 4}.get(encoding, 1)
        ):
            group.append(names[i + len(group)])
        values = [
            row[name] - _foreseen(fields[name][which], name, row, before, older) for name in group
        ]
        out += _encoded(encoding, values)
        i += len(group)
    return out


def _foreseen(predictor, name, row, before, older):
    if predictor == 1:
        return before[name]
    if predictor == 2:
        return 2 * before[name] - older[name]
    if predictor == 3:
        return int((before[name] + older[name]) / 2)
    return {
        0: 0,
        4: MINTHROTTLE,
        5: row["motor[0]"],
        6: row[name],
        9: VBATREF,
        11: LEAST_MOTOR,
    }[predictor]


def _encoded(encoding, values):
    if encoding == 0:
        return _signed(values[0])
    if encoding == 1:
        return _unsigned(values[0])
    if encoding == 3:
        return _unsigned(-values[0] & 0x3FFF)
    if encoding == 6:
        there = sum(1 << k for k, value in enumerate(values) if value)
        return bytes([there]) + b"".join(_signed(value) for value in values if value)
    if encoding == 7:
        return _three(values, _EQUAL)
    if encoding == 8:
        return _four(values)
    if encoding == 10:
        return _three(values, _VARIABLE)
    return b""


def _unsigned(value):
    out = []
    value &= 0xFFFFFFFF
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def _signed(value):
    return _unsigned((value << 1) ^ (value >> 31))


def _fits(values, widths):
    return all(-(1 << (w - 1)) <= v < 1 << (w - 1) for v, w in zip(values, widths, strict=True))


# three fields together: their widths in bits, and the lowest bit of each, of one to three bytes
_EQUAL = (((2, 2, 2), (4, 2, 0)), ((4, 4, 4), (8, 4, 0)), ((6, 6, 6), (16, 8, 0)))
_VARIABLE = (((2, 2, 2), (4, 2, 0)), ((5, 5, 4), (9, 4, 0)), ((8, 7, 7), (14, 7, 0)))


def _three(values, layouts):
    for kind, (widths, places) in enumerate(layouts):
        if _fits(values, widths):
            bits = kind << (8 * kind + 6)
            for value, width, place in zip(values, widths, places, strict=True):
                bits |= (value & ((1 << width) - 1)) << place
            return bits.to_bytes(kind + 1, "big")
    selector = 0xC0
    out = b""
    for i, value in enumerate(values):
        width = next(w for w in (1, 2, 3, 4) if _fits([value], [8 * w]))
        selector |= (width - 1) << (2 * i)
        out += (value & ((1 << 8 * width) - 1)).to_bytes(width, "little")
    return bytes([selector]) + out


def _four(values):
    selector = 0
    halves = []
    for i, value in enumerate(values):
        kind = (
            0
            if value == 0
            else next(k for k, w in ((1, 4), (2, 8), (3, 16)) if _fits([value], [w]))
        )
        selector |= kind << (2 * i)
        width = (0, 1, 2, 4)[kind]
        halves += [value >> (4 * (width - 1 - k)) & 15 for k in range(width)]
    if len(halves) % 2:
        halves.append(0)
    pairs = zip(halves[::2], halves[1::2], strict=True)
    return bytes([selector, *(high << 4 | low for high, low in pairs)])
