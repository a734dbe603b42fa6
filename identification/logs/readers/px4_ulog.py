"""PX4 logs (``.ulg``), read with pyulog.

**Pose.** A simulator's ground truth where it was logged (``vehicle_local_position_groundtruth`` and
``vehicle_attitude_groundtruth``), else motion capture (``vehicle_mocap_odometry``, else
``vehicle_visual_odometry``), else the onboard filter (``vehicle_local_position`` and
``vehicle_attitude``), which was filtered before it was logged. PX4's world is north, east, down (or
forward, right, down) and its body forward, right, down; here the world is north, west, up and the
body forward, left, up: both turn by half a turn about their x axis. Positions are taken at
``timestamp_sample`` where the topic has it. A log without any pose is read for its inertial
sensors.

**Rotors.** Measured rotor speeds of ``esc_status`` where ESCs report them. Commands are kept beside
them, 0 to 1: ``actuator_motors`` as it is, else ``actuator_outputs``, what was sent to the motors,
within the range that PWM_MAIN_MIN and MAX (or their kin) state.

Where there are commands alone, a vehicle with a ``motor_curve`` turns them into thrust. One
without gets relative thrusts: ``actuator_motors`` itself (PX4 inverts its curve after it),
or ``f x^2 + (1 - f) x`` of an output x, with f the parameter THR_MDL_FAC. Their unknown scale is
set so that thrust balances the declared vehicle's weight in flight: at each sample thrust is mass
times the accelerometer's reading along the thrust axis, without one weight over the cosine of the
tilt, and the scale is the median. Mass and a factor on thrust cannot be found from such a log.

**Gyro and accelerometer.** ``sensor_combined``, else ``vehicle_imu`` (angles and velocities over
their integration time, put in its middle), else ``vehicle_angular_velocity`` and
``vehicle_acceleration``: rad/s and m/s2 in forward, right, down.

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
from ..flight_phases import flying as by_thrust
from ..streams import Stream, flight_log, from_ned, slerp
from .balanced_thrust import balanced_speeds
from .ulog_counting import counting

Array = NDArray[np.float64]
Fields = Mapping[str, NDArray[Any]]

BEGINS = (b"ULog\x01\x12\x35",)

_ODOMETRY = ("vehicle_mocap_odometry", "vehicle_visual_odometry")
_ONBOARD = ("vehicle_local_position", "vehicle_attitude")
_ROTORS = ("esc_status", "actuator_motors", "actuator_outputs")
_TRUTH = ("vehicle_local_position_groundtruth", "vehicle_attitude_groundtruth")
# topics and fields of gyro and accelerometer, of which the first that was logged is taken
_INERTIAL = {
    "gyro_rad": (
        ("sensor_combined", "gyro_rad"),
        ("vehicle_imu", "delta_angle"),
        ("vehicle_angular_velocity", "xyz"),
    ),
    "accelerometer_m_s2": (
        ("sensor_combined", "accelerometer_m_s2"),
        ("vehicle_imu", "delta_velocity"),
        ("vehicle_acceleration", "xyz"),
    ),
}
_TOPICS = (
    *_ODOMETRY,
    *_TRUTH,
    *_ONBOARD,
    *_ROTORS,
    *dict.fromkeys(topic for ways in _INERTIAL.values() for topic, _ in ways),
    "battery_status",
    "vehicle_land_detected",
)
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
        InputError: pyulog is missing, the file is no ULog, or lacks four motors, or a pose and
            inertial sensors.
    """
    log = _open(path)
    pose, pose_notes = _pose(log)
    gyro, accelerometer = (_inertial(log, field) for field in _INERTIAL)
    nothing = pose is None and (gyro is None or accelerometer is None)
    if nothing and not all(topic in log.topics for topic in _ONBOARD):
        raise _no_motion(log)
    order, order_note = _motor_order(log)
    measured, command, relative, rotor_notes = _rotors(log, order)
    if nothing:
        raise _no_motion(log)
    rotors, scale_notes = measured, []
    curve = vehicle is not None and vehicle.motor_curve is not None
    if measured is None and relative is not None and vehicle is not None and not curve:
        total = relative.values.sum(axis=1)
        in_flight = _flying(log, relative.t, total)
        rotors, note = balanced_speeds(path, relative, vehicle, in_flight, accelerometer, pose)
        scale_notes = [note]
    notes = [*pose_notes, order_note, *rotor_notes, *scale_notes]
    if sensors := dict.fromkeys(s.name for s in (gyro, accelerometer) if s is not None):
        notes.append(
            f"gyro and accelerometer: {' and '.join(sensors)}, with what PX4 calibrated, body "
            "turned from forward, right, down to forward, left, up"
        )
    if log.damaged:
        notes.append("the file is damaged; what could be read of it was used")
    return flight_log(
        path,
        "px4_ulog",
        pose,
        rotors,
        _voltage(log),
        tuple(notes),
        accelerometer,
        gyro,
        command=command,
        vehicle=vehicle,
        commanded=measured is None,
    )


def _no_motion(log: _Log) -> InputError:
    """Return the error for a log in which nothing says how the vehicle moved."""
    missing = [topic for topic in _ONBOARD if topic not in log.topics]
    return InputError(
        f"{log.path}: no pose: no usable {' or '.join(_ODOMETRY)}, and no "
        f"{' and no '.join(missing) or 'valid position'}; "
        "expected one of the former or vehicle_local_position with vehicle_attitude, or gyro "
        "and accelerometer"
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


def _pose(log: _Log) -> tuple[Stream | None, list[str]]:
    """Return the pose in the kit's frames, and notes that say whose it is; None: the log has
    none.
    """
    frames = (
        "world and body turned half a turn about x: from north, east, down to x north, y west, z "
        "up, and from "
        "forward, right, down to forward, left, up"
    )
    if all(topic in log.topics for topic in _TRUTH):
        return _position_and_attitude(log, *_TRUTH), [
            f"pose: the simulator's ground truth ({' and '.join(_TRUTH)}), which has no noise; "
            f"{frames}"
        ]
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
        return None, [f"no pose in the log: no {' and no '.join(missing)}"]
    pose = _position_and_attitude(log, *_ONBOARD)
    if np.isfinite(pose.values).all(axis=1).sum() < 2:
        return None, ["no pose in the log: the onboard filter never had a valid position"]
    notes = [
        f"pose: the onboard filter's (vehicle_local_position and vehicle_attitude), not motion "
        f"capture's: it was filtered before it was logged; {frames}"
    ]
    fields = log.topics["vehicle_local_position"][0]
    resets = [
        name
        for name in ("xy_reset_counter", "z_reset_counter")
        if np.ptp(np.asarray(fields.get(name, 0))) > 0
    ]
    if resets:
        notes.append(
            f"the onboard position was reset in the log ({', '.join(resets)}): it jumps there"
        )
    return pose, notes


def _position_and_attitude(log: _Log, position_topic: str, attitude_topic: str) -> Stream:
    """Return the pose in the kit's frames at the position's times; NaN where it is not valid."""
    fields = log.topics[position_topic][0]
    position = log.columns(position_topic, fields, ("x", "y", "z"))
    for flag, columns in (("xy_valid", slice(0, 2)), ("z_valid", slice(2, 3))):
        if flag in fields and position_topic not in _TRUTH:
            position[np.asarray(fields[flag]) == 0, columns] = np.nan
    t = _times(fields)
    position, quaternion = from_ned(position, slerp(t, _attitude(log, attitude_topic)))
    return Stream(position_topic, t, np.column_stack([position, quaternion]))


def _in_earth_frame(fields: Fields) -> bool:
    """Return whether an odometry's pose is in NED or in FRD fixed to the earth, both of which have
    z down.
    """
    if "pose_frame" in fields:  # since PX4 1.14: 0 unknown, 1 NED, 2 FRD
        return bool(np.all(np.isin(fields["pose_frame"], (1, 2))))
    return bool(np.all(np.isin(fields.get("local_frame", 0), (0, 1))))  # before: 0 NED, 1 FRD


def _attitude(log: _Log, topic: str = "vehicle_attitude") -> Stream:
    if topic not in log.topics:
        raise InputError(
            f"{log.path}: no attitude: no topic {topic}; expected it where the odometry has none"
        )
    fields = log.topics[topic][0]
    return Stream(topic, _times(fields), _quaternion(log, topic, fields)).forward()[0]


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


def _rotors(
    log: _Log, order: list[int]
) -> tuple[Stream | None, Stream | None, Stream | None, list[str]]:
    """Return measured rotor speeds (N, 4) in rad/s, commands (M, 4) and relative thrusts (M, 4),
    all in the kit's order, and notes on where they came from.
    """
    measured, notes = None, []
    for fields in log.topics.get("esc_status", []):
        rpm = _esc_rpm(log, fields)
        if np.any(rpm != 0.0):
            speeds = np.abs(rpm[:, order]) * (2.0 * math.pi / 60.0)
            measured = Stream(
                "esc_status", 1e-6 * np.asarray(fields["timestamp"], dtype=np.float64), speeds
            )
            notes.append("rotor speeds: measured by the ESCs (esc_status)")
            break
    found = _commands(log)
    if found is None:
        if measured is None:
            raise InputError(
                f"{log.path}: no motors: expected esc_status with rotor speeds, actuator_motors or "
                f"actuator_outputs of four motors that turn, found "
                f"{', '.join(sorted(log.topics)) or 'none of the topics'}"
            )
        return measured, None, None, notes
    name, t, command, relative, note = found
    if measured is None:
        notes.append(f"no rotor speeds in the log; {note}")
    elif len(t) < 2:
        return measured, None, None, notes
    return (
        measured,
        Stream(name, t, command[:, order]),
        Stream(name, t, relative[:, order]),
        notes,
    )


def _esc_rpm(log: _Log, fields: Fields) -> Array:
    """Return the reported rpm (N, 4) of PX4's motors 1 to 4."""
    slots = list(range(4))
    functions = [f"esc[{i}].actuator_function" for i in range(8)]
    named = [int(fields[name][-1]) - _MOTOR1 if name in fields else -1 for name in functions]
    if set(range(4)) <= set(named):
        slots = [named.index(i) for i in range(4)]
    return log.columns("esc_status", fields, tuple(f"esc[{i}].esc_rpm" for i in slots))


def _commands(log: _Log) -> tuple[str, Array, Array, Array, str] | None:
    """Return a topic, its times (N,) in s, commands (N, 4), 0 to 1, and relative thrusts (N, 4) of
    PX4's motors 1 to 4, and what was assumed.
    """
    for fields in log.topics.get("actuator_motors", []):
        control = log.columns("actuator_motors", fields, tuple(f"control[{i}]" for i in range(4)))
        if np.any(control > 0.0):
            relative: Array = np.clip(np.nan_to_num(control, nan=0.0), 0.0, 1.0)  # NaN: motor off
            return (
                "actuator_motors",
                _times(fields),
                relative,
                relative,
                (
                    "commands: actuator_motors is relative thrust, to which PX4 applies the "
                    "inverse of its "
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
            x,
            (factor * x * x + (1.0 - factor) * x),
            (
                f"commands: actuator_outputs, {span} taken as x = 0 to 1, gives relative thrust "
                f"f x^2 + (1 - "
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
    return by_thrust(total)


def _voltage(log: _Log) -> Stream | None:
    for fields in log.topics.get("battery_status", []):
        if np.any(np.asarray(fields.get("voltage_v", 0.0)) > 0.0):
            values = log.columns("battery_status", fields, ("voltage_v",))
            return Stream(
                "battery_status", 1e-6 * np.asarray(fields["timestamp"], dtype=np.float64), values
            )
    return None


def _inertial(log: _Log, field: str) -> Stream | None:
    """Return the gyro (``gyro_rad``) or the accelerometer (``accelerometer_m_s2``) in the kit's
    body axes, or None where none was logged.
    """
    found = (_sensor(log, *way) for way in _INERTIAL[field])
    return next((sensor for sensor in found if sensor is not None), None)


def _sensor(log: _Log, topic: str, field: str) -> Stream | None:
    """Return one inertial sensor in the kit's body axes, or None where it was not logged."""
    names = tuple(f"{field}[{i}]" for i in range(3))
    for fields in log.topics.get(topic, []):
        if not set(names) <= set(fields) or len(fields["timestamp"]) < 2:
            continue
        t = _times(fields)
        values = log.columns(topic, fields, names) * np.array([1.0, -1.0, -1.0])
        if f"{field}_dt" in fields:  # angle or velocity gained over a time in us
            span = 1e-6 * np.asarray(fields[f"{field}_dt"], dtype=np.float64)
            values = values / np.where(span > 0.0, span, np.nan)[:, None]
            t = t - 0.5 * span
        late = np.asarray(fields.get("accelerometer_timestamp_relative", 0), dtype=np.float64)
        if field == "accelerometer_m_s2" and np.all(np.abs(late) < 1e6):
            t = t + 1e-6 * late
        return Stream(topic, t, values)
    return None
