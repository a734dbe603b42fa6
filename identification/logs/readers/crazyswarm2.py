"""Crazyswarm2 logs from TU Berlin: a Crazyflie 2.1, with and without a slung payload
(IMRCLab/crazyswarm2-tools).

What differs from the kit's own format:

* **Commands, not rotor speeds.** The log has the collective thrust (N) and the body torques (Nm)
  that the controller asked for. They become rotor speeds through the inverse of
  the declared vehicle's rotor mixing, clipped at zero and at its ``omega_max``. That is not what
  the firmware's own mixer and thrust curve made of them: motors that lag, sag or were exchanged
  (logs 100, 130, 140) show up as wrench.
* **Attitude** is the onboard filter's, R = Rz(yaw) Ry(pitch) Rx(roll): motion capture saw a
  single marker.
* **Position** is OptiTrack's where it was logged (payload flights), sampled and held: a row
  that repeats the position before it is not another measurement, so it is not valid. Elsewhere it
  is the onboard filter's, in steps of 1 mm.
* **Stray samples**: logs begin with a few samples and then a gap; everything before the gap
  is dropped.

* **Inertial sensors** are those of the Crazyflie's body, forward, left, up, in SI units:
  ``omega_*`` is the gyro, ``acc_*`` the accelerometer.

``extra`` keeps, where logged: ``onboard_quaternion`` (N, 4), ``angular_velocity`` (N, 3) rad/s
body, ``onboard_position`` (N, 3) m, ``onboard_velocity`` (N, 3) m/s, ``specific_force`` (N, 3) m/s2
body, ``commanded_thrust`` (N,) N, ``commanded_torque`` (N, 3) Nm, ``payload_position`` (N, 3) m,
``payload_velocity`` (N, 3) m/s.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ....dynamics.vehicle import Vehicle
from ....dynamics.vehicle_file import load_vehicle
from ....runtime.errors import InputError
from ..flight_log import FlightLog, Mask, check_finite, check_times, log_name, time_notes
from ..tables import open_table

Array = NDArray[np.float64]

SIGNATURE = ("t_s", "est_x_m", "roll_rad", "thrust_cmd_N", "torque_cmd_x_Nm")

_MOCAP = tuple(f"mocap_{axis}_m" for axis in "xyz")
_ONBOARD = tuple(f"est_{axis}_m" for axis in "xyz")
_ANGLES = ("roll_rad", "pitch_rad", "yaw_rad")
_TORQUE = tuple(f"torque_cmd_{axis}_Nm" for axis in "xyz")
_REQUIRED = ("t_s", *_ONBOARD, *_ANGLES, "thrust_cmd_N", *_TORQUE)
_EXTRA = {
    "onboard_position": _ONBOARD,
    "onboard_velocity": tuple(f"est_v{axis}_mps" for axis in "xyz"),
    "angular_velocity": tuple(f"omega_{axis}_radps" for axis in "xyz"),
    "specific_force": tuple(f"acc_{axis}_mps2" for axis in "xyz"),
    "commanded_torque": _TORQUE,
    "payload_position": tuple(f"payload_{axis}_m" for axis in "xyz"),
    "payload_velocity": tuple(f"payload_v{axis}_mps" for axis in "xyz"),
}
_STRAY_GAP = (
    5.0  # median time steps; all these logs begin with 3 to 5 samples and a gap of 9 to 300 steps
)
_STRAY_SAMPLES = 10


def read(path: Path, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a crazyswarm2 CSV; ``vehicle`` (default: the crazyflie preset) turns commanded thrust
    into rotor speeds.

    Raises:
        InputError: the file cannot be read, lacks a column, or holds a number that is not finite.
    """
    vehicle = load_vehicle("crazyflie") if vehicle is None else vehicle
    table = open_table(path)
    missing = [name for name in _REQUIRED if name not in table.header]
    if missing:
        raise InputError(
            f"{path}: missing column(s) {', '.join(missing)}; expected those of a crazyswarm2 log"
        )
    known = dict.fromkeys(
        [*_REQUIRED, *_MOCAP, *(name for group in _EXTRA.values() for name in group)]
    )
    columns = table.read([name for name in known if name in table.header])
    for name, column in columns.items():
        check_finite(table, name, column)
    check_times(table, columns["t_s"])
    first, stray = _first_after_stray(columns["t_s"])
    columns = {name: column[first:] for name, column in columns.items()}
    if len(columns["t_s"]) < 2:
        raise InputError(
            f"{path}: only one row after the gap behind the first sample(s); expected at least two"
        )

    position, valid, position_note = _position(columns)
    turn = Rotation.from_euler("ZYX", _group(columns, _ANGLES[::-1])).as_quat()
    quaternion: Array = turn[:, [3, 0, 1, 2]]
    speeds, clipped = commanded_speeds(columns["thrust_cmd_N"], _group(columns, _TORQUE), vehicle)
    notes = [
        "no rotor speeds in the log: commanded thrust and torques were converted into rotor "
        "speeds by the inverse of the rotor "
        f"mixing of {vehicle.name}, clipped at zero and at omega_max. What the firmware's thrust "
        f"curve, the battery and "
        "the motors made of the command is not in the log; a constant factor on thrust remains "
        "unknown",
        "attitude is the onboard filter's, not motion capture's",
        position_note,
        *stray,
    ]
    if clipped:
        notes.append(
            f"the commands of {clipped} sample(s) were out of the rotors' reach and were clipped"
        )
    extra = {
        name: _group(columns, group) for name, group in _EXTRA.items() if set(group) <= set(columns)
    }
    extra |= {"onboard_quaternion": quaternion, "commanded_thrust": columns["thrust_cmd_N"]}
    t = columns["t_s"] - columns["t_s"][0]
    return FlightLog(
        t=t,
        position=np.where(valid[:, None], position, np.nan),
        quaternion=np.where(valid[:, None], quaternion, np.nan),
        rotor_speeds=speeds,
        name=log_name(path),
        source=f"{path} (reader crazyswarm2)",
        notes=(*notes, *time_notes(t)),
        accelerometer=extra.get("specific_force"),
        gyro=extra.get("angular_velocity"),
        valid=valid,
        extra=extra,
        commanded=True,
    )


def commanded_speeds(thrust: Array, torque: Array, vehicle: Vehicle) -> tuple[Array, int]:
    """Return rotor speeds (N, 4) in rad/s of commanded thrusts (N,) and torques (N, 3), and how
    many rows were clipped.
    """
    square = np.linalg.solve(vehicle.mixing, np.column_stack([thrust, torque]).T).T
    limit = vehicle.omega_max**2
    clipped = int(np.sum(np.any((square < 0.0) | (square > limit), axis=1)))
    speeds: Array = np.sqrt(np.clip(square, 0.0, limit))
    return speeds, clipped


def _group(columns: Mapping[str, Array], names: tuple[str, ...]) -> Array:
    return np.column_stack([columns[name] for name in names])


def _first_after_stray(t: Array) -> tuple[int, tuple[str, ...]]:
    """Return the first row (of times (N,) in s) that belongs to the flight, and a note where rows
    were dropped.
    """
    step = np.diff(t)
    gaps = np.flatnonzero(step[:_STRAY_SAMPLES] > _STRAY_GAP * np.median(step))
    if not gaps.size:
        return 0, ()
    first = int(gaps[-1]) + 1
    return first, (
        f"dropped {first} stray sample(s) before a gap of {t[first] - t[first - 1]:.2g} s at the "
        f"start",
    )


def _position(columns: Mapping[str, Array]) -> tuple[Array, Mask, str]:
    """Return positions (N, 3), which rows hold a new one, and the note that says whose they are."""
    if not set(_MOCAP) <= set(columns):
        position = _group(columns, _ONBOARD)
        return (
            position,
            np.ones(len(position), dtype=np.bool_),
            (
                "position is the onboard filter's (fed by OptiTrack, steps of 1 mm): smoothed, so "
                "its errors are not "
                "independent from sample to sample"
            ),
        )
    position = _group(columns, _MOCAP)
    new: Mask = np.concatenate([[True], np.any(np.diff(position, axis=0) != 0.0, axis=1)])
    return (
        position,
        new,
        (
            f"position is OptiTrack's, sampled and held: {int(np.sum(~new))} of {len(new)} rows "
            f"repeat the "
            "one before and are not valid"
        ),
    )
