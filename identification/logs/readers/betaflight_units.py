"""What the fields of a blackbox of Betaflight or INAV are, in the kit's units and axes.

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

Motors count 1 rear-right, 2 front-right, 3 rear-left, 4 front-left (quad x). There is no pose.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_log import FlightLog
from ..rotor_orders import ORDERS
from .streams import Stream, flight_log

Array = NDArray[np.float64]

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
    order = np.array(ORDERS["betaflight"]) - 1
    if not set(_MOTORS) <= set(fields):
        raise InputError(
            f"{path}: no motors; expected {_MOTORS[0]} to {_MOTORS[-1]}, found "
            f"{', '.join(fields) or 'none of the fields'}"
        )
    said = [*notes, "body axes taken as forward, left, up, as the board has them"]

    def block(names: tuple[str, ...]) -> Array | None:
        if not set(names) <= set(fields):
            return None
        return np.column_stack([fields[name] for name in names])

    motors = block(_MOTORS)
    assert motors is not None
    low, high, whence = _range(path, motors, headers)
    said.append(
        f"commands: motor[0] to motor[3], {low:g} to {high:g} ({whence}) taken as 0 to 1; rotors "
        f"1, 2, 3, 4 are motors {', '.join(map(str, ORDERS['betaflight']))}, as on Betaflight's "
        "quad x"
    )
    command = Stream("motor", t, np.clip((motors - low) / (high - low), 0.0, 1.0)[:, order])
    rotors, rotor_notes = _rotor_speeds(block(_ERPM), t, order, headers, poles)
    said += rotor_notes
    gyro = block(_RAW_GYRO)
    if gyro is None:
        gyro, name = block(_GYRO), _GYRO[0]
        said.append("gyro: gyroADC, which the firmware filtered; its noise is not the sensor's")
    else:
        name = _RAW_GYRO[0]
        said.append("gyro: gyroUnfilt, before the firmware's filters")
    if gyro is not None:
        gyro = gyro * (1.0 if units.get(name) == "rad/s" else np.pi / 180.0) / _fine(headers)
    force = block(_FORCE)
    if force is not None:
        unit, words = _one_g(t, force, units.get(_FORCE[0], ""), headers)
        force = force * unit
        said.append(f"accelerometer: accSmooth, low-passed by the firmware; {words}")
    voltage = None
    if _VOLTAGE in fields:
        scale = {"V": 1.0, "mV": 1e-3}.get(units.get(_VOLTAGE, ""), 0.01)
        voltage = Stream("vbatLatest", t, scale * fields[_VOLTAGE][:, None])
    return flight_log(
        path,
        reader,
        None,
        rotors,
        voltage,
        tuple(said),
        None if force is None else Stream("accSmooth", t, force),
        None if gyro is None else Stream(name.partition("[")[0], t, gyro),
        command=command,
        vehicle=vehicle,
    )


def _fine(headers: Mapping[str, str]) -> float:
    """Return by what a log of high resolution multiplied its gyro."""
    return 10.0 if headers.get("blackbox_high_resolution") == "1" else 1.0


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


def _rotor_speeds(
    erpm: Array | None,
    t: Array,
    order: NDArray[np.int64],
    headers: Mapping[str, str],
    poles: int | None,
) -> tuple[Stream | None, list[str]]:
    """Return rotor speeds (N, 4) in rad/s of bidirectional DShot, and the note on them."""
    if erpm is None or not np.any(erpm > 0.0):
        return None, []
    stated = headers.get("motor_poles", "")
    whence = "as the reader's option says"
    if poles is None:
        known = stated.isdecimal() and 2 <= int(stated[:4]) <= 100
        poles = int(stated) if known else _POLES
        whence = "motor_poles of the header" if known else "assumed; betaflight:NUMBER says another"
    speeds = np.abs(erpm) * (200.0 / poles) * (2.0 * np.pi / 60.0)
    there = np.isfinite(speeds).all(axis=1)
    return Stream("eRPM", t[there], speeds[there][:, order]), [
        f"rotor speeds: measured by bidirectional DShot (eRPM), {poles} magnet poles ({whence})"
    ]


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
