"""NanoBench logs: a Crazyflie 2.1 in a Vicon room (Ullah and Baca, arXiv 2603.09908).

What differs from the kit's own format: quaternions are scalar last, times are of an absolute clock, motors count 1
front-right, 2 rear-right, 3 rear-left, 4 front-left, and instead of rotor speeds there are PWM counts (0 to 65535) and
the battery's voltage.

**Thrust model.** The counts logged are those after the firmware's battery compensation, so the voltage that a motor
gets is duty times battery voltage, and at the same counts a full battery lifts more than an empty one. The reader does
not apply the voltage: rotor speeds are those that the counts would give at the vehicle's ``voltage_ref`` (4.2 V where it
states none), and the voltage is passed on, so that an effect of the voltage can be declared, or named by a diagnosis, with an
exponent of its own. Without it the wrench of a flight holds what the battery lacked.

The polynomial is Foerster's (System Identification of the Crazyflie 2.0 Nano Quadrocopter, ETH Zurich 2015),
2.130295e-11 u^2 + 1.032633e-6 u + 5.484560e-4 N per motor at ``u = PWM * voltage_ref / 4.2 V``: his counts are taken to be
those of a full cell. A motor without PWM gives no thrust, not the polynomial's constant.

**Accelerometer.** In g, of the Crazyflie's body (forward, left, up); read where all three axes are in the file. The
gyro is not: the file states no unit for it.

**Voltage.** It is read ten times a second and comes late: put 0.05 to 0.1 s sooner it leaves the least in the vertical
force of four flights, 0.0909 m/s2 (0.1 s) and 0.0911 (0.05 s) instead of 0.0934 pooled (4 Hz; exponent, motor lag and a scale
for each flight fitted), and 0.0971 put 0.1 s later. It is put 0.075 s sooner. The motor lag that fits goes with it: 65 ms
as logged, 41 to 45 ms once the voltage is that much sooner.

The curve was chosen among published ones, none fitted to these logs, by the vertical specific force of four flights with
the voltage applied as the table says (Vicon, 4 Hz low pass, 29-32 s each above 0.6 m; B2 circle, B3 figure 8, B5 helix,
B7 oval). The mass is the one that balances thrust and specific force on average; the scatter is the standard deviation of
thrust / that mass less specific force:

| curve                                      | mass, g                | scatter, m/s2          |
| ------------------------------------------ | ---------------------- | ---------------------- |
| Foerster, PWM * V / 4.2 V (taken)          | 37.1, 36.7, 37.0, 38.6 | 0.07, 0.08, 0.08, 0.10 |
| Foerster, PWM * V / 3.7 V                  | 44.9, 44.3, 44.7, 46.6 | 0.07, 0.08, 0.08, 0.10 |
| Foerster, PWM alone                        | 50.7, 52.5, 52.0, 49.5 | 0.18, 0.17, 0.19, 0.38 |
| Bitcraze test stand, quadratic in duty * V | 49.6, 48.9, 49.3, 51.6 | 0.07, 0.08, 0.09, 0.10 |
| Bitcraze firmware before 2025 (inverted)   | 55.4, 54.6, 55.3, 58.0 | 0.26, 0.17, 0.23, 0.24 |
| Bitcraze firmware 2025, 2.1+ propellers    | 43.4, 42.5, 43.1, 45.5 | 0.09, 0.11, 0.12, 0.13 |

The product with the voltage halves the scatter at least; which curve then decides little but the level. The mass
stated is 27 g, and with its marker deck the vehicle may have had 30 to 35 g: every curve promises more thrust than
there was (worn motors, or a heavier vehicle), this one the least. What is left is a constant factor on thrust, for
diagnosis to find; a hover cannot tell it from mass.
"""  # noqa: E501

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....dynamics.effects import Role, playing
from ....dynamics.vehicle import Vehicle
from ....dynamics.vehicle_file import load_vehicle
from ....runtime.errors import InputError
from ..flight_log import (
    FlightLog,
    Mask,
    check_finite,
    check_times,
    log_name,
    sensor_columns,
    time_notes,
    unit_quaternions,
)
from ..tables import open_table

Array = NDArray[np.float64]

SIGNATURE = ("motor_motor_m1", "motor_motor_m2", "motor_motor_m3", "motor_motor_m4", "pwr_pm_vbat")

_POSE = ("px", "py", "pz", "qw", "qx", "qy", "qz")
_MOTORS = (
    "motor_motor_m4",
    "motor_motor_m3",
    "motor_motor_m2",
    "motor_motor_m1",
)  # in the kit's order of rotors
_ACCELEROMETER = ("imu_acc_x", "imu_acc_y", "imu_acc_z")  # g, body axes forward, left, up
_G = 9.81  # m/s2
_FULL_COUNT = 65535.0
_FULL_VOLTAGE = 4.2  # V
_VOLTAGE_LATE = 0.075  # s
_THRUST = (2.130295e-11, 1.032633e-6, 5.484560e-4)  # N per motor, powers 2, 1, 0 of the counts


def read(path: Path, vehicle: Vehicle | None = None) -> FlightLog:
    """Read a NanoBench CSV; ``vehicle`` (default: the crazyflie preset) converts thrust into
    rotor speeds through its k.

    Raises:
        InputError: the file cannot be read, lacks a column, or holds a number out of range.
    """
    vehicle = load_vehicle("crazyflie") if vehicle is None else vehicle
    table = open_table(path)
    names = ["t", *_POSE, *SIGNATURE]
    missing = [name for name in names if name not in table.header]
    if missing:
        raise InputError(
            f"{path}: missing column(s) {', '.join(missing)}; expected those of a nanobench log"
        )
    inertial = _ACCELEROMETER if set(_ACCELEROMETER) <= set(table.header) else ()
    columns = table.read([*names, *inertial])
    accelerometer = sensor_columns(table, columns, inertial)
    pose = np.column_stack([columns[name] for name in _POSE])
    valid: Mask = ~np.all(np.isnan(pose), axis=1)
    for name in names:
        check_finite(table, name, columns[name], valid if name in _POSE else None)
    check_times(table, columns["t"])
    voltage = columns["pwr_pm_vbat"]
    sooner = np.interp(columns["t"] + _VOLTAGE_LATE, columns["t"], voltage)
    if np.any(voltage <= 0):
        i = int(np.flatnonzero(voltage <= 0)[0])
        raise InputError(
            f"{path}: column pwr_pm_vbat, {table.row(i)}: {voltage[i]:g} V; expected a positive "
            f"voltage"
        )
    pwm = np.column_stack([columns[name] for name in _MOTORS])
    reference = vehicle.voltage_ref if vehicle.voltage_ref > 0 else _FULL_VOLTAGE
    notes = [
        "motors renumbered: rotors 1, 2, 3, 4 are the log's m4, m3, m2, m1; time counts from the "
        "first sample",
        f"thrust model: 2.130e-11 u^2 + 1.033e-6 u + 5.48e-4 N per motor (Foerster 2015) at u = "
        f"PWM * {reference:g} V / 4.2 V; "
        f"rotor speeds are sqrt(thrust / k) with the k of {vehicle.name}. The PWM logged is after "
        f"battery compensation, so "
        f"thrust falls with the voltage: these are rotor speeds at {reference:g} V; declare "
        f"{' or '.join(playing(Role.THRUST_OVER_VOLTAGE))} or let the diagnosis find it. A "
        "constant factor on thrust remains unknown",
        f"battery voltage put {_VOLTAGE_LATE:g} s sooner, by which it is logged late",
    ]
    outside = (pwm < 0) | (pwm > _FULL_COUNT)
    if outside.any():
        notes.append(
            f"{int(outside.sum())} PWM value(s) outside 0 to 65535 were taken at the limit"
        )
        pwm = np.clip(pwm, 0.0, _FULL_COUNT)
    saturated = float(np.mean(pwm.max(axis=1) >= 65500.0))
    if saturated > 0:
        notes.append(f"a motor is at full PWM in {100 * saturated:.1f} % of the samples")
    return FlightLog(
        t=columns["t"] - columns["t"][0],
        position=pose[:, :3].copy(),
        quaternion=unit_quaternions(table, pose[:, 3:], valid, "qw, qx, qy, qz"),
        rotor_speeds=np.sqrt(motor_thrust(pwm, np.full(len(pwm), reference)) / vehicle.k),
        voltage=sooner,
        accelerometer=None if accelerometer is None else _G * accelerometer,
        name=log_name(path),
        source=f"{path} (reader nanobench)",
        notes=(*notes, *time_notes(columns["t"])),
        valid=valid,
        commanded=True,
        command=pwm / _FULL_COUNT,
        vehicle="crazyflie",
    )


def motor_thrust(pwm: Array, voltage: Array) -> Array:
    """Return thrusts (N, 4) in N of PWM counts (N, 4) after compensation at battery voltages (N,)
    in V.
    """
    u = pwm * (voltage[:, None] / _FULL_VOLTAGE)
    thrust: Array = np.where(pwm > 0, (_THRUST[0] * u + _THRUST[1]) * u + _THRUST[2], 0.0)
    return thrust
