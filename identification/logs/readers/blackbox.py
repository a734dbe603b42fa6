"""Blackboxes of Betaflight and INAV (``.bbl``, ``.bfl``, ``.txt``) as they are: their headers and
fields.

A file may hold several logs, one for each time that the vehicle was armed: the longest is read, and
a note says so. ``blackbox_frames`` decodes its frames. orangebox 0.5.0, the library for these logs,
cannot: its encoding 10, which Betaflight's logs have, is not written, a log that was cut ends it by
a TypeError, and of damaged ones it keeps frames that are wrong (398 of 400 where 369 are right). It
serves the tests as a second opinion on whole logs without that encoding.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path

import numpy as np

from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import read_bytes
from ..clocks import check_piece
from ..table import Array
from .blackbox_frames import ENCODINGS, FRAMES, PREDICTORS, Layout, decode

_START = b"H Product:Blackbox"
WHAT = "a blackbox of Betaflight or INAV"
_HEADERS = re.compile(rb"(H [^\n]{0,20000}\n){0,2000}")


def read_blackbox(
    path: Path, wanted: Sequence[str], piece: int | None = None
) -> tuple[dict[str, str], dict[str, Array], list[str]]:
    """Return the headers of a file's longest log, its fields (N,) by name, and notes.

    Args:
        path: the file.
        wanted: names of fields, ``time`` among them; those that the log lacks are left out.
        piece: which of its logs is read, from 1; default: the longest.

    Raises:
        InputError: the file cannot be read, has no such log, is no blackbox, is damaged from its
            start, or has no times.
    """
    data = read_bytes(path, WHAT, LIMITS.binary_log)
    if not data.startswith(_START):
        raise InputError(
            f"{path}: cannot be read as {WHAT}: it does not begin with {_START.decode()!r}"
        )
    starts = [match.start() for match in re.finditer(re.escape(_START), data)]
    ends = [*starts[1:], len(data)]
    check_piece(path, piece, len(starts))
    longest = max(range(len(starts)), key=lambda i: ends[i] - starts[i])
    chosen = longest if piece is None else piece - 1
    block = _HEADERS.match(data, starts[chosen], ends[chosen])
    begin = starts[chosen] if block is None else block.end()
    if data[begin : begin + 2] == b"H ":
        raise InputError(f"{path}: its headers do not end; expected frames behind them")
    lines = data[starts[chosen] : begin].decode("ascii", "replace").split("\n")
    pairs = (line.removeprefix("H ").partition(":") for line in lines)
    headers = {key.strip(): value.strip() for key, _, value in pairs}
    version = headers.get("Data version", "2")
    if version != "2":
        raise InputError(f"{path}: header Data version: {version[:20]!r}; expected 2")
    names = headers.get("Field I name", "").split(",")
    layout = _layout(path, headers, names)
    keep = [name for name in wanted if name in names]
    if "time" not in keep:
        raise InputError(f"{path}: no field time; found {', '.join(names[:20])}")
    where = np.array([names.index(name) for name in keep], dtype=np.int64)
    frames = np.frombuffer(data[: ends[chosen]], np.uint8)
    most = min(LIMITS.table_rows, LIMITS.table_numbers // len(keep))
    rows = np.empty((most + 1, len(keep)), np.int64)  # takes memory as it is filled
    count, lost = decode(frames, begin, layout, where, rows)
    check_count(path, count, most, "frames")
    if count < 2:
        raise InputError(f"{path}: {count} frame(s) that can be decoded; expected at least two")
    rows = rows[:count]
    notes = [f"blackbox of {headers.get('Firmware revision', 'an unknown firmware')[:60]}"]
    if len(starts) > 1:
        notes.append(
            f"the file holds {len(starts)} logs; number {chosen + 1} was read"
            + ("" if piece else ", the longest; --piece reads another")
        )
    if lost:
        notes.append(f"{lost} frame(s) of {count + lost} could not be decoded and were left out")
    return headers, dict(zip(keep, rows.T.astype(np.float64), strict=True)), notes


def whole_number(text: str, least: int, most: int) -> int | None:
    """Return the whole number that a header states; None where it is none between two limits."""
    if not text.lstrip("-").isdecimal() or len(text) > 10:
        return None
    return int(text) if least <= int(text) <= most else None


def _layout(path: Path, headers: Mapping[str, str], names: list[str]) -> Layout:
    """Return what the headers say of the frames.

    Raises:
        InputError: they contradict themselves, or name what is not known.
    """
    check_count(path, len(names), LIMITS.log_fields, "fields")
    predictors = _frame_lists(path, headers, "predictor", PREDICTORS)
    encodings = _frame_lists(path, headers, "encoding", ENCODINGS)
    for letter, one, other in zip(FRAMES, predictors, encodings, strict=True):
        sizes = {len(one), len(other)}
        if len(sizes) > 1 or (letter in "IP" and sizes != {len(names)}):
            raise InputError(
                f"{path}: headers Field {letter} predictor and encoding have "
                f"{' and '.join(map(str, sorted(sizes)))} numbers; expected as many as the "
                f"{len(names)} names of Field I"
            )
    places = [
        names.index(name) if name in names else -1 for name in ("loopIteration", "time", "motor[0]")
    ]
    if places[0] < 0 and any(6 in one for one in predictors):
        raise InputError(f"{path}: no field loopIteration, which its predictors count on")

    def number(text: str, default: int) -> int:
        found = whole_number(text, -999_999_999, 999_999_999)
        return default if found is None else found

    top, _, bottom = headers.get("P interval", "1/1").rpartition("/")
    every = headers.get("I interval", "32")
    intervals = [max(1, number(text, 1)) for text in (every, top or "1", bottom)]
    least = headers.get("motorOutput", "").split(",")[0]
    constants = np.zeros(max(PREDICTORS) + 1, np.int64)
    constants[4] = number(headers.get("minthrottle", ""), 1150)
    constants[8], constants[9] = 1500, number(headers.get("vbatref", ""), 4095)
    constants[11] = number(least, 0)
    rows = (  # with zeros behind them
        np.array(list(zip_longest(*lists, [0], fillvalue=0)), np.int64).T.copy()
        for lists in (encodings, predictors)
    )
    counts = [len(one) for one in encodings]
    return Layout(*rows, *(np.array(x, np.int64) for x in (counts, intervals, constants, places)))


def _frame_lists(
    path: Path, headers: Mapping[str, str], what: str, known: Collection[int]
) -> list[list[int]]:
    """Return the predictors or the encodings of each kind of frame.

    Raises:
        InputError: one is none that is known.
    """
    lists = []
    for letter in FRAMES:
        key = f"Field {letter} {what}"
        texts = headers.get(key, "").split(",") if headers.get(key) else []
        if bad := [text for text in texts if text.strip() not in map(str, known)]:
            raise InputError(
                f"{path}: header {key}: {bad[0][:20]}; expected one of {', '.join(map(str, known))}"
            )
        lists.append([int(text) for text in texts])
    return lists
