"""ArduPilot logs (DataFlash, ``.BIN``).

**Pose.** A simulator's truth where it was logged (SIM2 and SIM), else an external system's (VISP),
else the onboard filter's: XKF1 of the first core with the attitude of XKQ, NKF1 with that of ATT,
or POS with ATT, latitude and longitude turned into metres from the first. What an onboard filter
says was filtered before it was logged. ArduPilot's world is north, east, down and its body forward,
right, down; here the world is north, west, up and the body forward, left, up.

**Rotors.** ESC telemetry where it was logged (ESC, rpm), else pulses (RCOU, us): the outputs of
motors 1 to 4 by SERVOn_FUNCTION, else 1 to 4; the commands 0 to 1 are MOT_PWM_MIN to MOT_PWM_MAX.
ArduPilot assumes of its motors that thrust is ``(1 - e) a + e a^2`` with e = MOT_THST_EXPO, where
``a`` is the command between MOT_SPIN_MIN and MOT_SPIN_MAX. A vehicle with a motor curve turns
commands into thrust by its own; one without gets ArduPilot's, its scale set so that thrust balances
the weight in flight: mass and a factor on thrust cannot be found from such a log.

**Order.** By FRAME_TYPE: X and H (1 front-right, 2 rear-left, 3 front-left, 4 rear-right), those of
Betaflight, of DJI, and clockwise from front-right; X is assumed where the log does not say.

**Gyro and accelerometer.** IMU of the first sensor, rad/s and m/s2 in forward, right, down.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_log import FlightLog
from ..flight_phases import flying
from ..rotor_orders import ORDERS, Order, order_words
from ..streams import Stream, flight_log, from_ned, slerp
from .balanced_thrust import balanced_speeds
from .dataflash import BEGINS as BEGINS
from .dataflash import DataFlash, Messages, read_dataflash

Array = NDArray[np.float64]

_EARTH = 6_378_137.0  # m
_WANTED = (
    *("SIM", "SIM2", "VISP", "XKF1", "XKQ", "NKF1", "POS", "ATT", "IMU", "RCOU"),
    *("ESC", "BAT", "CURR", "PARM"),
)
_DJI: Order = (2, 3, 4, 1)  # 1 front-right, 2 front-left, 3 rear-left, 4 rear-right
_FRAMES: dict[int, Order] = {
    1: ORDERS["ardupilot-x"],
    3: ORDERS["ardupilot-x"],  # H: the same places
    12: ORDERS["betaflight"],
    13: _DJI,
    14: ORDERS["crazyflie"],
    18: ORDERS["betaflight"],
}
_QUAD = 1  # of FRAME_CLASS
_MOTOR1 = 33  # of SERVOn_FUNCTION
_CHANNELS = 14  # of RCOU


def read(path: Path, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a DataFlash log; ``vehicle`` turns commands into rotor speeds where none were measured.

    Raises:
        InputError: the file is no such log, is not a quadrotor's, or lacks motors, or a pose and
            inertial sensors.
    """
    log = read_dataflash(path, _WANTED)
    parameters = _parameters(log)
    order, order_note = _order(path, parameters)
    pose, pose_note = _pose(log)
    gyro, accelerometer = _sensor(log, "Gyr"), _sensor(log, "Acc")
    rotors, rotor_notes = _rotor_speeds(log, parameters, order)
    command, relative, command_notes = _commands(path, log, parameters, order)
    notes = [pose_note, order_note, *rotor_notes, *command_notes]
    if rotors is None and command is None:
        raise InputError(
            f"{path}: no motors; expected RCOU, or ESC with RPM, found "
            f"{', '.join(sorted(log.messages)) or 'none of the messages'}"
        )
    commanded = rotors is None
    curve = vehicle is not None and vehicle.motor_curve is not None
    if rotors is None and relative is not None and vehicle is not None and not curve:
        in_flight = flying(relative.values.sum(axis=1))
        rotors, note = balanced_speeds(path, relative, vehicle, in_flight, accelerometer, pose)
        notes.append(note)
    if gyro is not None or accelerometer is not None:
        notes.append(
            "gyro and accelerometer: IMU, the first of them, body turned from forward, right, down "
            "to forward, left, up"
        )
    if log.skipped:
        notes.append(
            f"{log.skipped} bytes of the file belong to no message; it was cut or is damaged"
        )
    return flight_log(
        path,
        "ardupilot_bin",
        pose,
        rotors,
        _voltage(log),
        tuple(notes),
        accelerometer,
        gyro,
        command=command,
        vehicle=vehicle,
        commanded=commanded,
    )


def _times(messages: Messages) -> Array:
    """Return times (N,) in s of the vehicle's clock."""
    if "TimeUS" in messages:
        return 1e-6 * messages.column("TimeUS")
    return 1e-3 * messages.column("TimeMS") if "TimeMS" in messages else np.empty(0)


def _first(log: DataFlash, name: str, number: str, columns: tuple[str, ...]) -> Messages | None:
    """Return the messages of a type of the first sensor, core or battery, the lowest ``number``
    that there is; None where there are less than two, or they lack a column.
    """
    found = log.messages.get(name)
    if found is None or not all(c in found for c in columns) or len(_times(found)) < 2:
        return None
    if number in found:
        which = found.column(number)
        found = found.where(which == which.min())
    return found if len(found.rows) >= 2 else None


def _parameters(log: DataFlash) -> dict[str, float]:
    """Return the parameters as the log first states them."""
    found = log.messages.get("PARM")
    if found is None or "Name" not in found or "Value" not in found:
        return {}
    names = [name.decode("ascii", "replace") for name in found.rows["Name"].tolist()]
    out: dict[str, float] = {}
    for name, value in zip(names, found.column("Value").tolist(), strict=True):
        if math.isfinite(value):
            out.setdefault(name, value)
    return out


def _order(path: Path, parameters: dict[str, float]) -> tuple[Order, str]:
    """Return which motor each of the kit's rotors is, and the note that says whence.

    Raises:
        InputError: the frame is no quad x.
    """
    if "FRAME_CLASS" not in parameters:
        order = ORDERS["ardupilot-x"]
        return order, f"quad x assumed, which the log does not state: {order_words(order)}"
    frame, kind = int(parameters["FRAME_CLASS"]), int(parameters.get("FRAME_TYPE", 1))
    if frame != _QUAD or kind not in _FRAMES:
        raise InputError(
            f"{path}: parameters FRAME_CLASS and FRAME_TYPE are {frame} and {kind}; expected a "
            f"quadrotor's 1 and one of {', '.join(map(str, _FRAMES))}, whose rotors stand in an x"
        )
    return _FRAMES[kind], f"FRAME_TYPE {kind}: {order_words(_FRAMES[kind])}"


def _pose(log: DataFlash) -> tuple[Stream | None, str]:
    """Return the pose in the kit's frames, and the note that says whose it is."""
    turned = "world and body turned half a turn about x, from z down to z up"
    attitude = _attitude(log)
    places = (
        ("SIM2", "C", ("PN", "PE", "PD"), "the simulator's truth (SIM2 and SIM)"),
        ("VISP", "I", ("PX", "PY", "PZ"), "an external system's (VISP)"),
        ("XKF1", "C", ("PN", "PE", "PD"), "the onboard filter's (XKF1)"),
        ("NKF1", "C", ("PN", "PE", "PD"), "the onboard filter's (NKF1)"),
        ("POS", "I", ("Lat", "Lng", "Alt"), "the onboard filter's (POS, in metres)"),
    )
    for name, number, columns, whose in places:
        found = _first(log, name, number, columns)
        if found is None:
            continue
        t, position = _times(found), found.columns(columns)
        if name == "POS":
            position = _metres(position)
        own = {"SIM2": _quaternions(log, "SIM"), "VISP": _angles(found, "RPY")}.get(name, attitude)
        if own is None or not np.any(np.ptp(position, axis=0) > 0.0):
            continue
        pose = Stream(name, t, np.column_stack(from_ned(position, slerp(t, own))))
        if np.isfinite(pose.values).all(axis=1).sum() < 2:
            continue
        filtered = ": it was filtered before it was logged" if "onboard" in whose else ""
        return pose, f"pose: {whose}, attitude of {own.name}{filtered}; {turned}"
    return None, "no pose in the log: no position that changes, with an attitude beside it"


def _attitude(log: DataFlash) -> Stream | None:
    """Return the onboard filter's attitude (N, 4), scalar first, body to world, z down."""
    quaternions = _quaternions(log, "XKQ")
    if quaternions is not None:
        return quaternions
    found = _first(log, "ATT", "I", ("Roll", "Pitch", "Yaw"))
    return None if found is None else _angles(found, ("Roll", "Pitch", "Yaw"))


def _quaternions(log: DataFlash, name: str) -> Stream | None:
    columns = ("Q1", "Q2", "Q3", "Q4")
    found = _first(log, name, "C", columns)
    if found is None:
        return None
    values = found.columns(columns)
    return Stream(name, _times(found), values).forward()[0]


def _angles(messages: Messages, names: tuple[str, ...] | str) -> Stream | None:
    """Return the attitude of roll, pitch and yaw in degrees."""
    if not all(name in messages for name in names):
        return None
    angles = messages.columns(tuple(names))
    good = np.isfinite(angles).all(axis=1)
    turn = Rotation.from_euler("ZYX", angles[good][:, ::-1], degrees=True)
    stream = Stream(messages.name, _times(messages)[good], turn.as_quat(scalar_first=True))
    return stream.forward()[0] if len(stream.t) else None


def _metres(place: Array) -> Array:
    """Return north, east, down (N, 3) in m from the first place of latitude and longitude in
    degrees and altitude in m.
    """
    away = place - place[0]
    north = _EARTH * np.radians(away[:, 0])
    east = _EARTH * np.radians(away[:, 1]) * np.cos(np.radians(place[0, 0]))
    return np.column_stack([north, east, -place[:, 2]])


def _sensor(log: DataFlash, name: str) -> Stream | None:
    """Return one inertial sensor (N, 3) in the kit's body axes; None where it was not logged."""
    columns = tuple(f"{name}{axis}" for axis in "XYZ")
    found = _first(log, "IMU", "I", columns)
    if found is None:
        return None
    return Stream("IMU", _times(found), found.columns(columns) * np.array([1.0, -1.0, -1.0]))


def _channels(parameters: dict[str, float]) -> list[int]:
    """Return the outputs, from 1, of motors 1 to 4."""
    functions = [int(parameters.get(f"SERVO{i}_FUNCTION", 0)) for i in range(1, _CHANNELS + 1)]
    motors = [_MOTOR1 + i for i in range(4)]
    if all(motor in functions for motor in motors):
        return [functions.index(motor) + 1 for motor in motors]
    return [1, 2, 3, 4]


def _rotor_speeds(
    log: DataFlash, parameters: dict[str, float], order: Order
) -> tuple[Stream | None, list[str]]:
    """Return rotor speeds (N, 4) in rad/s that ESCs reported, at the times of the first of them."""
    found = log.messages.get("ESC")
    if found is None or not all(name in found for name in ("Instance", "RPM", "TimeUS")):
        return None, []
    slots, which = [c - 1 for c in _channels(parameters)], found.column("Instance")
    if not set(slots) <= set(which.astype(int).tolist()):
        slots = [0, 1, 2, 3]
    each = []
    for slot in slots:
        one = found.where(which == slot)
        if len(one.rows) < 2 or not np.any(one.column("RPM") > 0.0):
            return None, ["ESC telemetry: not of all four motors, or without rpm; left out"]
        each.append(Stream("ESC", _times(one), one.columns(("RPM",))).forward()[0])
    t = each[0].t
    speeds = np.column_stack([s.at(t)[:, 0] for s in each]) * (2.0 * math.pi / 60.0)
    poles = parameters.get("SERVO_BLH_POLES", 14.0)
    return Stream("ESC", t, speeds[:, np.array(order) - 1]), [
        f"rotor speeds: measured by the ESCs (ESC), with {poles:g} magnet poles as ArduPilot took "
        "them"
    ]


def _commands(
    path: Path, log: DataFlash, parameters: dict[str, float], order: Order
) -> tuple[Stream | None, Stream | None, list[str]]:
    """Return commands (N, 4), 0 to 1, relative thrusts (N, 4), and what was assumed.

    Raises:
        InputError: the pulses' range is none.
    """
    channels = _channels(parameters)
    names = tuple(f"C{c}" for c in channels)
    found = _first(log, "RCOU", "I", names)
    if found is None:
        return None, None, []
    low, high = parameters.get("MOT_PWM_MIN", 0.0), parameters.get("MOT_PWM_MAX", 0.0)
    whence = "MOT_PWM_MIN and MAX"
    if low <= 0.0 or high <= 0.0:
        low, high = parameters.get("RC3_MIN", 1000.0), parameters.get("RC3_MAX", 2000.0)
        whence = "RC3_MIN and MAX" if "RC3_MIN" in parameters else "an assumption"
    if not low < high:
        raise InputError(
            f"{path}: parameters {whence} are {low:g} and {high:g} us; expected MIN below MAX"
        )
    u = np.clip((found.columns(names) - low) / (high - low), 0.0, 1.0)
    expo = min(max(parameters.get("MOT_THST_EXPO", 0.65), 0.0), 1.0)
    least, most = parameters.get("MOT_SPIN_MIN", 0.15), parameters.get("MOT_SPIN_MAX", 0.95)
    if not 0.0 <= least < most:
        least, most = 0.0, 1.0
    a = np.clip((u - least) / (most - least), 0.0, None)
    t, rotor = _times(found), np.array(order) - 1
    relative = (1.0 - expo) * a + expo * a * a
    return (
        Stream("RCOU", t, u[:, rotor]),
        Stream("RCOU", t, relative[:, rotor]),
        [
            f"commands: RCOU, {low:g} to {high:g} us ({whence}) taken as 0 to 1; motors 1 to 4 at "
            f"outputs {', '.join(map(str, channels))}. ArduPilot takes thrust as (1 - e) a + e a^2 "
            f"with e = {expo:g} (MOT_THST_EXPO) of a = 0 to 1 at the commands {least:g} to {most:g}"
        ],
    )


def _voltage(log: DataFlash) -> Stream | None:
    for name in ("BAT", "CURR"):
        found = _first(log, name, "Inst" if name == "BAT" else "I", ("Volt",))
        if found is not None and np.any(found.column("Volt") > 0.0):
            return Stream(name, _times(found), found.columns(("Volt",)))
    return None
