"""A small writer of ArduPilot's DataFlash logs, after the format's description in its wiki."""

import struct
from collections.abc import Mapping, Sequence

_CODES = {
    "Q": "Q",
    "f": "f",
    "B": "B",
    "H": "H",
    "N": "16s",
    "c": "h",
    "L": "i",
    "h": "h",
    "C": "H",
}
_FACTORS = {"c": 100.0, "C": 100.0, "L": 1e7}


def dataflash(
    messages: Sequence[tuple[str, str, Mapping[str, Sequence[float | bytes]]]],
) -> bytes:
    """Return a log.

    Args:
        messages: of each type its name, the letters of its columns, and the columns, all of one
            length; they are written one type after the other.
    """
    out = [_format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")]
    for number, (name, letters, columns) in enumerate(messages, 10):
        layout = "<" + "".join(_CODES[letter] for letter in letters)
        length = 3 + struct.calcsize(layout)
        out.append(_format(number, length, name, letters, ",".join(columns)))
        for row in zip(*columns.values(), strict=True):
            values = [_stored(letter, value) for letter, value in zip(letters, row, strict=True)]
            out.append(bytes([0xA3, 0x95, number]) + struct.pack(layout, *values))
    return b"".join(out)


def _stored(letter: str, value: float | bytes) -> float | bytes:
    if isinstance(value, bytes) or letter == "f":
        return value
    return round(value * _FACTORS.get(letter, 1.0))


def _format(number: int, length: int, name: str, letters: str, columns: str) -> bytes:
    packed = struct.pack(
        "<BB4s16s64s", number, length, name.encode(), letters.encode(), columns.encode()
    )
    return b"\xa3\x95\x80" + packed
