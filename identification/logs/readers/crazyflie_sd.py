"""Logs of a Crazyflie's micro-SD deck (``usdlog``): binary, of events.

The format (Bitcraze's documentation of the deck, versions 1 and 2), little-endian: the byte 0xBC;
the version and the number of event types, 16 bits each. Each type has its number (16 bits), its
name, its number of variables (16 bits) and their names. A variable's name ends in the letter of its
type as in Python's ``struct``, in brackets (``acc.x(f)``). All texts end in a zero byte. Then the
events: number, time (version 1: 32 bits of milliseconds, version 2: 64 bits of microseconds),
variables. The last four bytes are a CRC-32 of all before them.

Before 2021 (firmware's ``tools/usdlog`` of 2018) all variables were sampled together: the number of
columns (one byte) and their names, each with its letter in brackets and a comma (``acc.x(f),``).
The first is ``tick``, 32 bits of milliseconds. Then blocks of a count (one byte) and as many rows.
The header and each block end in a CRC-32, inverted.

The map ``cflib`` states the variables' meaning.
"""

import re
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import read_bytes
from ..channels import ChannelGroup
from ..flight_log import FlightLog, SomeVehicle
from ..log_map import load_map
from ..mapped_log import chosen, flight_log, sections_of
from ..table import Piece

_FIRST = b"tick(I),"  # first column of a log before 2021
BEGINS = rb"\xbc[\x01\x02]\0|[\x02-\xff]tick\(I\),"

Rows = NDArray[Any]  # events of one type
Layout = np.dtype[Any]  # an event's number, time and variables

Layouts = dict[int, Layout]  # by the events' numbers

WHAT = "a Crazyflie's SD-card log"
_START = re.compile(rb"\xbc([\x01\x02])\0(..)", re.DOTALL)
_EVENT = re.compile(rb"(..)([^\0]{0,200})\0(..)", re.DOTALL)
_VARIABLE = re.compile(rb"([^\0,]{1,200})\(([bBhHiIqQefd])\)[\0,]")
_TIMES = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}  # of a version: type, and s per unit


def read(path: Path, vehicle: SomeVehicle = None, piece: Piece = None) -> FlightLog:
    """Read an SD-card log; ``vehicle`` turns motor set points into rotor speeds.

    Raises:
        InputError: the file cannot be read, is no such log, or lacks motors, or a pose and inertial
            sensors.
    """
    data = read_bytes(path, WHAT, LIMITS.binary_log)
    if data[1:].startswith(_FIRST):
        version, (rows, end) = 1, _rows(path, data)
        runs, notes = [rows], [f"{WHAT}, of firmware before 2021"]
    else:
        version, kinds, begin = _header(path, data)
        runs, end = _events(path, data, kinds, begin)
        notes = [f"{WHAT}, version {version}"]
    # behind the last event stands nothing, or the checksum (CRC-32) of all before
    if data[end:] not in (b"", zlib.crc32(data[:end]).to_bytes(4, "little")):
        notes.append(
            f"the file is damaged or was cut {end} bytes from its start ({len(data) - end} bytes "
            "are left); what stands before was used"
        )
    events = []
    for rows in (rows for rows in runs if len(rows) > 1):
        t = _TIMES[version][1] * rows["time"].astype(float)
        with np.errstate(invalid="ignore"):  # spoiled bytes may make a signalling NaN
            columns = {name: rows[name].astype(float) for name in (rows.dtype.names or ())[2:]}
        events.append(ChannelGroup(t, columns))
    if not events:
        raise InputError(f"{path}: no event twice; expected at least two samples")
    first = min(samples.t[0] for samples in events)
    notes.append(f"times: the vehicle's clock, which stood at {first:.6g} s at the first event")
    log_map = load_map("cflib")
    there, _ = chosen(events, log_map)
    if there.position is None and None in (there.gyro, there.accelerometer):
        # as CrazyPAD's logs: rows of motor commands, for comparing flights
        log_map = replace(there, rows="whole", gyro=None, accelerometer=None)
        notes.append(
            "no pose, no gyro and no accelerometer in the log: it shows how the rotors share the "
            "work, and nothing else"
        )
    sections = sections_of(path, events, log_map, "crazyflie_sd", notes, piece)
    return flight_log(path, "crazyflie_sd", sections, vehicle)


def _header(path: Path, data: bytes) -> tuple[int, Layouts, int]:
    """Return the version, the layouts of the types of events by number, and where the events begin.

    Raises:
        InputError: the header is cut or says something else.
    """
    start = _part(path, data, 0, _START, "bc, the version 1 or 2, and the number of events")
    version, place = start[1][0], start.end()
    kinds: Layouts = {}
    for _ in range(int.from_bytes(start[2], "little")):
        event = _part(path, data, place, _EVENT, "an event's number, name and variables")
        number, many = (int.from_bytes(event[i], "little") for i in (1, 3))
        where = f"{path}: event {event[2].decode('ascii', 'replace')!r}"
        check_count(where, many, LIMITS.log_fields, "variables")
        kind, place = _layout(path, data, event.end(), many, ("<u2", _TIMES[version][0]))
        if number in kinds:
            raise InputError(f"{where}: its number stands there twice; expected each once")
        kinds[number] = kind
    return version, kinds, place


def _part(
    path: Path, data: bytes, place: int, pattern: re.Pattern[bytes], expected: str
) -> re.Match[bytes]:
    """Return a part of the header.

    Raises:
        InputError: something else stands there.
    """
    if match := pattern.match(data, place):
        return match
    raise InputError(f"{path}: byte {place} of its header: expected {expected}")


def _layout(
    path: Path, data: bytes, place: int, many: int, types: tuple[str, str]
) -> tuple[Layout, int]:
    """Return the layout of an event, by the types of its number and time and by the names of its
    variables, and the place behind the names.

    Raises:
        InputError: the header is cut, says something else, or names a variable twice.
    """
    fields = [*zip(("event", "time"), types, strict=True)]
    expected = "a variable's name and the letter of its type, one of b B h H i I q Q e f d"
    for _ in range(many):
        variable = _part(path, data, place, _VARIABLE, expected)
        name = variable[1].decode("ascii", "replace").strip()
        if name in dict(fields):
            raise InputError(f"{path}: {name!r} stands in its header twice; expected each once")
        fields.append((name, f"<{variable[2].decode()}"))
        place = variable.end()
    return np.dtype(fields), place


def _rows(path: Path, data: bytes) -> tuple[Rows, int]:
    """Return the rows of a log before 2021, as events, and the place of the first byte behind.

    Raises:
        InputError: the header is cut or says something else.
    """
    layout, place = _layout(path, data, 1 + len(_FIRST), data[0] - 1, ("V0", "<u4"))
    blocks, count, end = [], 0, place + 4
    while end < len(data):
        behind = end + 1 + data[end] * layout.itemsize + 4
        # the CRC-32 of a block and its own, inverted
        if not data[end] or zlib.crc32(data[end:behind]) != 0xFFFFFFFF:
            break
        blocks.append(data[end + 1 : behind - 4])
        count += data[end]
        end = behind
    check_count(path, count, LIMITS.table_rows, "rows")
    check_count(path, count * data[0], LIMITS.table_numbers, "numbers")
    return np.frombuffer(b"".join(blocks), layout), end


def _events(path: Path, data: bytes, kinds: Layouts, begin: int) -> tuple[list[Rows], int]:
    """Return the events of each type, and the place of the first byte behind."""
    runs: dict[int, list[Rows]] = {number: [] for number in kinds}
    place, count, numbers = begin, 0, 0
    while place + 2 <= len(data):
        number = data[place] | data[place + 1] << 8
        if number not in kinds:
            break
        layout = kinds[number]
        rows = np.frombuffer(data, layout, min((len(data) - place) // layout.itemsize, 4096), place)
        other = np.flatnonzero(rows["event"] != number)
        rows = rows[: other[0]] if other.size else rows
        if not len(rows):
            break
        runs[number].append(rows)
        place += len(rows) * layout.itemsize
        count += len(rows)
        numbers += len(rows) * len(layout.names or ())
        check_count(path, count, LIMITS.table_rows, "events")
        check_count(path, numbers, LIMITS.table_numbers, "numbers")
    return [np.concatenate(rows) for rows in runs.values() if rows], place
