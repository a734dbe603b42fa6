"""ArduPilot logs (DataFlash, ``.BIN``): the map ``ardupilot`` states the messages' meaning,
parameters the rest.

**Motors.** ESC telemetry (ESC, rpm), if logged, else pulses (RCOU, us) of the outputs of motors 1
to 4 by SERVOn_FUNCTION, else of 1 to 4. MOT_PWM_MIN to MOT_PWM_MAX are 0 to 1. ArduPilot takes
thrust as ``(1 - e) a + e a^2`` with e = MOT_THST_EXPO, where ``a`` is the command between
MOT_SPIN_MIN and MOT_SPIN_MAX. A vehicle with a motor curve turns commands into thrust by its own;
one without gets ArduPilot's (``commanded_speeds``).

**Order.** By FRAME_TYPE: X and H (1 front-right, 2 rear-left, 3 front-left, 4 rear-right),
Betaflight's, DJI's, and clockwise from front-right. X is assumed where the log states none.

**Form.** The log describes its own messages. Each begins with A3 95 and its type's number. Type
128, FMT, states of a type its number, its length, its name, and the letters and names of its
columns. pymavlink reads such logs, too: as Python objects, one by one, in 14 times the time, with a
printed line for each damaged byte, and with 100 MB of disk. pymavlink opens 20 million empty
messages in 161 s and 1.1 GB. Here the core notes the messages' places, and wanted columns are read
at once: any file costs a bounded time. Ground stations turn such a log into text (``.log``): a
message a line, its type's name first, FMT among them, and numbers in whole units.
"""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from .... import _core
from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import read_bytes
from ..channels import ChannelGroup, Groups, in_order
from ..flight_log import FlightLog, SomeVehicle
from ..log_map import LogMap, shipped_map, stated
from ..mapped_log import MOST_VOLTS, flight_log, sections_of
from ..table import Array, Lines, NamedNumbers, Noted, Piece, Values, Wanted
from ..what_flew import (
    ORDERS,
    PLUS,
    UNSTATED,
    Order,
    WhatFlew,
    order_by_places,
    order_words,
    slots_of_motors,
)

_EARTH = 6_378_137.0  # m
_PLACE = ("Lat", "Lng", "Alt")  # of POS
_PLUS = 0  # of FRAME_TYPE, and of FRAME before Copter 3.5
_MOTOR1 = 33  # of SERVOn_FUNCTION
_CHANNELS = 14  # of RCOU
Rows = NDArray[Any]
Layout = np.dtype[Any]
Messages = dict[str, Rows]  # (N,) of one type: columns by name, numbers or bytes of texts

ByType = dict[str, Messages]

_AS_TEXT = b"FMT, 128, 89, FMT,"  # stands in a log as text
BEGINS = b"\xa3\x95|(?s:.*)" + _AS_TEXT
WHAT = "an ArduPilot log (DataFlash .BIN)"
_HEAD = 3  # bytes of a message before its columns
_FORMAT = np.dtype("u1, u1, S4, S16, S64")  # number, length, name, letters and columns of a type
# types of columns by their letters, as of ``struct`` and further ones; and units of columns other
# than 1
_TYPES = {letter: f"<{letter}" for letter in "bBhHiIqQfd"}
_TYPES |= {"a": "(32,)<i2", "g": "<f2", "n": "S4", "N": "S16", "Z": "S64", "M": "<B"}
_TYPES |= {"c": "<h", "C": "<H", "e": "<i", "E": "<I", "L": "<i"}
_UNITS = dict.fromkeys("cCeE", 0.01) | {"L": 1e-7}


def read(path: Path, vehicle: SomeVehicle = None, piece: Piece = None) -> FlightLog:
    """Read a DataFlash log.

    Raises:
        InputError: the file is no such log, is not a quadrotor's, or lacks motors, or a pose and
            inertial sensors.
    """
    log_map = shipped_map("recordings/ardupilot")
    messages, skipped = read_dataflash(path, {*log_map.topics, "PARM", "MSG", "MOT", "TIME"})
    if "StartTime" in messages.pop("TIME", {}):
        raise InputError(
            f"{path}: is a PX4 log of before 2016 (sdlog2), which has the same first bytes; "
            f"expected {WHAT}, or a PX4 log as ULog"
        )
    stated = messages.pop("PARM", {})
    pairs = zip(_texts(stated, "Name"), stated.get("Value", np.empty(0)).tolist(), strict=False)
    # as the log first states them
    parameters = {name: x for name, x in reversed(list(pairs)) if isfinite(x)}
    flown = _what_flew(parameters, messages.pop("MSG", {}))
    flown.check(path)
    pulses = messages.get("RCOU", {})
    if "MOT" in messages and not pulses:
        raise InputError(
            f"{path}: MOT has the motors' outputs without their times, as Copter before 3.2 logged "
            "them; expected RCOU with TimeMS or TimeUS"
        )
    # Ch before Copter 3.4, Chan before 3.3
    messages["RCOU"] = {re.sub(r"Ch(an)?(?=\d)", "C", name): x for name, x in pulses.items()}
    log_map, notes = _with_parameters(path, log_map, parameters, vehicle)
    volts = messages.get("CURR", {}).get("Volt", np.zeros(1))
    if np.median(volts) > MOST_VOLTS:
        messages["CURR"]["Volt"] = 0.01 * volts
        notes.append("CURR: hundredths of a volt, as Copter before 3.4 logged them")
    telemetry = _telemetry(messages.pop("ESC", {}), parameters, notes)
    columns = {*log_map.wanted, *_PLACE, *(f"C{i + 1}" for i in range(_CHANNELS))}
    if skipped:
        notes.append(f"{skipped} bytes of the file belong to no message; it was cut or is damaged")
    recorded = [*(_samples(name, rows, columns) for name, rows in messages.items()), *telemetry]
    groups = [samples for samples in recorded if len(samples.t) > 1]
    sections = sections_of(path, groups, log_map, "ardupilot_bin", notes, piece, flown)
    return flight_log(path, "ardupilot_bin", sections, vehicle, flown)


def _times(messages: Messages) -> Array:
    """Return times (N,) in s of the vehicle's clock."""
    if "TimeUS" in messages:
        return 1e-6 * messages["TimeUS"]
    return 1e-3 * messages.get("TimeMS", np.empty(0))


def _samples(name: str, messages: Messages, columns: set[str]) -> ChannelGroup:
    """Return some columns of a type's messages, of the first core, sensor or battery. Places become
    north, east, down in m from the first.
    """
    for number in ("C", "I", "Inst"):
        if number in messages:
            first = messages[number] == messages[number].min()
            messages = {name: column[first] for name, column in messages.items()}
    kept = {name: column for name, column in messages.items() if name in columns}
    if set(_PLACE) <= set(kept):
        north, east, altitude = (kept.pop(name) for name in _PLACE)  # degrees, and m
        east = (east - east[0]) * np.cos(np.radians(north[0]))
        kept |= {"N": _EARTH * np.radians(north - north[0]), "E": _EARTH * np.radians(east)}
        kept["D"] = -altitude
    return ChannelGroup(_times(messages), kept, name)


def _texts(messages: Messages, column: str) -> Lines:
    return [x.decode("ascii", "replace").strip("\0 ") for x in messages.get(column, ())]


def _what_flew(parameters: Values, messages: Messages) -> WhatFlew:
    """Return a log's statements on its vehicle, from texts, else from parameters."""
    known = stated("airframes")
    for text in _texts(messages, "Message"):
        for begin, airframe in known["ardupilot_text"].items():
            if text.startswith(begin):
                is_vtol = parameters.get("Q_ENABLE", 0.0) > 0.0 and begin == "ArduPlane"
                return WhatFlew("a VTOL plane" if is_vtol else airframe, f"MSG {text[:40]!r}")
    for name, airframe in known["ardupilot_parameter"].items():
        if name in parameters:
            return WhatFlew(airframe, f"parameter {name}")
    if "FRAME_CLASS" in parameters:
        number = int(parameters["FRAME_CLASS"])
        airframe = known["ardupilot_class"].get(number, "an unknown frame")
        return WhatFlew(airframe, f"parameter FRAME_CLASS = {number}")
    motors = len({*_functions(parameters)} & {*range(_MOTOR1, _MOTOR1 + 8)})
    return WhatFlew("", "SERVOn_FUNCTION", motors) if motors else UNSTATED


def _functions(parameters: Values) -> list[int]:
    """Return each output's function."""
    return [int(parameters.get(f"SERVO{i}_FUNCTION", 0)) for i in range(1, _CHANNELS + 1)]


def _order(path: Path, parameters: Values, vehicle: SomeVehicle) -> tuple[Order, str]:
    """Return the motor of each of the vehicle's rotors, and a note on the source.

    Raises:
        InputError: the motors stand otherwise than the vehicle's rotors.
    """
    name = "FRAME_TYPE" if "FRAME_TYPE" in parameters or "FRAME" not in parameters else "FRAME"
    if name not in parameters and "FRAME_CLASS" not in parameters:
        order = ORDERS["ardupilot-x"]
        return order, f"quad x assumed, which the log does not state: {order_words(order)}"
    kind = int(parameters.get(name, 1))
    if kind == _PLUS and (motors := order_by_places(PLUS, vehicle)):
        return motors, (
            f"{name} 0, a plus: rotors 1, 2, 3, 4 of the vehicle are motors "
            f"{', '.join(map(str, motors))}"
        )
    known = stated("airframes")["ardupilot_order"]
    if kind not in known:
        what, end = f"{kind}", ""
        if kind == _PLUS:
            what, end = "0, a plus,", ", or a vehicle file with rotor_positions of a plus"
        raise InputError(
            f"{path}: parameter {name} is {what} whose rotors do not stand as the vehicle's; "
            f"expected one of {', '.join(map(str, known))}, whose rotors stand in an x{end}"
        )
    order = ORDERS[known[kind]]
    return order, f"{name} {kind}: {order_words(order)}"


def _with_parameters(
    path: Path, log_map: LogMap, parameters: Values, vehicle: SomeVehicle
) -> Noted[LogMap]:
    """Return the map with the order of the motors, and with their outputs, range and thrust curve;
    and notes.

    Raises:
        InputError: the frame is no quad x, or the pulses' range is none.
    """
    order, note = _order(path, parameters, vehicle)
    given = parameters.get
    low, high = given("MOT_PWM_MIN", 0.0), given("MOT_PWM_MAX", 0.0)
    whence = "MOT_PWM_MIN and MAX"
    if low <= 0.0 or high <= 0.0:
        low, high = given("RC3_MIN", 1000.0), given("RC3_MAX", 2000.0)
        whence = "RC3_MIN and MAX" if "RC3_MIN" in parameters else "an assumption"
    if not low < high:
        raise InputError(
            f"{path}: parameters {whence} are {low:g} and {high:g} us; expected MIN below MAX"
        )
    expo = min(max(given("MOT_THST_EXPO", 0.65), 0.0), 1.0)
    least, most = given("MOT_SPIN_MIN", 0.15), given("MOT_SPIN_MAX", 0.95)
    if not 0.0 <= least < most:
        least, most = 0.0, 1.0
    slots = slots_of_motors(_functions(parameters), _MOTOR1) or range(4)
    outputs = [str(slot + 1) for slot in slots]
    assert log_map.commands is not None
    commands = replace(
        log_map.commands,
        columns=tuple(f"C{output}" for output in outputs),
        range=(low, high),
        thrust_factor=expo,
        thrust_span=(least, most),
        note=f"commands: RCOU, {low:g} to {high:g} us ({whence}) taken as 0 to 1; motors 1 to 4 at "
        f"outputs {', '.join(outputs)}. ArduPilot takes thrust as (1 - e) a + e a^2 "
        f"with e = {expo:g} (MOT_THST_EXPO) of a = 0 to 1 at the commands {least:g} to {most:g}",
    )
    return replace(log_map, commands=commands).with_order(order), [*log_map.notes, note]


def _telemetry(messages: Messages, parameters: Values, notes: Lines) -> Groups:
    """Return the ESCs' reports of motors 1 to 4, at the times of the first ESC; ``notes`` get a
    further one.
    """
    if not {"Instance", "RPM", "TimeUS"} <= set(messages):
        return []
    slots, which = slots_of_motors(_functions(parameters), _MOTOR1), messages["Instance"]
    if not slots or not np.isin(slots, which).all():
        slots = [0, 1, 2, 3]
    each, known = [], np.isfinite(messages["RPM"])
    for slot in slots:
        times, rpm = (x[known & (which == slot)] for x in (_times(messages), messages["RPM"]))
        if len(rpm) < 2 or not (rpm > 0.0).any():
            notes.append("ESC telemetry: not of all four motors, or without rpm; left out")
            return []
        rows, _ = in_order(times)
        each.append((times[rows], rpm[rows]))
    t = each[0][0]
    columns = {f"RPM {motor}": np.interp(t, *one) for motor, one in enumerate(each, 1)}
    poles = parameters.get("SERVO_BLH_POLES", 14.0)
    notes.append(
        f"rotor speeds: measured by the ESCs (ESC), with {poles:g} magnet poles as ArduPilot took "
        "them"
    )
    return [ChannelGroup(t, columns, "ESC")]


def read_dataflash(path: Path, wanted: Wanted) -> tuple[ByType, int]:
    """Return the messages of the wanted types, by type, and the number of bytes outside messages.

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
    count, used = _core.walk_dataflash(data, places, kinds)
    places, kinds = places[:count], kinds[:count]  # take memory as they were filled
    by_type = {}
    formats = places[kinds == 128][:100_000]  # FMT
    if not len(formats):
        raise InputError(f"{path}: cannot be read as {WHAT}: no FMT message; expected some")
    for number, (name, layout, units) in _layouts(_rows(data, formats, _FORMAT), wanted).items():
        of_kind = places[kinds == number]
        check_count(f"{path}: {name}", len(of_kind), LIMITS.table_rows, "messages")
        if len(of_kind):
            rows = _rows(data, of_kind, layout)
            with np.errstate(invalid="ignore"):  # spoiled bytes may make a signalling NaN
                by_type[name] = {
                    column: x if x.dtype.kind == "S" else x.astype(float) * unit
                    for column, unit in units.items()
                    if (x := rows[column]).ndim == 1  # no list of numbers
                }
    return by_type, len(data) - int(used)


def _of_text(path: Path, content: bytes, wanted: Wanted) -> ByType:
    """Return the messages of the wanted types, of a log as text. The lines before the first FMT
    count as MSG: old logs name the vehicle there. Cut lines are left out.
    """
    before, _, lines = content.partition(b"FMT,")
    names: dict[str, Lines] = {}
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
    by_type = {}
    for name, messages in rows.items():
        check_count(f"{path}: {name}", len(messages), LIMITS.table_rows, "messages")
        columns = dict(zip(names[name], zip(*messages, strict=True), strict=True))
        by_type[name] = {
            # PARM's and MSG's
            column: np.char.strip(np.array(x)) if column in ("Name", "Message") else _numbers(x)
            for column, x in columns.items()
        }
    said = by_type.get("MSG", {}).get("Message", ())
    by_type["MSG"] = {"Message": np.array([*before.splitlines(), *said, b""])}
    return by_type


def _numbers(texts: Sequence[bytes]) -> NDArray[np.float64]:
    """Return texts as numbers (N,); NaN: not a number."""
    numbers = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        with suppress(ValueError):
            numbers[i] = float(text)
    return numbers


def _rows(data: NDArray[np.uint8], places: NDArray[np.int32], layout: Layout) -> Rows:
    """Return the messages (N,) at places (N,), by their layout."""
    return sliding_window_view(data[_HEAD:], layout.itemsize)[places].view(layout)[:, 0]


def _layouts(formats: Rows, wanted: Wanted) -> dict[int, tuple[str, Layout, NamedNumbers]]:
    """Return name, layout and units of the wanted types, by number; types with a wrong length are
    left out.
    """
    layouts = {}
    for number, length, *texts in formats.tolist():
        name, letters, joined = (x.split(b"\0")[0].decode("ascii", "replace") for x in texts)
        columns = joined.split(",")
        is_known = {*letters} <= _TYPES.keys() and "" not in columns
        if not (name in wanted and is_known and len(letters) == len(columns) == len({*columns})):
            continue
        layout = np.dtype([*zip(columns, map(_TYPES.__getitem__, letters), strict=True)])
        units = {column: _UNITS.get(x, 1.0) for column, x in zip(columns, letters, strict=True)}
        if layout.itemsize + _HEAD == length:
            layouts[number] = name, layout, units
    return layouts
