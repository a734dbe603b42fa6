"""What the fields of a blackbox of Betaflight or INAV are, and the tables of blackbox_decode.

* **Axes.** The board's: x forward, y left, z up, so that a roll to the right, nose down and a turn
  to the left are positive, and an accelerometer at rest reads +1 g along z. As here.
* **Gyro.** Degrees per second. ``gyroUnfilt`` where it was logged, else ``gyroADC``, which the
  firmware filtered for its flight loop.
* **Accelerometer.** ``accSmooth``, low-passed by the firmware (``acc_lpf_hz``), in counts:
  ``acc_1G`` of the header is one g; without a header, the power of two that is nearest to its
  length in the first half second, when a quadrotor stands (recording begins when it is armed).
* **Commands.** ``motor[0..3]``, between the two numbers of the header's ``motorOutput``; without
  one, 48 to 2047 (DShot) where a motor leaves 1000 to 2000, else those.
* **Rotor speeds.** ``eRPM[0..3]`` of bidirectional DShot, in hundreds: rpm is eRPM times 200 over
  the number of magnet poles, which the header (``motor_poles``) or the reader's option says, else
  14.
* **Voltage.** ``vbatLatest``, V, or hundredths of it in a log as it is.

There is no pose. A table has the log's numbers without its headers, so what the headers would say
is told from the numbers, and a note says how.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..channels import Samples
from ..flight_log import FlightLog
from ..log_map import Battery, Commands, LogMap, Rotors, Sensor, TimeColumn
from ..mapped_log import map_recording
from ..rotor_orders import ORDERS
from ..tables import open_table

Array = NDArray[np.float64]

SIGNATURE = ("time (us)", "motor[0]", "motor[3]")

_UNITS = (" (g)", " (m/s2)", " (deg/s)", " (rad/s)", " (V)", " (mV)", "")
_GYRO = tuple(f"gyroADC[{i}]" for i in range(3))
_RAW_GYRO = tuple(f"gyroUnfilt[{i}]" for i in range(3))
_FORCE = tuple(f"accSmooth[{i}]" for i in range(3))
_MOTORS = tuple(f"motor[{i}]" for i in range(4))
_ERPM = tuple(f"eRPM[{i}]" for i in range(4))
_VOLTAGE = "vbatLatest"
FIELDS = (*_GYRO, *_RAW_GYRO, *_FORCE, *_MOTORS, *_ERPM, _VOLTAGE)

_G = 9.80665  # m/s2
_POLES = 14  # of most motors of 5 inch quadrotors
_STANDING = 0.5  # s after arming in which a vehicle stands
_ONE_G = 2.0 ** np.arange(8, 15)  # counts
_DSHOT, _PWM = (48.0, 2047.0), (1000.0, 2000.0)


def read(path: Path, vehicle: Vehicle | None = None, option: str = "") -> FlightLog:
    """Read a table of blackbox_decode; ``option``: number of the motors' magnet poles, for eRPM.

    Raises:
        InputError: the file cannot be read, or lacks a column.
    """
    poles = magnet_poles(option, path)
    table = open_table(path)
    missing = [name for name in SIGNATURE if name not in table.header]
    if missing:
        raise InputError(
            f"{path}: missing column(s) {', '.join(missing)}; expected those of blackbox_decode"
        )
    named = {(f, u): f"{f}{u}" for f in FIELDS for u in _UNITS if f"{f}{u}" in table.header}
    columns = table.read(["time (us)", *named.values()])
    return betaflight_log(
        path,
        "betaflight_csv",
        1e-6 * columns["time (us)"],
        {field: columns[name] for (field, _), name in named.items()},
        {field: unit.strip(" ()") for field, unit in named},
        {},
        poles,
        vehicle,
        table.notes,
    )


def magnet_poles(option: str, path: Path) -> int | None:
    """Return the number of magnet poles that a reader's option says; None: nothing.

    Raises:
        InputError: it is none.
    """
    if not option:
        return None
    if not (option.isdecimal() and len(option) < 4 and int(option) >= 2 and int(option) % 2 == 0):
        raise InputError(
            f"{path}: reader option {option!r}; expected the motors' number of magnet poles, even, "
            "such as betaflight:14"
        )
    return int(option)


def betaflight_log(
    path: Path,
    reader: str,
    t: Array,
    fields: Mapping[str, Array],
    units: Mapping[str, str],
    headers: Mapping[str, str],
    poles: int | None,
    vehicle: Vehicle | None,
    notes: tuple[str, ...],
) -> FlightLog:
    """Return the log of a blackbox's fields.

    Args:
        path: the file.
        reader: its reader's name.
        t: (N,) s.
        fields: (N,) each, by their names in ``FIELDS``.
        units: of fields that state one (``g``, ``m/s2``, ``deg/s``, ``rad/s``, ``V``, ``mV``).
        headers: of the blackbox; nothing in a table.
        poles: magnet poles that the user says; None: the header's.
        vehicle: with a motor curve, it turns commands into rotor speeds.
        notes: of the reader.

    Raises:
        InputError: no motors, or no gyro and accelerometer.
    """
    if not set(_MOTORS) <= set(fields):
        raise InputError(
            f"{path}: no motors; expected {_MOTORS[0]} to {_MOTORS[-1]}, found "
            f"{', '.join(fields) or 'none of the fields'}"
        )
    order = ORDERS["betaflight"]
    low, high, whence = _range(path, np.column_stack([fields[m] for m in _MOTORS]), headers)
    said = [
        *notes,
        "body axes taken as forward, left, up, as the board has them",
        f"commands: motor[0] to motor[3], {low:g} to {high:g} ({whence}) taken as 0 to 1",
    ]
    parts: dict[str, Any] = {"commands": Commands(_MOTORS, order=order, range=(low, high))}
    if set(_ERPM) <= set(fields) and any(np.any(fields[name] > 0.0) for name in _ERPM):
        scale, words = _rpm(headers, poles)
        parts["rotors"] = Rotors(_ERPM, "rpm", scale, order=order)
        said.append(words)
    gyro = _RAW_GYRO if set(_RAW_GYRO) <= set(fields) else _GYRO
    if set(gyro) <= set(fields):
        unit = "rad/s" if units.get(gyro[0]) == "rad/s" else "deg/s"
        fine = 10.0 if headers.get("blackbox_high_resolution") == "1" else 1.0
        parts["gyro"] = Sensor(gyro, unit, 1.0 / fine)
        said.append(
            "gyro: gyroUnfilt, before the firmware's filters"
            if gyro is _RAW_GYRO
            else "gyro: gyroADC, which the firmware filtered; its noise is not the sensor's"
        )
    if set(_FORCE) <= set(fields):
        force = np.column_stack([fields[name] for name in _FORCE])
        scale, words = _one_g(t, force, units.get(_FORCE[0], ""), headers)
        parts["accelerometer"] = Sensor(_FORCE, "m/s2", scale)
        said.append(f"accelerometer: accSmooth, low-passed by the firmware; {words}")
    if _VOLTAGE in fields:
        scale = {"V": 1.0, "mV": 1e-3}.get(units.get(_VOLTAGE, ""), 0.01)
        parts["battery"] = Battery((_VOLTAGE,), "V", scale)
    log_map = LogMap(TimeColumn(), rows="streams", **parts)
    samples = Samples(t, fields)
    return map_recording(path, [samples], log_map, vehicle, reader, tuple(said))


def _range(path: Path, motors: Array, headers: Mapping[str, str]) -> tuple[float, float, str]:
    """Return the values of the commands 0 and 1, and whence they are known.

    Raises:
        InputError: the header's are none.
    """
    stated = headers.get("motorOutput", "")
    if stated:
        try:
            low, high = (float(x) for x in stated.split(","))
        except ValueError as error:
            raise InputError(
                f"{path}: header motorOutput: {stated[:60]!r}; expected two numbers"
            ) from error
        if not 0.0 <= low < high <= 1e5:
            raise InputError(
                f"{path}: header motorOutput: {stated[:60]!r}; expected the lower number first"
            )
        return low, high, "motorOutput of the header"
    outside = np.nanmax(motors) > _PWM[1] or np.any((motors < _PWM[0]) & (motors > 0.0))
    low, high = _DSHOT if outside else _PWM
    return low, high, f"assumed: {'DShot' if outside else 'pulses in us'}, no header says it"


def _rpm(headers: Mapping[str, str], poles: int | None) -> tuple[float, str]:
    """Return the rpm in one count of eRPM, and the note on rotor speeds."""
    stated = headers.get("motor_poles", "")
    whence = "as the reader's option says"
    if poles is None:
        known = stated.isdecimal() and 2 <= int(stated[:4]) <= 100
        poles = int(stated) if known else _POLES
        whence = "motor_poles of the header" if known else "assumed; betaflight:NUMBER says another"
    return 200.0 / poles, (
        f"rotor speeds: measured by bidirectional DShot (eRPM), {poles} magnet poles ({whence})"
    )


def _one_g(t: Array, force: Array, unit: str, headers: Mapping[str, str]) -> tuple[float, str]:
    """Return m/s2 in one count of the accelerometer, and words on whence that is known."""
    if unit:
        return {"g": _G, "m/s2": 1.0}.get(unit, 1.0), f"in {unit}"
    stated = headers.get("acc_1G", "")
    if stated.isdecimal() and 1 <= int(stated[:9]) <= 10**6:
        return _G / int(stated), f"acc_1G of the header: {stated} counts are 1 g"
    length = np.linalg.norm(force[t <= t[0] + _STANDING], axis=1)
    middle = float(np.nanmedian(length)) if np.isfinite(length).any() else 0.0
    counts = float(_ONE_G[np.argmin(np.abs(np.log2(np.maximum(middle, 1.0) / _ONE_G)))])
    return _G / counts, (
        f"{counts:g} counts taken as 1 g, from its {middle:.4g} in the first {_STANDING:g} s; no "
        "header says it"
    )
