"""ArduPilot's DataFlash format: a binary log that describes its own messages.

Each message begins with A3 95 and its type's number. Type 128, FMT, states of a type its number,
its length, its name, and the letters and names of its columns. pymavlink reads it, too: as Python
objects, one by one, in 14 times the time, with a printed line for each byte that is damaged, and
with 100 MB of disk.
Here compiled code goes through a file, first to count and then to note the places of the messages
that are wanted, and their columns are read at once, so that any file costs a bounded time.

Ground stations turn such a log into text (``.log``): a message a line, its type's name first, FMT
among them, and numbers in whole units.
"""

from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....runtime.compiled import compiled
from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import read_bytes

Bytes = NDArray[np.uint8]
Messages = dict[str, NDArray[Any]]  # (N,) of one type: columns by name, numbers or bytes of texts

_AS_TEXT = b"FMT, 128, 89, FMT,"  # stands in a log as text
BEGINS = b"\xa3\x95|(?s:.*)" + _AS_TEXT
WHAT = "an ArduPilot log (DataFlash .BIN)"
_TEXTS = ("Name", "Message")  # columns, of PARM and MSG
_FMT, _FMT_LENGTH = 128, 89
_GATHERED = 10_000  # messages copied at a time
# types of columns by their letters, those of ``struct`` among them; and what one unit is of
# those that are no whole units
_TYPES = {letter: f"<{letter}" for letter in "bBhHiIqQfd"}
_TYPES |= {"a": "(32,)<i2", "g": "<f2", "n": "S4", "N": "S16", "Z": "S64", "M": "<B"}
_TYPES |= {"c": "<h", "C": "<H", "e": "<i", "E": "<I", "L": "<i"}
_UNITS = dict.fromkeys("cCeE", 0.01) | {"L": 1e-7}


def read_dataflash(path: Path, wanted: Collection[str]) -> tuple[dict[str, Messages], int]:
    """Return the messages of the types that are wanted and there, by the names of these, and how
    many bytes belong to no message.

    Raises:
        InputError: the file cannot be read, is no such log, or has more messages of a type than
            ``FileLimits.table_rows``.
    """
    content = read_bytes(path, WHAT, LIMITS.binary_log)
    if _AS_TEXT in content[:4096]:
        return _of_text(path, content, wanted), 0
    data = np.frombuffer(content, np.uint8)
    counts, nowhere = np.zeros(256, np.int64), np.empty(0, np.int64)
    used = _walk(data, counts, -1, nowhere)

    def places(number: int, most: int) -> NDArray[np.int64]:
        found = np.empty(min(int(counts[number]), most), np.int64)
        _walk(data, np.zeros(256, np.int64), number, found)
        return found

    kinds = {}
    for place in places(_FMT, 100_000):
        kind = _layout(data[place : place + _FMT_LENGTH].tobytes(), wanted)
        if kind is not None:
            kinds[kind[0]] = kind[1:]
    found: dict[str, Messages] = {}
    for number, (name, layout, units) in kinds.items():
        count = int(counts[number])
        check_count(f"{path}: {name}", count, LIMITS.table_rows, "messages")
        if count:
            found[name] = _rows(data, places(number, count), layout, units)
    if not kinds and not counts[_FMT]:
        raise InputError(f"{path}: cannot be read as {WHAT}: no FMT message; expected some")
    return found, len(data) - int(used)


def _of_text(path: Path, content: bytes, wanted: Collection[str]) -> dict[str, Messages]:
    """Return the messages of the types that are wanted, of a log as text. The lines before the
    first FMT, where old ones name the vehicle, count as MSG; lines that are cut are left out.
    """
    before, _, lines = content.partition(b"FMT,")
    names: dict[str, list[str]] = {}
    rows: dict[str, list[list[bytes]]] = {}
    for line in (b"FMT," + lines).splitlines():
        kind, _, rest = line.partition(b",")
        name = kind.decode("ascii", "replace")
        if name == "FMT":  # type, length, name, letters, columns
            stated = rest.decode("ascii", "replace").replace(" ", "").split(",")
            names.setdefault("".join(stated[2:3]), stated[4:])
        elif name in wanted and name in names:
            values = rest.split(b",", len(names[name]) - 1)
            if len(values) == len(names[name]):
                rows.setdefault(name, []).append(values)
    found: dict[str, Messages] = {}
    for name, messages in rows.items():
        check_count(f"{path}: {name}", len(messages), LIMITS.table_rows, "messages")
        columns = dict(zip(names[name], zip(*messages, strict=True), strict=True))
        found[name] = {
            column: np.char.strip(np.array(texts)) if column in _TEXTS else _numbers(texts)
            for column, texts in columns.items()
        }
    said = found.get("MSG", {}).get("Message", np.empty(0, "S1"))
    found["MSG"] = {"Message": np.array([*before.splitlines(), *said, b""])}
    return found


def _numbers(texts: Sequence[bytes]) -> NDArray[np.float64]:
    """Return the numbers (N,) that texts are; NaN where one is none."""
    found = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        with suppress(ValueError):
            found[i] = float(text)
    return found


def _rows(
    data: Bytes, places: NDArray[np.int64], layout: np.dtype[Any], units: dict[str, float]
) -> Messages:
    """Return the columns of the messages (N,) that begin at places (N,): numbers in whole units, or
    texts; lists of numbers are left out.
    """
    block = np.empty((len(places), layout.itemsize), np.uint8)
    within = np.arange(3, 3 + layout.itemsize)
    for first in range(0, len(places), _GATHERED):
        part = places[first : first + _GATHERED]
        block[first : first + _GATHERED] = data[part[:, None] + within]
    rows = block.view(layout)[:, 0]
    with np.errstate(invalid="ignore"):  # spoiled bytes may make a signalling NaN
        return {
            name: rows[name] if layout[name].kind == "S" else rows[name].astype(np.float64) * unit
            for name, unit in units.items()
            if rows[name].ndim == 1
        }


def _layout(
    message: bytes, wanted: Collection[str]
) -> tuple[int, str, np.dtype[Any], dict[str, float]] | None:
    """Return number, name, layout and units of the type that a FMT message describes; None where it
    is not wanted, or does not describe what it says.
    """
    number, length = message[3], message[4]
    name, letters, joined = (
        message[begin:end].split(b"\0")[0].decode("ascii", "replace")
        for begin, end in ((5, 9), (9, 25), (25, 89))
    )
    columns = joined.split(",")
    known = all(letter in _TYPES for letter in letters) and all(columns)
    if name not in wanted or not known or not len(letters) == len(columns) == len(set(columns)):
        return None
    layout = np.dtype([(c, _TYPES[letter]) for c, letter in zip(columns, letters, strict=True)])
    units = [_UNITS.get(letter, 1.0) for letter in letters]
    stated = number, name, layout, dict(zip(columns, units, strict=True))
    return stated if layout.itemsize + 3 == length else None


@compiled
def _walk(data: Bytes, counts: NDArray[np.int64], number: int, places: NDArray[np.int64]) -> int:
    """Go through all messages; count them by type, and note the places of the first of one type.

    Return how many bytes they take. What is no message is passed byte by byte.
    """
    lengths = np.zeros(256, np.int64)
    lengths[128] = 89
    place, used, noted = 0, 0, 0
    while place + 3 <= len(data):
        kind = data[place + 2]
        length = lengths[kind]
        if (
            data[place] != 0xA3
            or data[place + 1] != 0x95
            or length < 3
            or place + length > len(data)
        ):
            place += 1
            continue
        if kind == 128:
            lengths[data[place + 3]] = data[place + 4]
            lengths[128] = 89
        counts[kind] += 1
        if kind == number and noted < len(places):
            places[noted] = place
            noted += 1
        place += length
        used += length
    return used
