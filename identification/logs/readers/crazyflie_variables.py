"""What a Crazyflie logs, by the names of its firmware's log variables, in the kit's units and axes.

Its world is z up and its body forward, left, up, as here. What differs: ``acc`` is in g, ``gyro``
in degrees per second, ``stateEstimateZ`` in mm, and ``stateEstimate.pitch`` is positive nose *up*,
the negative of a turn about the y axis that points left. Motors count 1 front-right, 2 rear-right,
3 rear-left, 4 front-left. ``motor.m1`` to ``m4`` are set points of 0 to 65535 (16 bits), after the
firmware's battery compensation where it has one: the voltage that a motor gets is their share of
the battery's.

**Thrust.** A vehicle with a motor curve turns set points into thrust by it; one without gets
Foerster's polynomial (``readers/nanobench.py`` says where it is from) at the vehicle's reference
voltage. A constant factor on thrust then remains unknown.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_log import FlightLog
from ..rotor_orders import ORDERS
from .nanobench import motor_thrust
from .streams import Stream, flight_log, slerp

Array = NDArray[np.float64]
Event = tuple[str, Array, Mapping[str, Array]]  # name, times (N,) in s, columns (N,) by variable

G = 9.80665  # m/s2
FULL = 65535.0  # counts of a motor's set point
_FULL_VOLTAGE = 4.2  # V
_DEGREE = np.pi / 180.0

MOTORS = (
    tuple(f"motor.m{i}" for i in range(1, 5)),
    tuple(f"pwm.m{i}_pwm" for i in range(1, 5)),
)
_RPM = tuple(f"rpm.m{i}" for i in range(1, 5))
# of positions, m per unit and whose they are
_POSITIONS = (
    (("locSrv.x", "locSrv.y", "locSrv.z"), 1.0, "an external system's (locSrv)"),
    (("stateEstimate.x", "stateEstimate.y", "stateEstimate.z"), 1.0, "the onboard filter's"),
    (("stateEstimateZ.x", "stateEstimateZ.y", "stateEstimateZ.z"), 1e-3, "the onboard filter's"),
    (("kalman.stateX", "kalman.stateY", "kalman.stateZ"), 1.0, "the onboard filter's"),
)
_QUATERNIONS = (  # scalar first
    ("locSrv.qw", "locSrv.qx", "locSrv.qy", "locSrv.qz"),
    ("stateEstimate.qw", "stateEstimate.qx", "stateEstimate.qy", "stateEstimate.qz"),
    ("kalman.q0", "kalman.q1", "kalman.q2", "kalman.q3"),
)
_ANGLES = ("stateEstimate.roll", "stateEstimate.pitch", "stateEstimate.yaw")
_GYRO = ("gyro.x", "gyro.y", "gyro.z")
_FORCE = ("acc.x", "acc.y", "acc.z")
_VOLTAGES = (("pm.vbat", 1.0), ("pm.vbatMV", 1e-3))


def crazyflie_log(
    path: Path,
    reader: str,
    events: Sequence[Event],
    vehicle: Vehicle | None,
    notes: tuple[str, ...],
) -> FlightLog:
    """Return the log of a Crazyflie's variables.

    Args:
        path: the file.
        reader: its reader's name.
        events: the variables, those that were sampled together in one.
        vehicle: turns set points into rotor speeds; None: they stay commands.
        notes: of the reader.

    Raises:
        InputError: no motors, or neither a pose nor gyro and accelerometer.
    """
    order = np.array(ORDERS["crazyflie"]) - 1
    said = list(notes)
    said.append(
        "motors renumbered: rotors 1, 2, 3, 4 are motors "
        f"{', '.join(map(str, ORDERS['crazyflie']))} of a Crazyflie"
    )
    rotors = _find(events, _RPM)
    if rotors is not None and np.any(rotors.values > 0.0):
        rotors = Stream(rotors.name, rotors.t, rotors.values[:, order] * (2.0 * np.pi / 60.0))
        said.append("rotor speeds: measured (rpm.m1 to m4)")
    else:
        rotors = None
    command = next((s for names in MOTORS if (s := _find(events, names)) is not None), None)
    if command is not None:
        command = Stream(command.name, command.t, command.values[:, order] / FULL)
        said.append(f"commands: {command.name}, 65535 taken as 1")
    if command is None and rotors is None:
        raise InputError(
            f"{path}: no motors; expected {MOTORS[0][0]} to m4, {MOTORS[1][0]} to m4 or {_RPM[0]} "
            f"to m4, found {_listed(events)}"
        )
    voltage = None
    for name, unit in _VOLTAGES:
        if voltage is None and (found := _find(events, (name,))) is not None:
            voltage = Stream(name, found.t, unit * found.values)
    commanded = False
    if (
        rotors is None
        and command is not None
        and vehicle is not None
        and vehicle.motor_curve is None
    ):
        reference = vehicle.voltage_ref if vehicle.voltage_ref > 0 else _FULL_VOLTAGE
        thrust = motor_thrust(FULL * command.values, np.full(len(command.t), reference))
        rotors = Stream(command.name, command.t, np.sqrt(thrust / vehicle.k))
        commanded = True
        said.append(
            f"thrust model: no rotor speeds in the log; Foerster's polynomial (2015) of the set "
            f"points at {reference:g} V makes them. A constant factor on thrust and the mass "
            "cannot be found from this log"
        )
    gyro, force = _find(events, _GYRO), _find(events, _FORCE)
    if gyro is not None:
        gyro = Stream(gyro.name, gyro.t, _DEGREE * gyro.values)
    if force is not None:
        force = Stream(force.name, force.t, G * force.values)
    if gyro is not None or force is not None:
        said.append("gyro in degrees per second and acc in g, as the firmware logs them")
    pose, whose = _pose(events)
    said.append(whose)
    return flight_log(
        path,
        reader,
        pose,
        rotors,
        voltage,
        tuple(said),
        force,
        gyro,
        command=command,
        vehicle=vehicle,
        commanded=commanded,
        vehicle_name="crazyflie",
    )


def _find(events: Sequence[Event], names: tuple[str, ...]) -> Stream | None:
    """Return variables (N, len(names)) that one event has, without the samples that lack one."""
    for _, t, columns in events:
        if set(names) <= set(columns):
            values = np.column_stack([columns[name] for name in names])
            there = np.isfinite(values).all(axis=1)
            if there.sum() >= 2:
                label = names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"
                return Stream(label, t[there], values[there])
    return None


def _pose(events: Sequence[Event]) -> tuple[Stream | None, str]:
    """Return the pose and the note that says whose it is; None: there is none."""
    for names, unit, whose in _POSITIONS:
        position = _find(events, names)
        if position is None or not np.any(np.ptp(position.values, axis=0) > 0.0):
            continue  # not logged, or never measured
        attitude = _attitude(events)
        if attitude is None:
            return None, f"no pose: {names[0]} has no attitude beside it"
        pose = np.column_stack([unit * position.values, slerp(position.t, attitude)])
        filtered = "" if "external" in whose else ": it was filtered before it was logged"
        return (
            Stream(position.name, position.t, pose),
            f"pose: position {whose} ({position.name}), attitude of {attitude.name}{filtered}",
        )
    return None, "no pose: no position that ever changes was logged"


def _attitude(events: Sequence[Event]) -> Stream | None:
    for names in _QUATERNIONS:
        found = _find(events, names)
        if found is not None and np.all(np.linalg.norm(found.values, axis=1) > 0.5):
            return found.forward()[0]
    angles = _find(events, _ANGLES)
    if angles is None:
        return None
    roll, pitch, yaw = angles.values.T
    turn = Rotation.from_euler("ZYX", np.column_stack([yaw, -pitch, roll]), degrees=True)
    return Stream(angles.name, angles.t, turn.as_quat(scalar_first=True)).forward()[0]


def _listed(events: Sequence[Event]) -> str:
    names = [name for _, _, columns in events for name in columns]
    return ", ".join(names[:20]) or "nothing"
