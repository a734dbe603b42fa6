"""PX4 logs (``.ulg``), decoded by pyulog: the map ``px4`` states the topics' meaning; parameters
state the vehicle, and each rotor's motor, output and range.

**Times.** ``timestamp_sample`` where a topic has one. A ``vehicle_imu``'s gains of angle and
velocity become rates in the middle of their time.

**Rotors.** Rotor speeds of ``esc_status`` where ESCs report them; commands, 0 to 1, of
``actuator_motors``, else of ``actuator_outputs``. For commands alone, a vehicle with a
``motor_curve`` turns them into thrust. One without gets relative thrusts (``commanded_speeds``):
``actuator_motors`` itself (PX4 inverts its curve later), or ``f x^2 + (1 - f) x`` of an output x,
with f the parameter THR_MDL_FAC.

**Damage.** Some bytes of a ULog may stand for many objects: pyulog writes topics out field by field
for every subscription, with arrays and topics within topics. Every parameter, piece of information,
text and dropout becomes an object. Both are counted before they are made.
"""

import io
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....runtime.errors import InputError
from ....runtime.extras import need
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import check_regular, open_regular
from ..channels import ChannelGroup
from ..flight_log import FlightLog, SomeVehicle
from ..log_map import shipped_map, stated
from ..mapped_log import Sections, flight_log, sections_of
from ..table import (
    Array,
    ArrayMap,
    Data,
    NamedArrays,
    NamedNumbers,
    Piece,
    SomeArray,
    Values,
    one_line,
)
from ..what_flew import ORDERS, PLUS, QUADROTOR, Order, WhatFlew, order_by_places, slots_of_motors

BEGINS = rb"ULog\x01\x12\x35"
WHAT = "a PX4 log (ULog)"
_FILTER, _STATUS = "vehicle_local_position", "vehicle_status"
# columns, and the fields that say whether they are measured
_FLAGS = {
    "battery_status": {"voltage_v": "connected"},
    _FILTER: {"x": "xy_valid", "y": "xy_valid", "z": "z_valid"},
}
_SENSORS = (  # field of an inertial sensor, and field of its gain over a time
    ("gyro_rad", "delta_angle"),
    ("accelerometer_m_s2", "delta_velocity"),
)
_DEEPEST = 20  # topics within topics
_MOTOR1 = 101  # PX4's number of the output function "motor 1"
_BANKS = {"MAIN": "PWM_MAIN_FUNC", "AUX": "PWM_AUX_FUNC", "UAVCAN": "UAVCAN_EC_FUNC"}
_OUTPUTS = 16  # of a bank
_LARGEST_SHARE = 1.5  # an output beyond is no share, but of the protocol's range
_LEAST_PULSE = 700.0  # us: no speed controller is sent a shorter one, disarmed or not


_Topics = dict[str, list[ArrayMap]]  # columns of each instance


class Outputs(NamedTuple):
    """The outputs of motors 1 to 4, and their values for commands 0 and 1."""

    slots: list[int]  # from 0
    low: Array  # (4,) values of command 0
    high: Array  # (4,) values of command 1
    words: str  # protocol and range


def read(path: Path, vehicle: SomeVehicle = None, piece: Piece = None) -> FlightLog:
    """Read a ULog.

    Raises:
        InputError: pyulog is missing, the file is no ULog, or lacks four motors, or a pose and
            inertial sensors.
    """
    sections, flown = channels(path, vehicle, piece=piece)
    return flight_log(path, "px4_ulog", sections, vehicle, flown)


def channels(
    path: Path,
    vehicle: SomeVehicle = None,
    has_ranges: bool = True,
    piece: Piece = None,
) -> tuple[Sections, WhatFlew]:
    """Return a ULog's channels, each at its own rate, and its statements on its vehicle.

    Args:
        path: the file.
        vehicle: the vehicle, for its rotors' places; None: one in each quadrant.
        has_ranges: pulses are 0 to 1 in the parameters' range; False: from 1000 to 2000 us, for a
            fit of the thrust of idling rotors.
        piece: as of ``read``.

    Raises:
        InputError: pyulog is missing, the file is no ULog or no quadrotor's, or lacks four motors.
    """
    topics, stated, is_damaged = _read_ulog(path)
    flown = _what_flew(stated, topics.pop(_STATUS, []))
    flown.check(path)
    parameters = {
        n: x for n, x in stated.items() if has_ranges or not re.search(r"_(MIN|MAX)\d*$", n)
    }
    outputs = _outputs_of(path, topics.get("actuator_outputs", []), parameters)
    flown = replace(flown, outputs=outputs.words)
    order, order_note = _motor_order(path, stated, vehicle)
    log_map = shipped_map("recordings/px4").with_order(order)
    if stated.get("SIM_GZ_EN") and (rotors := log_map.rotors):
        note = f"{rotors.note}, in rad/s, as PX4 in Gazebo (SIM_GZ_EN = 1) writes them"
        log_map = log_map.with_ways({"rotors": [replace(rotors, unit="rad/s", note=note)]})
    motors, sent = log_map.ways("commands")
    factor = min(max(parameters.get("THR_MDL_FAC", 0.0), 0.0), 1.0)
    note = (
        f"commands: actuator_outputs, x = 0 to 1 ({outputs.words}), gives relative thrust "
        f"f x^2 + (1 - f) x with THR_MDL_FAC f = {factor:g}; motors 1 to 4 at outputs "
        f"{', '.join(str(slot + 1) for slot in outputs.slots)}"
    )
    columns = tuple(f"output[{slot}]" for slot in outputs.slots)
    sent = replace(sent, columns=columns, thrust_factor=factor, note=note)
    log_map = log_map.with_ways({"commands": [motors, sent]})
    notes = [*log_map.notes, order_note]
    if is_damaged:
        notes.append("the file is damaged or was cut; what could be read of it was used")
    batteries = [fields.get("connected", 1) for fields in topics.get("battery_status", [])]
    if batteries and not any(map(np.any, batteries)):
        notes.append("battery_status: no battery is connected (connected = 0), so no voltage")
    recorded = [
        samples
        for topic, instances in topics.items()
        for fields in instances
        for samples in _samples(topic, fields, outputs)
    ]
    empty = {s.topic for s in recorded if not s.columns} - {s.topic for s in recorded if s.columns}
    notes += [f"{topic}: not of four motors that turn; left out" for topic in sorted(empty)]
    sections = sections_of(path, recorded, log_map, "px4_ulog", notes, piece, flown)
    log_map, _, _, said = sections
    if log_map.position is not None and log_map.position.topic == _FILTER:
        fields = topics[_FILTER][0]
        resets = [
            name
            for name in ("xy_reset_counter", "z_reset_counter")
            if np.ptp(fields.get(name, 0.0)) > 0.0
        ]
        if resets:
            said.append(
                f"the onboard position was reset in the log ({', '.join(resets)}): it jumps there"
            )
    return sections, flown


def _read_ulog(path: Path) -> tuple[_Topics, NamedNumbers, bool]:
    """Return the topics of the map, the parameters at the log's start, and whether the file is
    damaged. A topic's instances are mappings from field to column.

    Raises:
        InputError: pyulog is missing, the file is no ULog, or larger than ``FileLimits`` allows.
    """
    need("pyulog", "logs", path)
    from pyulog import ULog as Parser

    wanted = shipped_map("recordings/px4").topics | {_STATUS}
    check_regular(path, WHAT, LIMITS.ulog_file)
    with one_line(f"{path}: cannot be read as a ULog", "a PX4 log (.ulg)"):
        # pyulog prints its doubts; the notes say them
        with open_regular(path, WHAT) as file, redirect_stdout(io.StringIO()):
            parsed = _counting(Parser)(file, sorted(wanted))
        with open_regular(path, WHAT) as file:  # each message states its length
            size, place = file.seek(0, os.SEEK_END), 16  # behind the file's header
            while place + 3 <= size:
                file.seek(place)
                place += 3 + int.from_bytes(file.read(2), "little")
        is_damaged = bool(parsed.file_corruption) or place != size
    topics: _Topics = {}
    for data in (one for one in parsed.data_list if "timestamp" in one.data):
        count = len(data.data["timestamp"])
        check_count(f"{path}: topic {data.name}", count, LIMITS.table_rows, "messages")
        with np.errstate(invalid="ignore"):  # spoiled bytes may make a signalling NaN
            fields = {name: x.astype(float) for name, x in data.data.items()}
        topics.setdefault(data.name, []).append(fields)
    parameters = {
        name: float(value)
        for name, value in parsed.initial_parameters.items()
        if isinstance(value, int | float) and np.isfinite(value)
    }
    return topics, parameters, is_damaged


def _samples(topic: str, fields: ArrayMap, outputs: Outputs) -> Iterator[ChannelGroup]:
    """Yield the columns of a topic's instance, as the map names them: none of an unused topic; two
    groups of an inertial sensor, for the times of gyro and accelerometer.
    """
    published = fields["timestamp"]
    sampled = fields.get("timestamp_sample", published)
    plausible = ((sampled > 0.0) & (abs(published - sampled) < 1e6)).all()
    t = 1e-6 * (sampled if plausible else published)
    if topic in ("sensor_combined", "vehicle_imu"):
        yield from (_sensor(topic, t, fields, *names) for names in _SENSORS)
        return
    columns = {name: x for name, x in fields.items() if "timestamp" not in name}
    if topic == "actuator_outputs":
        columns = _shares_of_outputs(columns, outputs)
    yield ChannelGroup(t, unified(topic, columns), topic)


def unified(topic: str, fields: ArrayMap) -> NamedArrays:
    """Return a topic's columns by the map's names; none of an unused topic."""
    columns = dict(fields)
    if topic == "esc_status":
        # the ESCs of motors 1 to 4: found by their functions, if all are stated
        functions = [columns.get(f"esc[{i}].actuator_function", [-1])[-1] for i in range(8)]
        reported = [f"esc[{i}].esc_rpm" for i in slots_of_motors(functions, _MOTOR1) or range(4)]
        if not set(reported) <= set(columns):
            return {}
        return {f"esc[{i}].esc_rpm": columns[name] for i, name in enumerate(reported)}
    if topic == "actuator_motors":
        # NaN: a motor is off
        columns = {n: np.nan_to_num(x).clip(0.0, 1.0) for n, x in columns.items()}
        is_used = any(np.any(columns.get(f"control[{i}]", 0.0) > 0.0) for i in range(4))
        return columns if is_used else {}
    for name, flag in _FLAGS.get(topic, {}).items():
        if {name, flag} <= set(columns):
            columns[name] = np.where(columns[flag] != 0.0, columns[name], np.nan)
    if topic.endswith("_odometry"):
        # in NED or in FRD fixed to the earth, both with z down: 1 and 2 since PX4 1.14, 0 and 1
        # before
        known = (1, 2) if "pose_frame" in columns else (0, 1)
        frame = columns.get("pose_frame", columns.get("local_frame", np.zeros(1)))
        there = np.isin(frame, known)
        for i, name in enumerate("xyz"):
            new = f"position[{i}]"
            if (stored := name if name in columns else new) in columns:  # x before PX4 1.14
                columns[new] = np.where(there, columns[stored], np.nan)
    return columns


def _sensor(topic: str, t: Array, fields: ArrayMap, field: str, gained: str) -> ChannelGroup:
    """Return a gyro or an accelerometer at its own times, as far as the topic has it."""
    source = field if topic == "sensor_combined" else gained
    stored = [f"{source}[{i}]" for i in range(3)]
    axes = {f"{field}{name[-3:]}": fields[name] for name in stored if name in fields}
    if f"{source}_dt" in fields:  # of gains
        span = 1e-6 * fields[f"{source}_dt"]
        axes = {n: column / np.where(span > 0.0, span, np.nan) for n, column in axes.items()}
        t = t - 0.5 * span
    late = fields.get("accelerometer_timestamp_relative", np.zeros(len(t)))
    if field == "accelerometer_m_s2" and (abs(late) < 1e6).all():
        t = t + 1e-6 * late
    return ChannelGroup(t, axes, topic)


class _TooMuchError(Exception):
    """Ends the parser: after all usual errors the parser goes on."""


def _counting(parser: Any) -> Any:
    """Return pyulog's class ``ULog``, with a _TooMuchError beyond ``FileLimits``."""
    counts: Counter[str] = Counter()

    def count(what: str, most: int, more: int = 1) -> None:
        counts[what] += more
        if counts[what] > most:
            raise _TooMuchError(f"more than {most} {what}")

    class AddLogged(parser._MessageAddLogged):  # type: ignore[misc]
        def _parse_format(self, message_formats: Data) -> None:
            count(
                "fields of its topics",
                LIMITS.ulog_fields,
                1 + _fields(self.message_name, message_formats, {}, 0),  # an empty one counts, too
            )
            super()._parse_format(message_formats)

    def counted(kind: Any) -> Any:
        class Counted(kind):  # type: ignore[misc]
            def __init__(self, *arguments: Any, **options: Any) -> None:
                count("parameters, pieces of information, texts and dropouts", LIMITS.ulog_texts)
                super().__init__(*arguments, **options)

        return Counted

    class Counting(parser):  # type: ignore[misc]
        _MessageAddLogged = AddLogged
        _MessageInfo = counted(parser._MessageInfo)
        MessageLogging = counted(parser.MessageLogging)
        MessageLoggingTagged = counted(parser.MessageLoggingTagged)
        MessageDropout = counted(parser.MessageDropout)

        def _check_packet_corruption(self, header: Any) -> bool:
            is_damaged = bool(super()._check_packet_corruption(header))
            count("places hold no message", LIMITS.ulog_damages, is_damaged)
            return is_damaged

    return Counting


def _fields(name: str, formats: Data, known: dict[str, int], depth: int) -> int:
    """Return the number of a topic's fields, with its arrays and inner topics written out."""
    if depth > _DEEPEST:
        raise _TooMuchError(f"topic {name[:100]!r} lies more than {_DEEPEST} deep in others")
    if name not in known:
        known[name] = sum(
            max(1, size) * (_fields(kind, formats, known, depth + 1) if kind in formats else 1)
            for kind, size, _ in formats[name].fields
        )
    return known[name]


def _what_flew(parameters: Values, statuses: Sequence[ArrayMap]) -> WhatFlew:
    """Return a log's statements on its vehicle.

    Args:
        parameters: as the log begins.
        statuses: instances of vehicle_status.
    """
    known = stated("airframes")
    count, frame, kind, start = (
        int(parameters.get(name, 0))
        for name in ("CA_ROTOR_COUNT", "CA_AIRFRAME", "MAV_TYPE", "SYS_AUTOSTART")
    )
    if frame in known["px4_airframe"]:
        return WhatFlew(known["px4_airframe"][frame], f"parameter CA_AIRFRAME = {frame}")
    if any(np.any(fields.get("is_vtol", 0)) for fields in statuses):
        return WhatFlew("a VTOL plane", "vehicle_status.is_vtol")
    types = (int(x) for fields in statuses for x in fields.get("system_type", ())[-1:])
    claims = (
        ("mav_type", kind, f"parameter MAV_TYPE = {kind}"),
        *(("mav_type", x, f"vehicle_status.system_type = {x}") for x in types),
        ("px4_start", start // 1000, f"parameter SYS_AUTOSTART = {start}"),
    )
    said = ((known[table][key], by) for table, key, by in claims if key in known[table])
    airframe, by = next(said, (QUADROTOR if count == 4 else "", ""))
    return WhatFlew(airframe, "parameter CA_ROTOR_COUNT" if count else by, count or None)


def _motor_order(path: Path, parameters: Values, vehicle: SomeVehicle) -> tuple[Order, str]:
    """Return PX4's motor of each of the vehicle's rotors, and a note on the source: the positions
    CA_ROTORn_PX and PY, the airframe's, else PX4's quad x.

    Raises:
        InputError: the motors stand otherwise than the vehicle's rotors, by default one in each
            quadrant.
    """
    start = int(parameters.get("SYS_AUTOSTART", 0))
    # PX4's body y points right
    places = [
        (parameters.get(f"CA_ROTOR{i}_PX", 0.0), -parameters.get(f"CA_ROTOR{i}_PY", 0.0))
        for i in range(4)
    ]
    said, whence = "", "as on PX4's quad x, which the log does not state"
    if parameters.get("CA_ROTOR_COUNT") and np.any(places):
        whence, said = "by the positions in CA_ROTORn_PX and PY", "CA_ROTORn_PX and CA_ROTORn_PY"
    elif start // 1000 == 5:
        places, whence = list(PLUS), f"as on a quad plus (SYS_AUTOSTART = {start})"
        said = f"SYS_AUTOSTART = {start}, a quad plus,"
    order = order_by_places(places, vehicle) if said else ORDERS["px4-x"]
    if order is None:
        raise InputError(
            f"{path}: parameters {said} put the rotors at {places} (x forward, y left); expected "
            "one in each quadrant, as on a quad x, or a vehicle file with these rotor_positions"
        )
    return order, (
        f"motors renumbered {whence}: rotors 1, 2, 3, 4 are motors {', '.join(map(str, order))}"
    )


def _outputs_of(path: Path, sent: Sequence[ArrayMap], parameters: Values) -> Outputs:
    """Return the motors' outputs, and their values for commands 0 and 1. Shares count as they are.
    DShot and UAVCAN, by parameters or by numbers beyond pulses, have the protocol's range. Pulses
    have each output's own parameter, the bank's, or PX4's default.

    Args:
        path: the file, for errors.
        sent: the instances of actuator_outputs.
        parameters: the vehicle's parameters.

    Raises:
        InputError: a range of pulses is none, or the outputs fit no protocol.
    """
    bank, slots = "MAIN", list(range(4))
    for name, prefix in reversed(_BANKS.items()):  # the first of several
        functions = [int(parameters.get(f"{prefix}{i + 1}", 0.0)) for i in range(_OUTPUTS)]
        if of_bank := slots_of_motors(functions, _MOTOR1):
            bank, slots = name, of_bank
    each = [_of_motors(fields, slots) for fields in sent]
    motors = next((motors for motors in each if motors is not None), np.zeros((0, 4)))
    most = motors.max(initial=0.0)
    turning = motors[motors > 0.5 * most]  # not the stop command
    usual = np.median(turning) if turning.size else _LEAST_PULSE

    def pulses(end: str, default: float) -> Array:
        """Return one end (4,) of the outputs' ranges of pulses, us."""
        names = ((f"PWM_{bank}_{end}{s + 1}", f"PWM_{bank}_{end}", f"PWM_{end}") for s in slots)
        return np.array([next((given[n] for n in one if n in given), default) for one in names])

    given = {name: x for name, x in parameters.items() if x > 0.0}
    lows, highs = pulses("MIN", 1000.0), pulses("MAX", 2000.0)
    # with a bus for sensors alone the motors have pulses, long ones at rest, too
    has_bus = parameters.get("UAVCAN_ENABLE", 0.0) >= 3.0 and (motors < _LEAST_PULSE).any()
    # DShot150 to DShot1200 are -5 to -2
    timers = [parameters.get(f"PWM_{bank}_TIM{i}", 0.0) for i in range(_OUTPUTS)]
    is_dshot = parameters.get("DSHOT_CONFIG", 0.0) > 0.0 or any(x in range(-5, -1) for x in timers)
    if 0.0 < most <= _LARGEST_SHARE:
        return Outputs(slots, np.zeros(4), np.ones(4), "shares of 1")
    is_uavcan = bank == "UAVCAN" or has_bus
    if is_uavcan or most > 1.1 * highs.max():  # no pulse is longer
        protocol, high, stated = "UAVCAN", 8191.0, is_uavcan
    elif is_dshot or usual < _LEAST_PULSE:
        protocol, high, stated = "DShot", 1999.0, is_dshot
    else:
        if not (highs > lows).all():
            raise InputError(
                f"{path}: the PWM_{bank}_MIN and MAX parameters of the motors' outputs are "
                f"{lows.tolist()} and {highs.tolist()}; expected MIN below MAX"
            )
        return Outputs(
            slots,
            lows,
            highs,
            f"pulses, of which one is above {_LARGEST_SHARE:g}: {lows.min():g} to "
            f"{highs.max():g} us",
        )
    if most > high:
        raise InputError(
            f"{path}: actuator_outputs reaches {most:g}; expected shares up to 1, pulses in us, "
            f"or numbers of {protocol} up to {high:g}"
        )
    why = "as parameters state" if stated else "since no pulses are like that"
    return Outputs(slots, np.zeros(4), np.full(4, high), f"{protocol}, 0 to {high:g}, {why}")


def _shares_of_outputs(columns: ArrayMap, outputs: Outputs) -> NamedArrays:
    """Return each output's values (N,) as 0 to 1, other outputs' in the motors' range; nothing if a
    motor's output never changes.
    """
    if _of_motors(columns, outputs.slots) is None:
        return {}
    low, high = (np.full(_OUTPUTS, end) for end in (outputs.low.min(), outputs.high.max()))
    low[outputs.slots], high[outputs.slots] = outputs.low, outputs.high
    return {
        name: ((np.nan_to_num(columns[name]) - low[i]) / (high[i] - low[i])).clip(0.0, 1.0)
        for i in range(_OUTPUTS)
        if (name := f"output[{i}]") in columns
    }


def _of_motors(columns: ArrayMap, slots: Sequence[int]) -> SomeArray:
    """Return the values of the motors' outputs (N, 4). None: one is missing or never changes, as of
    a servo, or of an unused bank.
    """
    each = [np.nan_to_num(columns.get(f"output[{slot}]", np.zeros(1))) for slot in slots]
    return np.column_stack(each) if all(np.ptp(one) > 0.0 for one in each) else None
