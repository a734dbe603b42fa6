"""ArduPilot's DataFlash format: a binary log that describes its own messages.

Each message begins with A3 95 and its type's number. Type 128, FMT, states of a type its number,
its length, its name, and the letters and names of its columns. pymavlink reads it, too: as Python
objects, one by one, in 14 times the time, with a printed line for each byte that is damaged, and
with 100 MB of disk. It opens 20 million empty messages in 161 s and 1.1 GB.
Here compiled code goes through a file and notes the places of the messages, and the columns of
those that are wanted are read at once, so that any file costs a bounded time.

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
_HEAD = 3  # bytes of a message before its columns
_FMT, _FMT_LENGTH = 128, 89
_FORMAT = np.dtype("u1, u1, S4, S16, S64")  # number, length, name, letters and columns of a type
_MOST_FORMATS = 100_000  # that are looked at
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
    most = len(data) // _HEAD
    places, kinds = np.empty(most, np.int32), np.empty(most, np.uint8)
    count, used = _walk(data, places, kinds)
    places, kinds = places[:count], kinds[:count]  # take memory as they were filled
    found: dict[str, Messages] = {}
    formats = _rows(data, places[kinds == _FMT][:_MOST_FORMATS], _FORMAT)
    if not len(formats):
        raise InputError(f"{path}: cannot be read as {WHAT}: no FMT message; expected some")
    for number, (name, layout, units) in _layouts(formats, wanted).items():
        of_kind = places[kinds == number]
        check_count(f"{path}: {name}", len(of_kind), LIMITS.table_rows, "messages")
        if len(of_kind):
            rows = _rows(data, of_kind, layout)
            with np.errstate(invalid="ignore"):  # spoiled bytes may make a signalling NaN
                found[name] = {
                    column: x if x.dtype.kind == "S" else x.astype(np.float64) * unit
                    for column, unit in units.items()
                    if (x := rows[column]).ndim == 1  # no list of numbers
                }
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


def _rows(data: Bytes, places: NDArray[np.int32], layout: np.dtype[Any]) -> NDArray[Any]:
    """Return the messages (N,) that begin at places (N,), by their layout."""
    block = np.empty((len(places), layout.itemsize), np.uint8)
    within = np.arange(_HEAD, _HEAD + layout.itemsize)
    for first in range(0, len(places), _GATHERED):
        part = places[first : first + _GATHERED]
        block[first : first + _GATHERED] = data[part[:, None] + within]
    return block.view(layout)[:, 0]


def _layouts(
    formats: NDArray[Any], wanted: Collection[str]
) -> dict[int, tuple[str, np.dtype[Any], dict[str, float]]]:
    """Return name, layout and units of the types that are wanted, by number; without those that
    do not describe what they say.
    """
    found = {}
    for number, length, *texts in formats.tolist():
        name, letters, joined = (x.split(b"\0")[0].decode("ascii", "replace") for x in texts)
        columns = joined.split(",")
        known = all(letter in _TYPES for letter in letters) and all(columns)
        if name not in wanted or not known or not len(letters) == len(columns) == len(set(columns)):
            continue
        layout = np.dtype(list(zip(columns, map(_TYPES.__getitem__, letters), strict=True)))
        units = [_UNITS.get(letter, 1.0) for letter in letters]
        if layout.itemsize + _HEAD == length:
            found[number] = name, layout, dict(zip(columns, units, strict=True))
    return found


@compiled
def _walk(data: Bytes, places: NDArray[np.int32], kinds: Bytes) -> tuple[int, int]:
    """Go through all messages; note their places and types. Return how many they are, and how many
    bytes they take. What is no message is passed byte by byte.
    """
    lengths = np.zeros(256, np.int64)
    lengths[_FMT] = _FMT_LENGTH
    place, used, count = 0, 0, 0
    while place + _HEAD <= len(data):
        kind = data[place + 2]
        length = lengths[kind]
        is_begin = data[place] == 0xA3 and data[place + 1] == 0x95
        if not is_begin or length < _HEAD or place + length > len(data):
            place += 1
            continue
        if kind == _FMT:
            lengths[data[place + 3]] = data[place + 4]
            lengths[_FMT] = _FMT_LENGTH
        places[count], kinds[count] = place, kind
        count += 1
        place += length
        used += length
    return count, used
