"""PX4 logs (``.ulg``), read with pyulog.

**Pose.** Motion capture where it was logged (``vehicle_mocap_odometry``, else
``vehicle_visual_odometry``), else the onboard filter (``vehicle_local_position`` and
``vehicle_attitude``). PX4's world is north, east, down (or forward, right, down) and its body
forward, right, down; here the world is north, west, up and the body forward, left, up: both turn by
half a turn about their x axis. Rows are the position's samples, at ``timestamp_sample`` where the
topic has it.

**Rotors.** Measured rotor speeds of ``esc_status`` where ESCs report them. Otherwise commands, of
which only the ratio of thrusts is known: ``actuator_motors`` holds relative thrust itself (PX4
inverts its thrust curve after it), and ``actuator_outputs`` what was sent to the motors, x from 0
to 1, with relative thrust ``f x^2 + (1 - f) x`` and f the parameter THR_MDL_FAC. The unknown scale
is set so that the median thrust in flight is the declared vehicle's weight: mass and a factor on
thrust cannot be found from such a log.

**Gyro and accelerometer.** ``sensor_combined``, rad/s and m/s2 in forward, right, down.

Motors are renumbered by the positions in the parameters CA_ROTORn_PX and PY where the log has them,
else PX4's quad x is assumed: 1 front-right, 2 rear-left, 3 front-left, 4 rear-right.
"""

import io
import math
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ....runtime.file_limits import LIMITS
from ....runtime.regular_files import check_regular, open_regular
from ..flight_log import FlightLog
from .streams import Stream, flight_log, from_ned, slerp
from .ulog_counting import counting

Array = NDArray[np.float64]
Fields = Mapping[str, NDArray[Any]]

BEGINS = (b"ULog\x01\x12\x35",)

_ODOMETRY = ("vehicle_mocap_odometry", "vehicle_visual_odometry")
_ONBOARD = ("vehicle_local_position", "vehicle_attitude")
_ROTORS = ("esc_status", "actuator_motors", "actuator_outputs")
_INERTIAL = "sensor_combined"
_TOPICS = (*_ODOMETRY, *_ONBOARD, *_ROTORS, _INERTIAL, "battery_status", "vehicle_land_detected")
_QUAD_X = (
    2,
    1,
    3,
    0,
)  # PX4's motor, from 0, of rotors 1 front-left, 2 rear-left, 3 rear-right, 4 front-right
_QUADRANTS = ((1, 1), (-1, 1), (-1, -1), (1, -1))  # signs of x forward and y left of rotors 1 to 4
_MOTOR1 = 101  # PX4's number of the output function "motor 1"


@dataclass(frozen=True)
class _Log:
    """What was read of a ULog: per topic its instances, each a mapping from field to column."""

    path: Path
    topics: Mapping[str, list[Fields]]
    parameters: Mapping[str, float]
    damaged: bool

    def parameter(self, name: str, default: float = 0.0) -> float:
        """Return a parameter as it was when the log began; the default where it is missing or not
        finite.
        """
        value = float(self.parameters.get(name, default))
        return value if math.isfinite(value) else default

    def columns(self, topic: str, fields: Fields, names: tuple[str, ...]) -> Array:
        """Return columns (N, len(names)) of a topic.

        Raises:
            InputError: the topic lacks one.
        """
        missing = [name for name in names if name not in fields]
        if missing:
            raise InputError(
                f"{self.path}: topic {topic}: no field {', '.join(missing)}; expected "
                f"{', '.join(names)}"
            )
        with np.errstate(invalid="ignore"):  # spoiled bytes may make a signalling NaN
            return np.column_stack([np.asarray(fields[name], dtype=np.float64) for name in names])


def read(path: Path, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a ULog; ``vehicle`` turns commands into rotor speeds where none were measured.

    Raises:
        InputError: pyulog is missing, the file is no ULog, or lacks a pose or four motors.
    """
    log = _open(path)
    pose, pose_notes = _pose(log)
    order, order_note = _motor_order(log)
    rotors, rotor_notes = _rotors(log, order, vehicle)
    notes = [*pose_notes, order_note, *rotor_notes]
    if log.damaged:
        notes.append("the file is damaged; what could be read of it was used")
    accelerometer, gyro = (_inertial(log, field) for field in ("accelerometer_m_s2", "gyro_rad"))
    if accelerometer is not None or gyro is not None:
        notes.append(
            f"gyro and accelerometer: {_INERTIAL}, with what PX4 calibrated, at the pose's times"
        )
    return flight_log(
        path, "px4_ulog", pose, rotors, _voltage(log), tuple(notes), accelerometer, gyro
    )


def _open(path: Path) -> _Log:
    try:
        from pyulog import ULog
    except ImportError as error:
        raise InputError(
            f"{path}: a ULog needs pyulog, which is not installed: pip install 'windwrench[logs]', "
            f"or pip "
            "install pyulog"
        ) from error
    check_regular(path, "a PX4 log (.ulg)", LIMITS.ulog_file)
    try:
        with open_regular(path, "a PX4 log (.ulg)") as file:
            # pyulog prints its doubts; the notes say them
            with redirect_stdout(io.StringIO()):
                ulog = counting(ULog)(file, list(_TOPICS))
            damaged = bool(ulog.file_corruption)
    except InputError:
        raise
    except Exception as error:  # whatever a parser makes of bytes that are no ULog
        raise InputError(
            f"{path}: cannot be read as a ULog: {error}; expected a PX4 log (.ulg)"
        ) from error
    topics: dict[str, list[Fields]] = {}
    for data in ulog.data_list:
        if "timestamp" in data.data:
            if len(data.data["timestamp"]) > LIMITS.table_rows:
                raise InputError(
                    f"{path}: topic {data.name}: more than {LIMITS.table_rows} messages; expected "
                    f"one flight"
                )
            topics.setdefault(data.name, []).append(data.data)
    parameters = {
        name: value
        for name, value in ulog.initial_parameters.items()
        if isinstance(value, int | float)
    }
    return _Log(path, topics, parameters, damaged)


def _times(fields: Fields) -> Array:
    """Return when samples were taken (N,) in s: ``timestamp_sample`` where it is plausible, else
    ``timestamp``.
    """
    published = np.asarray(fields["timestamp"], dtype=np.float64)
    sampled = np.asarray(fields.get("timestamp_sample", published), dtype=np.float64)
    plausible = np.all((sampled > 0.0) & (np.abs(published - sampled) < 1e6))
    times: Array = 1e-6 * (sampled if plausible else published)
    return times


def _quaternion(log: _Log, topic: str, fields: Fields) -> Array:
    return log.columns(topic, fields, ("q[0]", "q[1]", "q[2]", "q[3]"))


def _pose(log: _Log) -> tuple[Stream, list[str]]:
    """Return the pose in the kit's frames, and notes that say whose it is."""
    frames = (
        "world and body turned half a turn about x: from north, east, down to x north, y west, z "
        "up, and from "
        "forward, right, down to forward, left, up"
    )
    for topic in _ODOMETRY:
        for fields in log.topics.get(topic, []):
            names = (
                ("x", "y", "z") if "x" in fields else ("position[0]", "position[1]", "position[2]")
            )
            position = log.columns(topic, fields, names)
            if not _in_earth_frame(fields) or np.isfinite(position).all(axis=1).sum() < 2:
                continue
            t, quaternion = _times(fields), _quaternion(log, topic, fields)
            notes = [f"pose: {topic}; {frames}"]
            if not np.isfinite(quaternion).all(axis=1).any():
                quaternion = slerp(t, _attitude(log))
                notes.append(
                    f"{topic} has no attitude; it is the onboard filter's (vehicle_attitude)"
                )
            return Stream(topic, t, np.column_stack(from_ned(position, quaternion))), notes
    missing = [topic for topic in _ONBOARD if topic not in log.topics]
    if missing:
        raise InputError(
            f"{log.path}: no pose: no usable {' or '.join(_ODOMETRY)}, and no "
            f"{' and no '.join(missing)}; "
            "expected one of the former or vehicle_local_position with vehicle_attitude"
        )
    fields = log.topics["vehicle_local_position"][0]
    position = log.columns("vehicle_local_position", fields, ("x", "y", "z"))
    for flag, columns in (("xy_valid", slice(0, 2)), ("z_valid", slice(2, 3))):
        if flag in fields:
            position[np.asarray(fields[flag]) == 0, columns] = np.nan
    t = _times(fields)
    notes = [
        f"pose: the onboard filter's (vehicle_local_position and vehicle_attitude), not motion "
        f"capture's; {frames}"
    ]
    resets = [
        name
        for name in ("xy_reset_counter", "z_reset_counter")
        if np.ptp(np.asarray(fields.get(name, 0))) > 0
    ]
    if resets:
        notes.append(
            f"the onboard position was reset in the log ({', '.join(resets)}): it jumps there"
        )
    position, quaternion = from_ned(position, slerp(t, _attitude(log)))
    return Stream("vehicle_local_position", t, np.column_stack([position, quaternion])), notes


def _in_earth_frame(fields: Fields) -> bool:
    """Return whether an odometry's pose is in NED or in FRD fixed to the earth, both of which have
    z down.
    """
    if "pose_frame" in fields:  # since PX4 1.14: 0 unknown, 1 NED, 2 FRD
        return bool(np.all(np.isin(fields["pose_frame"], (1, 2))))
    return bool(np.all(np.isin(fields.get("local_frame", 0), (0, 1))))  # before: 0 NED, 1 FRD


def _attitude(log: _Log) -> Stream:
    if "vehicle_attitude" not in log.topics:
        raise InputError(
            f"{log.path}: no attitude: no topic vehicle_attitude; expected it where the odometry "
            f"has none"
        )
    fields = log.topics["vehicle_attitude"][0]
    return Stream(
        "vehicle_attitude", _times(fields), _quaternion(log, "vehicle_attitude", fields)
    ).forward()[0]


def _motor_order(log: _Log) -> tuple[list[int], str]:
    """Return PX4's motor, from 0, of each of the kit's rotors, and the note that says whence."""
    count = int(log.parameter("CA_ROTOR_COUNT"))
    if count not in (0, 4):
        raise InputError(
            f"{log.path}: parameter CA_ROTOR_COUNT is {count}; expected a quadrotor's 4"
        )
    # PX4's body y points right
    places = [
        (log.parameter(f"CA_ROTOR{i}_PX"), -log.parameter(f"CA_ROTOR{i}_PY")) for i in range(4)
    ]
    if count and any(x or y for x, y in places):
        signs = [(int(np.sign(x)), int(np.sign(y))) for x, y in places]
        if sorted(signs) != sorted(_QUADRANTS):
            raise InputError(
                f"{log.path}: parameters CA_ROTORn_PX and CA_ROTORn_PY put the rotors at {places} "
                f"(x forward, "
                "y left); expected one in each quadrant, as on a quad x"
            )
        order, whence = (
            [signs.index(quadrant) for quadrant in _QUADRANTS],
            "by the positions in CA_ROTORn_PX and PY",
        )
    else:
        order, whence = list(_QUAD_X), "as on PX4's quad x, which the log does not state"
    return (
        order,
        f"motors renumbered {whence}: rotors 1, 2, 3, 4 are motors "
        f"{', '.join(str(i + 1) for i in order)}",
    )


def _rotors(log: _Log, order: list[int], vehicle: Vehicle | None) -> tuple[Stream, list[str]]:
    """Return rotor speeds (N, 4) in rad/s in the kit's order, and notes on where they came from."""
    for fields in log.topics.get("esc_status", []):
        rpm = _esc_rpm(log, fields)
        if np.any(rpm != 0.0):
            speeds = np.abs(rpm[:, order]) * (2.0 * math.pi / 60.0)
            return Stream(
                "esc_status", 1e-6 * np.asarray(fields["timestamp"], dtype=np.float64), speeds
            ), ["rotor speeds: measured by the ESCs (esc_status)"]
    found = _commands(log)
    if found is None:
        raise InputError(
            f"{log.path}: no motors: expected esc_status with rotor speeds, actuator_motors or "
            f"actuator_outputs of four motors, found "
            f"{', '.join(sorted(log.topics)) or 'none of the topics'}"
        )
    if vehicle is None:
        raise InputError(
            f"{log.path}: the log has motor commands but no rotor speeds; expected a vehicle, "
            "whose weight and k convert them into rotor speeds"
        )
    name, t, relative, note = found
    total = relative.sum(axis=1)
    flying = _flying(log, t, total)
    middle = float(np.median(total[flying])) if flying.any() else 0.0
    if middle <= 0.0:
        raise InputError(f"{log.path}: {name}: no sample in flight; expected motors that run")
    scale = vehicle.weight / middle
    return Stream(name, t, np.sqrt(scale * relative[:, order] / vehicle.k)), [
        f"thrust model: no rotor speeds in the log; {note}. The unknown scale is set so that the "
        f"median thrust in flight is "
        f"the weight of {vehicle.name} ({vehicle.weight:.4g} N): {scale:.4g} N a motor at full "
        f"command. Mass or a factor "
        "on thrust cannot be found from this log; rotor speeds are sqrt(thrust / k) of commands, "
        "without the motors' lag"
    ]


def _esc_rpm(log: _Log, fields: Fields) -> Array:
    """Return the reported rpm (N, 4) of PX4's motors 1 to 4."""
    slots = list(range(4))
    functions = [f"esc[{i}].actuator_function" for i in range(8)]
    named = [int(fields[name][-1]) - _MOTOR1 if name in fields else -1 for name in functions]
    if set(range(4)) <= set(named):
        slots = [named.index(i) for i in range(4)]
    return log.columns("esc_status", fields, tuple(f"esc[{i}].esc_rpm" for i in slots))


def _commands(log: _Log) -> tuple[str, Array, Array, str] | None:
    """Return a topic, its times (N,) in s, relative thrusts (N, 4) of PX4's motors 1 to 4, and what
    was assumed.
    """
    for fields in log.topics.get("actuator_motors", []):
        control = log.columns("actuator_motors", fields, tuple(f"control[{i}]" for i in range(4)))
        if np.any(control > 0.0):
            relative: Array = np.clip(np.nan_to_num(control, nan=0.0), 0.0, 1.0)  # NaN: motor off
            return (
                "actuator_motors",
                _times(fields),
                relative,
                (
                    "actuator_motors is relative thrust, to which PX4 applies the inverse of its "
                    "thrust curve (THR_MDL_FAC) "
                    "afterwards"
                ),
            )
    factor = min(max(log.parameter("THR_MDL_FAC"), 0.0), 1.0)
    for fields in log.topics.get("actuator_outputs", []):
        bank, slots = _output_slots(log)
        outputs = log.columns("actuator_outputs", fields, tuple(f"output[{i}]" for i in slots))
        outputs = np.nan_to_num(outputs, nan=0.0)
        if not np.all(np.ptp(outputs, axis=0) > 0.0):
            continue  # servos, or an output bank that is not in use
        pulses = bool(outputs.max() > 1.5)
        low = [_limit(log, bank, slot, "MIN", 1000.0) if pulses else 0.0 for slot in slots]
        high = [_limit(log, bank, slot, "MAX", 2000.0) if pulses else 1.0 for slot in slots]
        if not np.all(np.subtract(high, low) > 0.0):
            raise InputError(
                f"{log.path}: the PWM_{bank}_MIN and MAX parameters of the motors' outputs are "
                f"{low} and {high}; "
                "expected MIN below MAX"
            )
        x = np.clip((outputs - low) / np.subtract(high, low), 0.0, 1.0)
        span = f"{min(low):g} to {max(high):g} us" if pulses else "0 to 1"
        return (
            "actuator_outputs",
            1e-6 * np.asarray(fields["timestamp"], dtype=np.float64),
            (factor * x * x + (1.0 - factor) * x),
            (
                f"actuator_outputs, {span} taken as x = 0 to 1, gives relative thrust f x^2 + (1 - "
                f"f) x with THR_MDL_FAC "
                f"f = {factor:g}; motors 1 to 4 at outputs "
                f"{', '.join(str(slot + 1) for slot in slots)}"
            ),
        )
    return None


def _output_slots(log: _Log) -> tuple[str, list[int]]:
    """Return the bank and the outputs, from 0, of motors 1 to 4."""
    for bank in ("MAIN", "AUX"):
        named = [int(log.parameter(f"PWM_{bank}_FUNC{i + 1}")) - _MOTOR1 for i in range(16)]
        if set(range(4)) <= set(named):
            return bank, [named.index(i) for i in range(4)]
    return "MAIN", list(range(4))


def _limit(log: _Log, bank: str, slot: int, end: str, default: float) -> float:
    """Return the pulse in us at one end of an output's range: its own parameter, the bank's, or the
    default.
    """
    for name in (f"PWM_{bank}_{end}{slot + 1}", f"PWM_{bank}_{end}", f"PWM_{end}"):
        if log.parameter(name) > 0.0:
            return log.parameter(name)
    return default


def _flying(log: _Log, t: Array, total: Array) -> NDArray[np.bool_]:
    """Return at which times (N,) in s the vehicle flies: as PX4 detected it, else thrust above half
    its high level.
    """
    for fields in log.topics.get("vehicle_land_detected", []):
        if "landed" in fields:
            # logged at changes: a value holds until the next
            before = (
                np.searchsorted(
                    1e-6 * np.asarray(fields["timestamp"], dtype=np.float64), t, side="right"
                )
                - 1
            )
            flying: NDArray[np.bool_] = (
                np.asarray(fields["landed"])[np.maximum(before, 0)] == 0
            ) & (total > 0.0)
            if flying.any():
                return flying
    return np.asarray(total > 0.5 * np.quantile(total, 0.9))


def _voltage(log: _Log) -> Stream | None:
    for fields in log.topics.get("battery_status", []):
        if np.any(np.asarray(fields.get("voltage_v", 0.0)) > 0.0):
            values = log.columns("battery_status", fields, ("voltage_v",))
            return Stream(
                "battery_status", 1e-6 * np.asarray(fields["timestamp"], dtype=np.float64), values
            )
    return None


def _inertial(log: _Log, field: str) -> Stream | None:
    """Return one inertial sensor in the kit's body axes, or None where it was not logged."""
    names = tuple(f"{field}[{i}]" for i in range(3))
    for fields in log.topics.get(_INERTIAL, []):
        if set(names) <= set(fields):
            t = 1e-6 * np.asarray(fields["timestamp"], dtype=np.float64)
            return Stream(
                _INERTIAL, t, log.columns(_INERTIAL, fields, names) * np.array([1.0, -1.0, -1.0])
            )
    return None
