"""Rotor speeds of a log with motor commands alone, by the vehicle's motor curve or by an
assumption, with a note.

Without a curve only the ratio of thrusts is assumed, ``f a^2 + (1 - f) a`` of a command a from 0 to
1. The scale follows from flying. With an accelerometer, thrust is the mass times the reading along
   the rotors' axis, on the median over the flight: a fault or a crash at the end does not move the
   median. Without one, the mean vertical thrust is the weight, over a flight from rest to rest. The
   thrust along each time's own rotor axis is counted by its vertical part: a tilted flight needs
   more than its weight.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...dynamics.vehicle import Vehicle
from ..motion.smoothing import unbroken
from .flight_log import FlightLog, SomeVehicle
from .flight_phases import flying
from .log_map import Commands
from .magnitudes import within
from .table import Array, Lines, Noted, SomeArray, lengths


def with_commanded_speeds(
    log: FlightLog, vehicle: SomeVehicle, model: Commands | None = None
) -> FlightLog:
    """Return a log with rotor speeds from its commands, unless speeds were measured. Speeds that
    another vehicle's thrust model gave are replaced by those of ``vehicle``'s motor curve.

    Args:
        log: the flight.
        vehicle: of the flight; None: no speeds.
        model: thrust of a command for a vehicle without a motor curve; None: grows with the
            command's square.
    """
    of_another = log.commanded and vehicle is not None and vehicle.motor_curve is not None
    if log.command is None or (log.has_rotor_speeds and not of_another):
        return log
    speeds, notes = _speeds(log, log.command, vehicle, model or Commands(()))
    log = replace(log, notes=(*log.notes, *notes))
    return log if speeds is None else replace(log, rotor_speeds=speeds, commanded=True)


def _speeds(
    log: FlightLog, command: Array, vehicle: SomeVehicle, model: Commands
) -> Noted[SomeArray]:
    """Return the rotor speeds (N, 4) in rad/s of commands (N, 4), None without a thrust model, and
    notes.
    """
    unknown = "no rotor speeds: the log has motor commands"
    if vehicle is None:
        return None, [f"{unknown}, and no vehicle says what they give"]
    name = vehicle.name
    if vehicle.motor_curve is not None:
        return vehicle.commanded_speeds(command, log.voltage), [
            f"rotor speeds: worked out from the motor commands by the motor curve of {name}, "
            f"thrust {_polynomial(vehicle.motor_curve.thrust)} N a rotor, without the motors' lag"
        ]
    if model.thrust:
        low, high = model.range or (0.0, 1.0)
        reference = vehicle.voltage_ref if vehicle.voltage_ref > 0.0 else model.full_voltage
        counts = low + command * (high - low)
        thrust = np.polynomial.Polynomial(model.thrust)(counts * (reference / model.full_voltage))
        source = f" ({model.thrust_source})" if model.thrust_source else ""
        notes = [
            f"thrust model: no rotor speeds in the log; a motor is assumed to give "
            f"{_polynomial(model.thrust)} N{source} at "
            f"u = command * {reference:g} V / {model.full_voltage:g} V, and rotor speeds are "
            f"sqrt(thrust / k) with the k of {name}, at {reference:g} V whatever the "
            "battery's voltage. A constant factor on thrust and the mass cannot be found from this "
            "log"
        ]
        if saturated := (command.max(axis=1) >= 0.9995).mean():
            notes.append(f"a motor is at full command in {100.0 * saturated:.1f} % of the samples")
        return np.sqrt(np.where(command > 0.0, np.maximum(thrust, 0.0), 0.0) / vehicle.k), notes
    least, most = model.thrust_span
    share = ((command - least) / (most - least)).clip(0.0, None)
    factor, rest = model.thrust_factor, 1.0 - model.thrust_factor
    relative = factor * share**2 + rest * share
    total = relative.sum(axis=1)
    x, felt = log.accelerometer, None
    if x is not None:  # beside a pose, an unusual size counts as unknown: a unit may be another
        usual = within(np.nanmedian(lengths(x)), (6.0, 16.0))
        felt = x[:, 2] if usual or not log.has_pose else None
    where = "a pose" if felt is None else "an accelerometer"
    if felt is None and not log.has_pose:
        return None, [
            f"{unknown}, no pose and no accelerometer, and the vehicle {name} states no "
            "motor_curve; state it to turn commands into thrust"
        ]
    scale = _scale(log, total, felt, vehicle)
    if scale is None:
        return None, [f"no rotor speeds: the motor commands are 0 wherever there is {where}"]
    balance = (
        f"the mean vertical thrust in flight is the weight of {name} ({vehicle.weight:.4g} N)"
        if felt is None
        else f"the thrust in flight is, on the median, the mass of {name} ({vehicle.mass:.4g} kg) "
        "times the accelerometer along the rotors' axis"
    )
    assumed = {0.0: "u", 1.0: "u^2"}.get(factor, f"{factor:g} u^2 + {rest:.4g} u")
    if (least, most) != (0.0, 1.0):
        assumed = f"{assumed.replace('u', 'a')} with a = (u - {least:g}) / {most - least:g}"
    return np.sqrt(scale * relative / vehicle.k), [
        "thrust model: no rotor speeds in the log; the relative thrust of a motor command u is "
        f"assumed to be {assumed}, and its unknown scale is set so that {balance}: "
        f"{scale:.4g} N a motor at full command. Mass or a factor on thrust cannot be found from "
        "this log, nor a thrust curve or the battery's sag; rotor speeds are sqrt(thrust / k) of "
        "commands, without the motors' lag. State motor_curve in the vehicle file to mend that"
    ]


def speeds_of_wrench(wrench: Array, vehicle: Vehicle, notes: Lines) -> Array:
    """Return rotor speeds (N, 4) in rad/s of commanded collective thrusts and torques (N, 4);
    ``notes`` get further ones.
    """
    square = np.linalg.solve(vehicle.mixing, wrench.T).T
    notes.append(
        "no rotor speeds in the log: commanded thrust and torques were converted into rotor speeds "
        f"by the inverse of the rotor mixing of {vehicle.name}, clipped at zero and at omega_max. "
        "What the firmware's thrust curve, the battery and the motors made of the command is not "
        "in the log; a constant factor on thrust remains unknown"
    )
    within_reach = square.clip(0.0, vehicle.omega_max**2)
    if clipped := (square != within_reach).any(axis=1).sum():
        notes.append(
            f"the commands of {clipped} sample(s) were out of the rotors' reach and were clipped"
        )
    return np.asarray(np.sqrt(within_reach))


def _polynomial(coefficients: Sequence[float]) -> str:
    """Return a polynomial of u in words, by the coefficients of its powers 0, 1, 2 ..."""
    powers = ("", " u", *(f" u^{i}" for i in range(2, len(coefficients))))
    return " + ".join(f"{c:.4g}{u}" for c, u in zip(coefficients, powers, strict=False) if c)


def _scale(log: FlightLog, total: Array, felt: SomeArray, vehicle: Vehicle) -> float | None:
    """Return N of a motor at full command, or None where no motor runs in flight: from ``felt``
    (N,), the specific force along the rotors' axis in m/s2, else from the weight. In flight are
    samples of high thrust, and of low for a moment between high ones.
    """
    rows = log.valid if felt is None else np.isfinite(felt)
    t, total = log.t[rows], total[rows]
    aloft = flying(total)
    # a vehicle falls 5 m in a dip of 1 s. Without dips, high thrusts alone would remain, with a
    # mean above the weight
    for run in unbroken(t, np.flatnonzero(aloft), 1.0):
        aloft[run[0] : run[-1]] = True
    if felt is not None:
        felt = felt[rows]
        usable = aloft & (total > 0.0) & (felt > 0.0)
        share = felt[usable] / total[usable]
        return vehicle.mass * np.median(share) if len(share) else None
    _, x, y, _ = log.quaternion[rows].T
    vertical = (total * (1.0 - 2.0 * (x * x + y * y)))[aloft]
    mean = vertical.mean() if len(vertical) else 0.0
    return vehicle.weight / mean if mean > 0.0 else None
