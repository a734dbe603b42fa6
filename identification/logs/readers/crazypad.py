"""CrazyPAD flights: a Crazyflie 2.1 with weights under its arms or a cut propeller
(AerialRoboticsUUST/CrazyPAD; Masalimov and others, Data 2024, 9, 79), converted to CSV.

What differs from the kit's own format:

* **Requests, not rotor speeds.** ``motor_m*`` is what the flight loop asked each motor for, 0 to
  65535, before the firmware's battery compensation; it is linear in thrust. It becomes ``command``,
  0 to 1. Rotor speeds stay unknown unless the vehicle states a motor curve.
* **No pose.** Pitch was not logged, nor a quaternion; so ``position`` and ``quaternion`` are NaN
  throughout. What the onboard filter said is kept in ``extra``.
* **No gyro, no accelerometer.** Only how the rotors share the work can be read from these flights.
* **Motor order** is the Crazyflie's: m1 front-right, m2 rear-right, m3 rear-left, m4 front-left.

``extra`` keeps, where logged: ``sent`` (N, 4) what the motors got, 0 to 1, in this kit's order;
``onboard_position`` (N, 3) m, ``onboard_velocity`` (N, 3) m/s, ``onboard_acceleration`` (N, 3) m/s2
(world, without gravity), ``roll`` and ``yaw`` (N,) rad.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..flight_log import FlightLog, check_finite, check_times, log_name, time_notes
from ..tables import open_table

Array = NDArray[np.float64]

_ORDER = (4, 3, 2, 1)  # the Crazyflie's motor of rotors 1 front-left, 2 rear-left, ...
_REQUESTS = tuple(f"motor_m{i}_0to65535" for i in _ORDER)
_SENT = tuple(f"pwm_m{i}_0to65535" for i in _ORDER)
_FULL = 65535.0
SIGNATURE = ("t_s", *_REQUESTS)

_G = 9.80665  # m/s2 in one g
# names in ``extra``: columns, and what turns their unit into SI
_EXTRA: dict[str, tuple[tuple[str, ...], float]] = {
    "sent": (_SENT, 1.0 / _FULL),
    "onboard_position": (tuple(f"est_{axis}_m" for axis in "xyz"), 1.0),
    "onboard_velocity": (tuple(f"est_v{axis}_mps" for axis in "xyz"), 1.0),
    "onboard_acceleration": (tuple(f"est_a{axis}_g" for axis in "xyz"), _G),
    "roll": (("roll_deg",), np.pi / 180.0),
    "yaw": (("yaw_deg",), np.pi / 180.0),
}


def read(path: Path, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a CrazyPAD CSV; ``vehicle`` is asked for its motor curve alone, and may be None.

    Raises:
        InputError: the file cannot be read, lacks a column, or holds a request outside 0 to 65535
            or a number that is not finite.
    """
    table = open_table(path)
    missing = [name for name in SIGNATURE if name not in table.header]
    if missing:
        raise InputError(
            f"{path}: missing column(s) {', '.join(missing)}; expected those of a CrazyPAD flight"
        )
    known = dict.fromkeys(
        [*SIGNATURE, "vbat_V", *(name for group, _ in _EXTRA.values() for name in group)]
    )
    columns = table.read([name for name in known if name in table.header])
    for name, column in columns.items():
        check_finite(table, name, column)
    check_times(table, columns["t_s"])
    for name in (*_REQUESTS, *(name for name in _SENT if name in columns)):
        outside = np.flatnonzero((columns[name] < 0.0) | (columns[name] > _FULL))
        if outside.size:
            raise InputError(
                f"{path}: column {name}, {table.row(outside[0])}: {columns[name][outside[0]]:g}; "
                f"expected 0 to {_FULL:g}"
            )
    t = columns["t_s"]
    command = np.column_stack([columns[name] for name in _REQUESTS]) / _FULL
    voltage = columns.get("vbat_V")
    speeds = np.full((len(t), 4), np.nan)
    curve = vehicle is not None and vehicle.motor_curve is not None
    if vehicle is not None and curve:
        speeds = vehicle.commanded_speeds(command, voltage)
    extra = {
        name: np.column_stack([columns[column] for column in group]).squeeze() * scale
        for name, (group, scale) in _EXTRA.items()
        if set(group) <= set(columns)
    }
    return FlightLog(
        t=t,
        position=np.full((len(t), 3), np.nan),
        quaternion=np.full((len(t), 4), np.nan),
        rotor_speeds=speeds,
        command=command,
        commanded=curve,
        voltage=voltage,
        name=log_name(path),
        source=f"{path} (reader crazypad)",
        notes=(
            "no pose in the log (pitch is missing), no gyro and no accelerometer: it shows how the "
            "rotors share the work, and nothing else",
            "motor requests, taken as linear in thrust, are the commands; rotors 1, 2, 3, 4 are "
            "the Crazyflie's motors 4, 3, 2, 1",
            *time_notes(t),
        ),
        extra=extra,
        vehicle="crazyflie",
    )
