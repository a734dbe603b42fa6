"""Gyro, accelerometer and motor commands of a PX4 log (``.ulg``), each at its own rate; no pose and
no vehicle is needed.

Commands are ``actuator_motors`` where the log has them, else what was sent to the motors
(``actuator_outputs``), 0 at 1000 us and 1 at 2000 us; or 0 to 1 as it stands. Motors are renumbered
as by the reader ``px4_ulog``.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....runtime.errors import InputError
from ..streams import Stream
from .px4_ulog import _inertial, _motor_order, _open, _output_slots, _times

Array = NDArray[np.float64]

_LOW, _SPAN = 1000.0, 1000.0  # us


def read_streams(path: Path) -> tuple[dict[str, tuple[Array, Array]], tuple[str, ...], list[int]]:
    """Return ``gyro``, ``accelerometer`` and ``command``, each as times (N,) in s and values (N,
    3 or 4) in the kit's axes and order of rotors; notes; and PX4's motor, from 1, of each rotor.

    Raises:
        InputError: no ULog, or one without gyro, accelerometer or commands of four motors.
    """
    log = _open(path)
    order, order_note = _motor_order(log)
    streams = {}
    for name, field in (("gyro", "gyro_rad"), ("accelerometer", "accelerometer_m_s2")):
        found = _inertial(log, field)
        if found is None:
            raise InputError(f"{path}: no sensor_combined; expected gyro and accelerometer in it")
        streams[name] = _clean(found.t, found.values)
    for fields in log.topics.get("actuator_motors", []):
        names = tuple(f"control[{i}]" for i in range(4))
        control = np.nan_to_num(log.columns("actuator_motors", fields, names), nan=0.0)
        if np.any(control > 0.0):
            streams["command"] = _clean(_times(fields), np.clip(control, 0.0, 1.0)[:, order])
            return streams, (order_note, "commands: actuator_motors"), [i + 1 for i in order]
    _, slots = _output_slots(log)
    for fields in log.topics.get("actuator_outputs", []):
        names = tuple(f"output[{i}]" for i in slots)
        outputs = np.nan_to_num(log.columns("actuator_outputs", fields, names), nan=0.0)
        if not np.all(np.ptp(outputs, axis=0) > 0.0):
            continue  # servos, or an output bank that is not in use
        if outputs.max() > 1.5:
            outputs = (outputs - _LOW) / _SPAN
        t = 1e-6 * np.asarray(fields["timestamp"], dtype=np.float64)
        streams["command"] = _clean(t, np.maximum(outputs, 0.0)[:, order])
        return streams, (order_note, "commands: actuator_outputs"), [i + 1 for i in order]
    raise InputError(
        f"{path}: no motors: expected actuator_motors or actuator_outputs of four motors that ran"
    )


def _clean(t: Array, values: Array) -> tuple[Array, Array]:
    """Return the samples that are finite and later than every one before them."""
    finite = np.isfinite(t) & np.isfinite(values).all(axis=1)
    found, _ = Stream("", t[finite], values[finite]).forward()
    return found.t, found.values
