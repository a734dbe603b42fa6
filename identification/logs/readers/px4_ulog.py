"""PX4 logs (``.ulg``), decoded by pyulog: the map ``px4`` says what their topics mean, parameters
which motor is which rotor (``px4_motors``).

**Times.** Those of ``timestamp_sample`` where a topic has them. Angles and velocities that a
``vehicle_imu`` gained over a time become rates in the middle of that time.

**Rotors.** Rotor speeds of ``esc_status`` where ESCs report them; commands, 0 to 1, of
``actuator_motors``, else of ``actuator_outputs``. Where there are commands alone, a vehicle with a
``motor_curve`` turns them into thrust. One without gets relative thrusts (``commanded_speeds``):
``actuator_motors`` itself (PX4 inverts its curve after it), or ``f x^2 + (1 - f) x`` of an output
x, with f the parameter THR_MDL_FAC.
"""

import io
import os
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

import numpy as np

from ....dynamics.vehicle import Vehicle
from ....runtime.extras import need
from ....runtime.file_limits import LIMITS, check_count
from ....runtime.regular_files import check_regular, open_regular
from ..channels import Samples
from ..flight_log import FlightLog
from ..log_map import shipped_map
from ..mapped_log import recording_of
from ..streams import Recording
from ..table import Array, one_line
from .px4_motors import (
    Outputs,
    motor_order,
    outputs_of,
    shares_of_outputs,
    slots_of_escs,
    what_flew,
    with_motors,
    without_ranges,
)
from .ulog_counting import counting

Fields = Mapping[str, Array]  # (N,) of an instance of a topic, by name

BEGINS = rb"ULog\x01\x12\x35"
WHAT = "a PX4 log (ULog)"
_FILTER, _STATUS = "vehicle_local_position", "vehicle_status"
_SENSORS = (  # field of an inertial sensor, and that of what it gained over a time
    ("gyro_rad", "delta_angle"),
    ("accelerometer_m_s2", "delta_velocity"),
)
_MICROSECOND = 1e-6  # s
_HEADER, _MESSAGE = 16, 3  # bytes, of a file and of a message


def read(path: Path, vehicle: Vehicle | None = None, piece: int | None = None) -> FlightLog:
    """Read a ULog.

    Raises:
        InputError: pyulog is missing, the file is no ULog, or lacks four motors, or a pose and
            inertial sensors.
    """
    return channels(path, vehicle, piece=piece).log(vehicle)


def channels(
    path: Path,
    vehicle: Vehicle | None = None,
    has_ranges: bool = True,
    piece: int | None = None,
) -> Recording:
    """Return a ULog's channels, each at its own rate.

    Args:
        path: the file.
        vehicle: whose rotors the motors are; None: one in each quadrant.
        has_ranges: pulses are 0 to 1 in the range that parameters state; False: from 1000 to 2000
            us, for what finds the thrust of idling rotors itself.
        piece: as of ``read``.

    Raises:
        InputError: pyulog is missing, the file is no ULog or no quadrotor's, or lacks four motors.
    """
    topics, stated, is_damaged = read_ulog(path)
    flown = what_flew(stated, topics.pop(_STATUS, []))
    flown.check(path)
    parameters = stated if has_ranges else without_ranges(stated)
    outputs = outputs_of(path, topics.get("actuator_outputs", []), parameters)
    flown = replace(flown, outputs=outputs.words)
    order, order_note = motor_order(path, stated, vehicle)
    log_map = with_motors(shipped_map("recordings/px4"), order, parameters, outputs)
    notes = [*log_map.notes, order_note]
    if is_damaged:
        notes.append("the file is damaged or was cut; what could be read of it was used")
    batteries = topics.get("battery_status", [])
    if batteries and all(not np.any(fields.get("connected", 1)) for fields in batteries):
        notes.append("battery_status: no battery is connected (connected = 0), so no voltage")
    recorded = [
        samples
        for topic, instances in topics.items()
        for fields in instances
        for samples in _samples(topic, fields, outputs)
    ]
    recording = recording_of(path, recorded, log_map, "px4_ulog", notes, piece, flown)
    position = recording.log_map.position
    if position is not None and position.topic == _FILTER:
        fields = topics[_FILTER][0]
        counters = ("xy_reset_counter", "z_reset_counter")
        resets = [name for name in counters if name in fields and np.ptp(fields[name]) > 0.0]
        if resets:
            recording.notes.append(
                f"the onboard position was reset in the log ({', '.join(resets)}): it jumps there"
            )
    return recording


def read_ulog(path: Path) -> tuple[dict[str, list[Fields]], dict[str, float], bool]:
    """Return the instances of each topic that the map names, as mappings from field to column; the
    parameters as they were when the log began; and whether the file is damaged.

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
            parsed = counting(Parser)(file, sorted(wanted))
        with open_regular(path, WHAT) as file:  # each message states its length
            size, place = file.seek(0, os.SEEK_END), _HEADER
            while place + _MESSAGE <= size:
                file.seek(place)
                place += _MESSAGE + int.from_bytes(file.read(2), "little")
        is_damaged = bool(parsed.file_corruption) or place != size
    topics: dict[str, list[Fields]] = {}
    for data in parsed.data_list:
        if "timestamp" in data.data:
            where, count = f"{path}: topic {data.name}", len(data.data["timestamp"])
            check_count(where, count, LIMITS.table_rows, "messages")
            with np.errstate(invalid="ignore"):  # spoiled bytes may make a signalling NaN
                fields = {name: x.astype(np.float64) for name, x in data.data.items()}
            topics.setdefault(data.name, []).append(fields)
    parameters = {
        name: float(value)
        for name, value in parsed.initial_parameters.items()
        if isinstance(value, int | float) and np.isfinite(value)
    }
    return topics, parameters, is_damaged


def _samples(topic: str, fields: Fields, outputs: Outputs) -> Iterator[Samples]:
    """Yield the columns of a topic's instance, as the map names them: none, where it is not in use;
    two groups of an inertial sensor whose gyro and accelerometer have times of their own.
    """
    published = fields["timestamp"]
    sampled = fields.get("timestamp_sample", published)
    plausible = np.all((sampled > 0.0) & (np.abs(published - sampled) < 1e6))
    t = _MICROSECOND * (sampled if plausible else published)
    if topic in ("sensor_combined", "vehicle_imu"):
        for field, gained in _SENSORS:
            yield _sensor(topic, t, fields, field, gained)
        return
    columns = {name: x for name, x in fields.items() if "timestamp" not in name}
    if topic == "actuator_outputs":
        columns = shares_of_outputs(columns, outputs)
    yield Samples(t, unified(topic, columns), topic)


def unified(topic: str, fields: Fields) -> dict[str, Array]:
    """Return a topic's columns as the map names them; none, where it is not in use."""
    columns = dict(fields)
    if topic == "esc_status":
        reported = [f"esc[{slot}].esc_rpm" for slot in slots_of_escs(columns)]
        if not set(reported) <= set(columns):
            return {}
        return {f"esc[{i}].esc_rpm": columns[name] for i, name in enumerate(reported)}
    if topic == "actuator_motors":
        # NaN stands for a motor that is off
        columns = {n: np.clip(np.nan_to_num(x, nan=0.0), 0.0, 1.0) for n, x in columns.items()}
        is_used = any(np.any(columns.get(f"control[{i}]", 0.0) > 0.0) for i in range(4))
        return columns if is_used else {}
    if topic == "battery_status" and {"connected", "voltage_v"} <= set(columns):
        there = columns["connected"] != 0.0
        columns["voltage_v"] = np.where(there, columns["voltage_v"], np.nan)
    elif topic.endswith("_odometry"):
        # in NED or in FRD fixed to the earth, both of which have z down: 1 and 2 since PX4 1.14,
        # 0 and 1 before
        known = (1, 2) if "pose_frame" in columns else (0, 1)
        frame = columns.get("pose_frame", columns.get("local_frame", np.zeros(1)))
        if "x" in columns:  # before PX4 1.14
            columns |= {f"position[{i}]": columns[name] for i, name in enumerate("xyz")}
        for name in (f"position[{i}]" for i in range(3) if f"position[{i}]" in columns):
            columns[name] = np.where(np.isin(frame, known), columns[name], np.nan)
    elif topic == _FILTER:
        for flag, names in (("xy_valid", "xy"), ("z_valid", "z")):
            for name in names if flag in columns else "":
                columns[name] = np.where(columns[flag] == 0.0, np.nan, columns[name])
    return columns


def _sensor(topic: str, t: Array, fields: Fields, field: str, gained: str) -> Samples:
    """Return a gyro or an accelerometer at its own times, as far as the topic has it."""
    source = field if topic == "sensor_combined" else gained
    names = {f"{field}[{i}]": f"{source}[{i}]" for i in range(3)}
    found = {name: fields[stored] for name, stored in names.items() if stored in fields}
    if source == gained and f"{gained}_dt" in fields:
        span = _MICROSECOND * fields[f"{gained}_dt"]
        found = {n: column / np.where(span > 0.0, span, np.nan) for n, column in found.items()}
        t = t - 0.5 * span
    late = fields.get("accelerometer_timestamp_relative", np.zeros(len(t)))
    if field == "accelerometer_m_s2" and np.all(np.abs(late) < 1e6):
        t = t + _MICROSECOND * late
    return Samples(t, found, topic)
