"""A small writer of a Crazyflie's SD-card logs, after the format's description in its firmware."""

import struct
import zlib


def sd_card(events, version=2, checksum=True):
    """Return the bytes of a log of events ``{name: (times, variables)}``, in order of time."""
    out = struct.pack("<BHH", 0xBC, version, len(events))
    records = []
    for number, (name, (t, variables)) in enumerate(events.items(), 7):
        out += struct.pack("<H", number) + name.encode() + b"\0"
        out += struct.pack("<H", len(variables))
        out += b"".join(key.encode() + b"\0" for key in variables)
        layout = "<H" + ("Q" if version == 2 else "I") + "".join(key[-2] for key in variables)
        for k, at in enumerate(t):
            stamp = round(1e6 * at) if version == 2 else round(1e3 * at)
            values = [int(c[k]) if key[-2] != "f" else float(c[k]) for key, c in variables.items()]
            records.append((at, struct.pack(layout, number, stamp, *values)))
    out += b"".join(record for _, record in sorted(records, key=lambda r: r[0]))
    return out + struct.pack("<I", zlib.crc32(out)) if checksum else out


def sd_card_before_2021(t, variables, block=20):
    """Return the bytes of a log whose variables ``{name with letter: (N,)}`` were sampled
    together.
    """

    def sealed(part):
        return part + struct.pack("<I", zlib.crc32(part) ^ 0xFFFFFFFF)

    names = "".join(f"{name}," for name in ("tick(I)", *variables))
    out = sealed(bytes([1 + len(variables)]) + names.encode())
    layout = "<I" + "".join(name[-2] for name in variables)
    rows = [
        struct.pack(
            layout,
            round(1e3 * at),
            *(float(c[k]) if name[-2] == "f" else int(c[k]) for name, c in variables.items()),
        )
        for k, at in enumerate(t)
    ]
    for first in range(0, len(rows), block):
        part = rows[first : first + block]
        out += sealed(bytes([len(part)]) + b"".join(part))
    return out
