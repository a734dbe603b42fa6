"""The frames of a blackbox of Betaflight, INAV or Cleanflight, decoded by compiled code.

A frame is a letter and the header's fields for this letter. The header states each field's
*encoding*, and its *predictor*: the number to which the field is added. Betaflight's and
Cleanflight's documentation describes the format ("Blackbox logging internals"). ``I`` frames stand
alone, ``P`` frames build on the two main frames before them. ``S``, ``G``, ``H`` (slow fields, GPS)
and ``E`` (events) are passed over. Undecodable bytes are passed one by one, and ``P`` frames count
again after the next ``I`` frame.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....runtime.compiled import compiled

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

ENCODINGS = (0, 1, 3, 6, 7, 8, 9, 10)
PREDICTORS = (*range(12), 256)
LONGEST = 1024  # bytes of a frame
_TOO_DAMAGED = 1_000_000  # undecodable frames, at most, in a log
FRAMES = "IPSGH"
_EVENT = len(FRAMES)  # kind of an event, E
_KINDS = np.full(256, -1)  # of frames, by their letters
_KINDS[[ord(letter) for letter in FRAMES + "E"]] = np.arange(_EVENT + 1)
# three fields together, by the first two bits: further bytes, lowest bits, widths in bits
_EQUAL = np.array([[0, 4, 2, 0, 2, 2, 2], [1, 8, 4, 0, 4, 4, 4], [2, 16, 8, 0, 6, 6, 6]])
_VARIABLE = np.array([[0, 4, 2, 0, 2, 2, 2], [1, 9, 4, 0, 5, 5, 4], [2, 14, 7, 0, 8, 7, 7]])


class Layout(NamedTuple):
    """A header's statements on the frames; I and P frames have the same fields."""

    encodings: Ints  # (5, F) of I, P, S, G and H frames
    predictors: Ints  # (5, F)
    counts: Ints  # (5,) fields of each
    intervals: Ints  # (3,) of I frames, and numerator and denominator of P frames, in loops
    constants: Ints  # (257,) what each predictor adds
    places: Ints  # (3,) fields loopIteration, time and motor[0]; -1: none


@compiled
def _signed(value: int, bits: int) -> int:
    """Return an integer of some bits with its sign."""
    return value - (1 << bits) if value & (1 << (bits - 1)) else value


@compiled
def _byte(data: Bytes, at: Ints) -> int:
    """Return the next byte; behind the end 0, and the place goes on, as a mark."""
    place = at[0]
    at[0] = place + 1
    return int(data[place]) if place < len(data) else 0


@compiled
def _unsigned_vb(data: Bytes, at: Ints) -> int:
    out = 0
    for shift in range(0, 35, 7):
        byte = _byte(data, at)
        out |= (byte & 0x7F) << shift
        if byte < 128:
            return out & 0xFFFFFFFF
    at[0] = len(data) + 1  # more than 32 bits: no number
    return 0


@compiled
def _signed_vb(data: Bytes, at: Ints) -> int:
    value = _unsigned_vb(data, at)
    return (value >> 1) ^ -(value & 1)


@compiled
def _three(data: Bytes, at: Ints, out: Ints, layouts: Ints) -> None:
    """Read three fields, packed as one of three ``layouts`` (3, 7), or of whole bytes each."""
    packed = _byte(data, at)
    kind = packed >> 6
    if kind == 3:
        for i in range(3):
            out[i] = 0
            width = ((packed >> (2 * i)) & 3) + 1
            for k in range(width):
                out[i] |= _byte(data, at) << (8 * k)
            out[i] = _signed(out[i], 8 * width)
        return
    for _ in range(layouts[kind, 0]):
        packed = packed << 8 | _byte(data, at)
    for i in range(3):
        width = layouts[kind, 4 + i]
        out[i] = _signed((packed >> layouts[kind, 1 + i]) & ((1 << width) - 1), width)


@compiled
def _four(data: Bytes, at: Ints, out: Ints) -> None:
    """Read four fields of 0, 4, 8 or 16 bits, packed by half bytes."""
    selector = _byte(data, at)
    is_left, held = False, 0  # whether half a byte is left over, and its byte
    for i in range(4):
        halves = (1 << ((selector >> (2 * i)) & 3)) >> 1
        out[i] = 0
        for _ in range(halves):
            if not is_left:
                held = _byte(data, at)
            out[i] = out[i] << 4 | (held & 15 if is_left else held >> 4)
            is_left = not is_left
        if halves:
            out[i] = _signed(out[i], 4 * halves)


@compiled
def _fields(data: Bytes, at: Ints, encodings: Ints, count: int, out: Ints) -> None:
    """Read the fields of a frame as they are coded, alone or in groups."""
    group = np.zeros(8, np.int64)
    i = 0
    while i < count and at[0] <= len(data):
        encoding, size = encodings[i], 1
        group[0] = 0  # default
        if encoding == 0:
            group[0] = _signed_vb(data, at)
        elif encoding == 1:
            group[0] = _unsigned_vb(data, at)
        elif encoding == 3:
            group[0] = -_signed(_unsigned_vb(data, at) & 0x3FFF, 14)
        elif encoding == 6:
            while size < 8 and i + size < count and encodings[i + size] == 6:
                size += 1
            there = _byte(data, at) if size > 1 else 1
            for k in range(size):
                group[k] = _signed_vb(data, at) if there & (1 << k) else 0
        elif encoding == 7 or encoding == 10:
            _three(data, at, group, _VARIABLE if encoding == 10 else _EQUAL)
            size = 3
        elif encoding == 8:
            _four(data, at, group)
            size = 4
        for k in range(min(size, count - i)):
            out[i + k] = group[k]
        i += size


@compiled
def _passed_over(before: int, intervals: Ints) -> int:
    """Return how many loops after one were not to be recorded."""
    count = 0
    while count < 1000:
        k = before + 1 + count
        if (k % intervals[0] + intervals[1] - 1) % intervals[2] < intervals[1]:
            break
        count += 1
    return count


@compiled
def _predict(
    out: Ints, before: Ints, older: Ints, count: int, predictors: Ints, layout: Layout
) -> None:
    """Add the predictions to the fields (F,) of a main frame."""
    for i in range(count):
        kind = predictors[i]
        if kind == 1:
            out[i] += before[i]
        elif kind == 2:
            out[i] += 2 * before[i] - older[i]
        elif kind == 3:
            # a half is cut off towards zero, as in C
            total = before[i] + older[i]
            out[i] += total // 2 if total >= 0 else -(-total // 2)
        elif kind == 5 and layout.places[2] >= 0:
            out[i] += out[layout.places[2]]
        elif kind == 6:
            out[i] = before[i] + 1 + _passed_over(before[layout.places[0]], layout.intervals)
        else:
            out[i] += layout.constants[kind]


@compiled
def _event(data: Bytes, at: Ints) -> int:
    """Pass over an event; return 0, 1 at the log's end, 2 for an unknown kind."""
    kind = _byte(data, at)
    if kind == 0 or kind == 15 or kind == 40:  # beep, disarmed, sensor failure
        _unsigned_vb(data, at)
    elif kind == 14 or kind == 30:  # recording goes on, flight mode
        _unsigned_vb(data, at)
        _unsigned_vb(data, at)
    elif kind == 13:  # adjustment in flight
        if _byte(data, at) < 128:
            _signed_vb(data, at)
        else:
            at[0] += 4
    elif kind == 255:
        return 1
    else:
        return 2
    return 0


@compiled
def decode(data: Bytes, begin: int, layout: Layout, keep: Ints, rows: Ints) -> tuple[int, int]:
    """Decode the main frames of a log.

    Args:
        data: the file up to the log's end.
        begin: the frames' first byte.
        layout: the frames' layout.
        keep: (K,) wanted fields.
        rows: (N, K) receives them; no more than N frames are decoded.

    Returns:
        How many frames were decoded, and how many were not.
    """
    fields = layout.encodings.shape[1]
    out, before = np.zeros(fields, np.int64), np.zeros(fields, np.int64)
    older = np.zeros(fields, np.int64)
    at = np.zeros(1, np.int64)
    place, found, lost, based = begin, 0, 0, False
    while place < len(data) and found < len(rows) and lost < _TOO_DAMAGED:
        kind, said = _KINDS[data[place]], 0
        at[0] = place + 1
        if kind == _EVENT:
            said = _event(data, at)
        elif kind >= 0 and layout.counts[kind] > 0:
            _fields(data, at, layout.encodings[kind], layout.counts[kind], out)
        else:
            said = 2
        after = at[0]
        good = said != 2 and after <= len(data) and after - place <= LONGEST
        if good and said == 0 and after < len(data):  # another frame must follow
            good = _KINDS[data[after]] >= 0
        if not good:
            lost += 1
            based = False
            place += 1
            # the next letter of a frame
            while place < len(data) and _KINDS[data[place]] < 0:
                place += 1
            continue
        if said == 1:
            break
        if kind == 0 or (kind == 1 and based):
            _predict(out, before, older, layout.counts[kind], layout.predictors[kind], layout)
            older[:] = out if kind == 0 else before
            before[:] = out
            based = True
            for k in range(len(keep)):
                rows[found, k] = out[keep[k]]
            found += 1
        elif kind == 1:
            lost += 1
        place = after
    return found, lost
