"""Blackboxes of Betaflight or INAV: as they are (``.bbl``, ``.bfl``, ``.txt``), and the tables of
blackbox_decode. The map ``betaflight`` states the fields' meaning, this module their units.

* **Accelerometer.** Counts: ``acc_1G`` of the header is one g; without a header, the power of two
  nearest to the length in the first half second. A quadrotor stands then: recording begins at
  arming.
* **Gyro.** Degrees per second, tenths of them where the header says ``blackbox_high_resolution``.
* **Commands.** Between the two numbers of the header's ``motorOutput``; without one, 48 to 2047
  (DShot) where a motor leaves 1000 to 2000, else 1000 to 2000.
* **Rotor speeds.** eRPM in hundreds: rpm is eRPM times 200 over the number of magnet poles, from
  the header (``motor_poles``) or the reader's option, else 14.
* **Voltage.** Hundredths of a volt.

A table has the log's numbers without the headers: these are inferred from the numbers, with a note.
A unit in a column's name is taken.

A file may hold several logs, one for each arming: the longest is read, and a note says so.
The core decodes its frames. orangebox 0.5.0, the library for these logs, cannot:
encoding 10 of Betaflight's logs is not written, and a cut log ends in a TypeError. In damaged logs
orangebox keeps wrong frames (398 of 400 where 369 are right). The tests use orangebox as a second
opinion on whole logs without encoding 10.
"""

import re
from collections import defaultdict
from collections.abc import Collection
from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .... import _core
from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import read_bytes
from ..channels import ChannelGroup, check_piece
from ..flight_log import FlightLog, SomeVehicle
from ..log_map import shipped_map
from ..mapped_log import MOST_VOLTS, flight_log, motors_left_out, sections_of
from ..table import Array, Lines, NamedArrays, Piece, Table, lengths

BEGINS = b"H Product:Blackbox"
Headers = defaultdict[str, str]
SIGNATURE = ("time (us)", "motor[0]", "motor[3]")

# stated units in the map's: g, degrees per second, volts
_UNITS = {"g": 1.0, "m/s2": 1.0 / 9.80665, "deg/s": 1.0, "rad/s": np.degrees(1.0)}
_UNITS |= {"V": 1.0, "mV": 1e-3}
_STANDING = 0.5  # s after arming without motion
_MORE_MOTORS = tuple(f"motor[{i}]" for i in range(4, 8))  # of other vehicles than quadrotors
_HUNDREDS = "(/100)"  # behind the name eRPM of some versions, which are all in hundreds
WHAT = "a blackbox of Betaflight or INAV"
_HEADERS = re.compile(rb"(H [^\n]{0,20000}\n){0,2000}")
# the numbers to which fields are added, and the letters of frames with fields
_PREDICTORS = (*range(12), 256)
_FRAMES = "IPSGH"


def read(
    path: Path, vehicle: SomeVehicle = None, option: str = "", piece: Piece = None
) -> FlightLog:
    """Read a blackbox: the longest log in the file, or number ``piece``, from 1; ``option``: number
    of the motors' magnet poles, for eRPM.

    Raises:
        InputError: the file cannot be read, has no such log, is no blackbox, is damaged from its
            start, or has no times, motors or inertial sensors.
    """
    _magnet_poles(path, option, "")  # a wrong option is said before a wrong file
    data = read_bytes(path, WHAT, LIMITS.binary_log)
    if not data.startswith(BEGINS):
        raise InputError(
            f"{path}: cannot be read as {WHAT}: it does not begin with {BEGINS.decode()!r}"
        )
    edges = [*(match.start() for match in re.finditer(BEGINS, data)), len(data)]
    logs = len(edges) - 1
    check_piece(path, piece, logs)
    chosen = int(np.diff(edges).argmax()) if piece is None else piece - 1
    start, end = edges[chosen : chosen + 2]
    begin = next(_HEADERS.finditer(data, start, end)).end()
    if data[begin : begin + 2] == b"H ":
        raise InputError(f"{path}: its headers do not end; expected frames behind them")
    text = data[start:begin].decode("ascii", "replace")
    pairs = (line.removeprefix("H ").partition(":") for line in text.split("\n"))
    headers = defaultdict(str, {key.strip(): value.strip() for key, _, value in pairs})
    version = headers.get("Data version", "2")
    if version != "2":
        raise InputError(f"{path}: header Data version: {version[:20]!r}; expected 2")
    names = headers["Field I name"].replace(_HUNDREDS, "").split(",")
    layout = _layout(path, headers, names)
    wanted = [*shipped_map("recordings/betaflight").wanted, *_MORE_MOTORS]
    keep = [name for name in wanted if name in names]
    if "time" not in keep:
        raise InputError(f"{path}: no field time; found {', '.join(names[:20])}")
    where = np.array([*map(names.index, keep)], np.int64)
    frames = np.frombuffer(data[:end], np.uint8)
    most = min(LIMITS.table_rows, LIMITS.table_numbers // len(keep))
    rows = np.empty((most + 1, len(keep)), np.int64)  # memory is taken as filled
    count, lost = _core.decode_blackbox(frames, begin, *[*layout, where, rows])
    check_count(path, count, most, "frames")
    if count < 2:
        raise InputError(f"{path}: {count} frame(s) that can be decoded; expected at least two")
    notes = [f"blackbox of {headers.get('Firmware revision', 'an unknown firmware')[:60]}"]
    if logs > 1:
        notes.append(
            f"the file holds {logs} logs; number {chosen + 1} was read (default: the longest; "
            "--piece reads another)"
        )
    if lost:
        notes.append(f"{lost} frame(s) of {count + lost} could not be decoded and were left out")
    notes += motors_left_out(names, wanted)
    fields = dict(zip(keep, rows[:count].T.astype(float), strict=True))
    return _log(path, "betaflight", fields, set(), headers, option, vehicle, notes)


def read_table(
    table: Table, vehicle: SomeVehicle = None, option: str = "", piece: Piece = None
) -> FlightLog:
    """Read a table of blackbox_decode; ``option``: number of the motors' magnet poles, for eRPM.

    Raises:
        InputError: the numbers are none of a blackbox.
    """
    path = table.path
    wanted = {*shipped_map("recordings/betaflight").wanted, *_MORE_MOTORS}
    scales, names = {}, {"time": "time (us)"}
    for name in table.header:
        field, _, unit = name.replace(_HUNDREDS, "").removesuffix(")").partition(" (")
        if field in wanted and unit in ("", *_UNITS):
            names[field] = name
            if unit:
                scales[field] = _UNITS[unit]
    read = table.read([*names.values()])
    fields = {field: scales.get(field, 1.0) * read[name] for field, name in names.items()}
    notes = [*table.notes, *motors_left_out(table.header, names.values())]
    none: Headers = defaultdict(str)
    return _log(path, "betaflight_csv", fields, {*scales}, none, option, vehicle, notes, piece)


def _log(
    path: Path,
    reader: str,
    fields: NamedArrays,
    stated: set[str],
    headers: Headers,
    option: str,
    vehicle: SomeVehicle,
    notes: Lines,
    piece: Piece = None,
) -> FlightLog:
    """Return the log of a blackbox's fields (N,); the ``stated`` ones are in the map's units.

    Raises:
        InputError: no motors, or no gyro and accelerometer.
    """
    log_map = shipped_map("recordings/betaflight")
    t = 1e-6 * fields.pop("time")
    groups = {
        kind: [name for name in fields if name.startswith(kind) and name not in stated]
        for kind in ("motor", "eRPM", "gyro", "acc", "vbat")
    }
    said = [*notes, *log_map.notes]
    scales = {"gyro": _gyro_scale(headers), "vbat": 0.01}
    if groups["motor"]:
        low, high, whence = _range(path, [fields[name] for name in groups["motor"]], headers)
        scales["motor"] = 1.0 / (high - low)
        for name in groups["motor"]:
            fields[name] -= low
        said.append(f"commands: {low:g} to {high:g} ({whence}) taken as 0 to 1")
    poles, whence = _magnet_poles(path, option, headers["motor_poles"])
    if any((fields[name] > 0.0).any() for name in groups["eRPM"]):
        scales["eRPM"] = 200.0 / poles
        said.append(f"eRPM: {poles} magnet poles ({whence})")
    if groups["acc"]:
        counts, words = _one_g(t, [fields[name] for name in groups["acc"]], headers)
        scales["acc"] = 1.0 / counts
        said.append(words)
    for kind, scale in scales.items():
        for name in groups[kind]:
            fields[name] *= scale
    for name in ("vbatLatest", "vbat"):
        if name in stated and (volts := np.median(fields[name])) > MOST_VOLTS:
            fields[name] *= 0.1
            said.append(
                f"{name}: {volts:.4g} V is more than a vehicle's battery has: taken as a tenth, as "
                "blackbox_decode writes logs of Betaflight before 4.3"
            )
    sections = sections_of(path, [ChannelGroup(t, fields)], log_map, reader, said, piece)
    return flight_log(path, reader, sections, vehicle)


def _gyro_scale(headers: Headers) -> float:
    """Return the gyro's count in deg/s: the bits of a number in the header, of degrees per second,
    or of radians per microsecond in Baseflight's.
    """
    fine = 0.1 if headers["blackbox_high_resolution"] == "1" else 1.0
    try:
        bits = int(headers["gyro_scale"] or headers["gyro.scale"], 16)
        scale = float(np.array(bits, "<u4").view("<f4"))
    except (ValueError, OverflowError):
        return fine
    if not 1e-12 < scale < 1e3:
        return fine
    return fine * scale * (1e6 * _UNITS["rad/s"] if scale < 1e-5 else 1.0)


def _range(path: Path, motors: list[Array], headers: Headers) -> tuple[float, float, str]:
    """Return the values of the commands 0 and 1, and whence they are known.

    Raises:
        InputError: the header's are none.
    """
    if stated := headers["motorOutput"]:
        try:
            low, high = map(float, stated.split(","))
        except ValueError:
            low = high = 0.0
        if not 0.0 <= low < high <= 1e5:
            raise InputError(
                f"{path}: header motorOutput: {stated[:60]!r}; expected two rising numbers"
            )
        return low, high, "motorOutput of the header"
    least, most = (_whole_number(headers[f"{end}throttle"], 1, 10**9) for end in ("min", "max"))
    if 0 < least < most:
        return least, most, "minthrottle and maxthrottle of the header"
    if any(((x > 2000.0) | ((x < 1000.0) & (x > 0.0))).any() for x in motors):
        return 48.0, 2047.0, "assumed: DShot, no header says it"
    return 1000.0, 2000.0, "assumed: pulses in us, no header says it"


def _magnet_poles(path: Path, option: str, stated: str) -> tuple[int, str]:
    """Return the number of the motors' magnet poles, and its source: the reader's option or the
    header.

    Raises:
        InputError: the option is none.
    """
    if option:
        if (poles := _whole_number(option, 2, 999)) and poles % 2 == 0:
            return poles, "as the reader's option says"
        raise InputError(
            f"{path}: reader option {option!r}; expected the motors' number of magnet poles, even, "
            "such as betaflight:14"
        )
    if poles := _whole_number(stated, 2, 100):
        return poles, "motor_poles of the header"
    return 14, "assumed; betaflight:NUMBER says another"


def _one_g(t: Array, force: list[Array], headers: Headers) -> tuple[float, str]:
    """Return the accelerometer's counts of 1 g, and words on whence they are known."""
    if stated := _whole_number(headers["acc_1G"], 1, 10**6):
        return stated, f"accelerometer: acc_1G of the header: {stated} counts are 1 g"
    length = lengths(np.column_stack(force)[t <= t[0] + _STANDING])
    middle = np.nanmedian(length) if np.isfinite(length).any() else 0.0
    counts = 2.0 ** float(np.clip(np.rint(np.log2(max(middle, 1.0))), 8, 14))
    return counts, (
        f"accelerometer: {counts:g} counts taken as 1 g, from its {middle:.4g} in the first "
        f"{_STANDING:g} s; no header says it"
    )


def _whole_number(text: str, least: int, most: int, default: int = 0) -> int:
    """Return a header's whole number, or the default for no whole number between two limits."""
    is_whole = text.lstrip("-").isdecimal() and len(text) <= 10
    return int(text) if is_whole and least <= int(text) <= most else default


def _layout(path: Path, headers: Headers, names: Lines) -> list[NDArray[np.int64]]:
    """Return the frames' layout from the headers, as the core takes it: the encodings (6, F) of I,
    P, S, G and H frames and none; their predictors (6, F); the number of fields (5,) of each; the
    intervals (3,) of I frames, and numerator and denominator of P frames, in loops; the constants
    (257,) of the predictors; and the places (3,) of loopIteration, time and motor[0], -1: none.
    I and P frames have the same fields.

    Raises:
        InputError: the headers contradict themselves, or name something unknown.
    """
    check_count(path, len(names), LIMITS.log_fields, "fields")
    predictors, encodings = (
        [_numbers(path, headers, f"Field {letter} {what}", known) for letter in _FRAMES]
        for what, known in (("predictor", _PREDICTORS), ("encoding", (0, 1, 3, 6, 7, 8, 9, 10)))
    )
    for letter, one, other in zip(_FRAMES, predictors, encodings, strict=True):
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
        return _whole_number(text, -999_999_999, 999_999_999, default)

    top, _, bottom = headers.get("P interval", "1/1").rpartition("/")
    every = headers.get("I interval", "32")
    intervals = [max(1, number(text, 1)) for text in (every, top, bottom)]
    constants = np.zeros(max(_PREDICTORS) + 1, np.int64)
    constants[4] = number(headers["minthrottle"], 1150)
    constants[8], constants[9] = 1500, number(headers["vbatref"], 4095)
    constants[11] = number(headers["motorOutput"].split(",")[0], 0)
    rows = (  # with zeros behind them
        np.array(list(zip_longest(*lists, [0], fillvalue=0)), np.int64).T.copy()
        for lists in (encodings, predictors)
    )
    counts = [*map(len, encodings)]
    return [*rows, *(np.array(x, np.int64) for x in (counts, intervals, constants, places))]


def _numbers(path: Path, headers: Headers, key: str, known: Collection[int]) -> list[int]:
    """Return the numbers of a header.

    Raises:
        InputError: one is unknown.
    """
    texts = headers[key].split(",") if headers[key] else []
    expected = [*map(str, known)]
    if bad := [text for text in texts if text.strip() not in expected]:
        raise InputError(
            f"{path}: header {key}: {bad[0][:20]}; expected one of {', '.join(expected)}"
        )
    return [*map(int, texts)]
