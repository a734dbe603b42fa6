"""Tables of the racer: flights of a 0.77 kg racing quadrotor at up to 18 m/s, as republished with a
learned model's forces beside them (the test flights of NeuroBEM, Bauersfeld and others, RSS 2021).

What differs from the kit's own form: the names of the columns (the world is z up and the body
forward, left, up, as here), rotor speeds in rpm, each named by its place, and a pose, a velocity
and an acceleration that come from an estimator and were filtered before they were written: there is
no sensor's noise in them. ``extra`` keeps ``velocity`` (N, 3) m/s, body, and, where they are there,
``network_force`` (N, 3) N and ``network_torque`` (N, 3) Nm, body: what the published network says.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_log import (
    FlightLog,
    check_finite,
    check_times,
    log_name,
    time_notes,
    unit_quaternions,
)
from ..tables import open_table

_TIME = "timestamp_s"
_POSITION = ("pos_x", "pos_y", "pos_z")
_QUATERNION = ("quat_w", "quat_x", "quat_y", "quat_z")
_SPEEDS = ("rpm_front_left", "rpm_rear_left", "rpm_rear_right", "rpm_front_right")
_FORCE = ("spec_force_x", "spec_force_y", "spec_force_z")
_GYRO = ("gyro_x", "gyro_y", "gyro_z")
_EXTRA = {
    "velocity": ("vel_body_x", "vel_body_y", "vel_body_z"),
    "network_force": ("network_force_x", "network_force_y", "network_force_z"),
    "network_torque": ("network_torque_x", "network_torque_y", "network_torque_z"),
}
_NEEDED = (_TIME, *_POSITION, *_QUATERNION, *_SPEEDS)
SIGNATURE = (*_SPEEDS, _TIME, "quat_w")


def read(path: Path, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a table of the racer.

    Raises:
        InputError: the file cannot be read, lacks a column, or holds a number that is not finite.
    """
    del vehicle  # rotor speeds are measured
    table = open_table(path)
    missing = [name for name in _NEEDED if name not in table.header]
    if missing:
        raise InputError(
            f"{path}: missing column(s) {', '.join(missing)}; expected those of the racer's log"
        )
    groups = [
        group for group in (_FORCE, _GYRO, *_EXTRA.values()) if set(group) <= set(table.header)
    ]
    voltage = ["battery_v"] if "battery_v" in table.header else []
    columns = table.read([*_NEEDED, *voltage, *(name for group in groups for name in group)])
    for name, column in columns.items():
        check_finite(table, name, column)
    check_times(table, columns[_TIME])

    def block(names: tuple[str, ...]) -> NDArray[np.float64]:
        return np.column_stack([columns[name] for name in names])

    t = columns[_TIME] - columns[_TIME][0]
    everywhere = np.ones(len(t), dtype=np.bool_)
    rpm = block(_SPEEDS)
    notes = [
        "rotors by the places that their columns name, rpm turned into rad/s",
        "pose, gyro and specific force come from an estimator and were filtered before they were "
        "written: their noise is not a sensor's",
    ]
    if np.any(rpm < 0.0):
        notes.append("negative rotor speeds (a sense of rotation) were taken as positive")
    extra = {name: block(group) for name, group in _EXTRA.items() if group in groups}
    quaternion = unit_quaternions(table, block(_QUATERNION), everywhere, ", ".join(_QUATERNION))
    if "velocity" in extra:
        turn = Rotation.from_quat(quaternion, scalar_first=True)
        extra["velocity_world"] = turn.apply(extra["velocity"])
    return FlightLog(
        t=t,
        position=block(_POSITION),
        quaternion=quaternion,
        rotor_speeds=np.abs(rpm) * (2.0 * np.pi / 60.0),
        voltage=columns["battery_v"] if voltage else None,
        accelerometer=block(_FORCE) if _FORCE in groups else None,
        gyro=block(_GYRO) if _GYRO in groups else None,
        name=log_name(path),
        source=f"{path} (reader racer)",
        notes=(*notes, *time_notes(t)),
        valid=everywhere,
        extra=extra,
    )
