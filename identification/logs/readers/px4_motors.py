"""PX4's vehicle and motors, by parameters: what flew, which motor is which rotor, which output
drives it, and in what range.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ....dynamics.vehicle import Vehicle
from ....runtime.errors import InputError
from ..log_map import LogMap
from ..rotor_orders import ORDERS, Order
from ..table import Array
from ..what_flew import (
    PLUS,
    QUADROTOR,
    WhatFlew,
    airframes,
    order_by_places,
    slots_of_motors,
)

Parameters = Mapping[str, float]

MOTOR1 = 101  # PX4's number of the output function "motor 1"
_BANKS = {"MAIN": "PWM_MAIN_FUNC", "AUX": "PWM_AUX_FUNC", "UAVCAN": "UAVCAN_EC_FUNC"}
_OUTPUTS = 16  # of a bank
_ESCS = 8
_LARGEST_SHARE = 1.5  # an output beyond is no share, but of the protocol's range
_DSHOT = (0.0, 1999.0)
_UAVCAN = (0.0, 8191.0)
_DSHOT_TIMERS = range(-5, -1)  # of PWM_MAIN_TIMn: DShot150 to DShot1200
_LEAST_PULSE = 700.0  # us: no speed controller is sent a shorter one, disarmed or not
_ABOVE_PULSES = 1.1  # of the longest pulse, which no pulse reaches


@dataclass(frozen=True, eq=False)
class Outputs:
    """The outputs of motors 1 to 4, and what of them is 0 and 1."""

    slots: list[int]  # from 0
    low: Array  # (4,) what is 0
    high: Array  # (4,) what is 1
    words: str  # protocol and range


def what_flew(parameters: Parameters, statuses: Sequence[Mapping[str, Array]]) -> WhatFlew:
    """Return what a log states of its vehicle.

    Args:
        parameters: as the log begins.
        statuses: of the topic vehicle_status.
    """
    known = airframes()
    count, frame, kind, start = (
        int(parameters.get(name, 0))
        for name in ("CA_ROTOR_COUNT", "CA_AIRFRAME", "MAV_TYPE", "SYS_AUTOSTART")
    )
    if frame in known["px4_airframe"]:
        return WhatFlew(known["px4_airframe"][frame], f"parameter CA_AIRFRAME = {frame}")
    if any(np.any(fields.get("is_vtol", 0)) for fields in statuses):
        return WhatFlew("a VTOL plane", "vehicle_status.is_vtol")
    claims = [("mav_type", kind, f"parameter MAV_TYPE = {kind}")]
    for kind in (int(x) for fields in statuses for x in fields.get("system_type", ())[-1:]):
        claims.append(("mav_type", kind, f"vehicle_status.system_type = {kind}"))
    claims.append(("px4_start", start // 1000, f"parameter SYS_AUTOSTART = {start}"))
    said = ((known[table][key], by) for table, key, by in claims if key in known[table])
    airframe, by = next(said, (QUADROTOR if count == 4 else "", ""))
    return WhatFlew(airframe, "parameter CA_ROTOR_COUNT" if count else by, count or None)


def motor_order(path: Path, parameters: Parameters, vehicle: Vehicle | None) -> tuple[Order, str]:
    """Return PX4's motor of each of the vehicle's rotors, and the note that says whence: by the
    positions CA_ROTORn_PX and PY or the airframe's, else as on PX4's quad x.

    Raises:
        InputError: the motors stand otherwise than the vehicle's rotors, by default one in each
            quadrant.
    """
    start = int(parameters.get("SYS_AUTOSTART", 0))
    # PX4's body y points right
    places = [
        (parameters.get(f"CA_ROTOR{i}_PX", 0.0), -parameters.get(f"CA_ROTOR{i}_PY", 0.0))
        for i in range(4)
    ]
    said, whence = "", "as on PX4's quad x, which the log does not state"
    if parameters.get("CA_ROTOR_COUNT") and any(x or y for x, y in places):
        whence, said = "by the positions in CA_ROTORn_PX and PY", "CA_ROTORn_PX and CA_ROTORn_PY"
    elif start // 1000 == 5:
        places, whence = list(PLUS), f"as on a quad plus (SYS_AUTOSTART = {start})"
        said = f"SYS_AUTOSTART = {start}, a quad plus,"
    order = order_by_places(places, vehicle) if said else ORDERS["px4-x"]
    if order is None:
        raise InputError(
            f"{path}: parameters {said} put the rotors at {places} (x forward, y left); expected "
            "one in each quadrant, as on a quad x, or a vehicle file with these rotor_positions"
        )
    motors = ", ".join(map(str, order))
    return order, f"motors renumbered {whence}: rotors 1, 2, 3, 4 are motors {motors}"


def with_motors(log_map: LogMap, order: Order, parameters: Parameters, outputs: Outputs) -> LogMap:
    """Return the map with the order of the motors, and with the thrust curve of their outputs."""
    factor = min(max(parameters.get("THR_MDL_FAC", 0.0), 0.0), 1.0)
    motors, sent = log_map.ways("commands")
    note = (
        f"commands: actuator_outputs, x = 0 to 1 ({outputs.words}), gives relative thrust "
        f"f x^2 + (1 - f) x with THR_MDL_FAC f = {factor:g}; motors 1 to 4 at outputs "
        f"{', '.join(str(slot + 1) for slot in outputs.slots)}"
    )
    columns = tuple(f"output[{slot}]" for slot in outputs.slots)
    sent = replace(sent, columns=columns, thrust_factor=factor, note=note)
    return log_map.with_ways({"commands": [motors, sent]}).with_order(order)


def without_ranges(parameters: Parameters) -> Parameters:
    """Return the parameters but for the ranges of pulses."""
    return {n: x for n, x in parameters.items() if not re.search(r"_(MIN|MAX)\d*$", n)}


def slots_of_escs(fields: Mapping[str, Array]) -> list[int]:
    """Return the ESCs, from 0, of motors 1 to 4: by the function that each states, if all do."""
    functions = [f"esc[{i}].actuator_function" for i in range(_ESCS)]
    named = [int(fields[name][-1]) if name in fields else -1 for name in functions]
    return slots_of_motors(named, MOTOR1) or list(range(4))


def outputs_of(path: Path, sent: Sequence[Mapping[str, Array]], parameters: Parameters) -> Outputs:
    """Return which outputs the motors are, and what of them is 0 and 1.

    Args:
        path: the file, for errors.
        sent: the instances of actuator_outputs.
        parameters: of the vehicle.

    Raises:
        InputError: a range of pulses is none, or the outputs fit no protocol.
    """
    bank, slots = "MAIN", [0, 1, 2, 3]
    for name, prefix in reversed(_BANKS.items()):  # of several the first
        functions = [int(parameters.get(f"{prefix}{i + 1}", 0.0)) for i in range(_OUTPUTS)]
        if found := slots_of_motors(functions, MOTOR1):
            bank, slots = name, found
    each = (_of_motors(fields, slots) for fields in sent)
    used = next((motors for motors in each if motors is not None), np.zeros((0, 4)))
    return _range(path, parameters, bank, slots, used)


def shares_of_outputs(columns: Mapping[str, Array], outputs: Outputs) -> dict[str, Array]:
    """Return what was sent to each output (N,) as 0 to 1, of those that are no motors' in the
    motors' range; nothing, where a motor's never changes.
    """
    if _of_motors(columns, outputs.slots) is None:
        return {}
    low, high = (np.full(_OUTPUTS, end) for end in (outputs.low.min(), outputs.high.max()))
    low[outputs.slots], high[outputs.slots] = outputs.low, outputs.high
    names = [f"output[{i}]" for i in range(_OUTPUTS)]
    return {
        name: np.clip((np.nan_to_num(columns[name]) - low[i]) / (high[i] - low[i]), 0.0, 1.0)
        for i, name in enumerate(names)
        if name in columns
    }


def _of_motors(columns: Mapping[str, Array], slots: Sequence[int]) -> Array | None:
    """Return what was sent to the outputs of the motors (N, 4); None where one of them is not there
    or never changes: that of a servo, or of a bank that is not in use.
    """
    names = [f"output[{slot}]" for slot in slots]
    if not set(names) <= set(columns):
        return None
    sent = np.nan_to_num(np.column_stack([columns[name] for name in names]))
    return sent if np.all(np.ptp(sent, axis=0) > 0.0) else None


def _range(
    path: Path, parameters: Parameters, bank: str, slots: list[int], motors: Array
) -> Outputs:
    """Return what of the outputs is 0 and 1: shares as they are; of DShot and UAVCAN, which the
    parameters state or no pulse can be, the protocol's range; of pulses each output's own
    parameter, the bank's, or PX4's default.

    Raises:
        InputError: a range of pulses is none, or the outputs fit no protocol.
    """
    most = float(np.nanmax(motors)) if np.isfinite(motors).any() else 0.0
    turning = motors[motors > 0.5 * most]  # not what stops them
    usual = float(np.median(turning)) if turning.size else _LEAST_PULSE

    def pulses(end: str, default: float) -> Array:
        """Return one end (4,) of the outputs' ranges of pulses, us."""
        names = [(f"PWM_{bank}_{end}{s + 1}", f"PWM_{bank}_{end}", f"PWM_{end}") for s in slots]
        given = ([parameters.get(name, 0.0) for name in one] for one in names)
        return np.array([next((x for x in one if x > 0.0), default) for one in given])

    lows, highs = pulses("MIN", 1000.0), pulses("MAX", 2000.0)
    # a bus for sensors alone leaves the motors to pulses, which stay long when they stand still
    has_bus = parameters.get("UAVCAN_ENABLE", 0.0) >= 3.0 and bool(np.any(motors < _LEAST_PULSE))
    timers = [parameters.get(f"PWM_{bank}_TIM{i}", 0.0) for i in range(_OUTPUTS)]
    is_dshot = parameters.get("DSHOT_CONFIG", 0.0) > 0.0 or any(x in _DSHOT_TIMERS for x in timers)
    if 0.0 < most <= _LARGEST_SHARE:
        return Outputs(slots, np.zeros(4), np.ones(4), "shares of 1")
    if bank == "UAVCAN" or has_bus or most > _ABOVE_PULSES * highs.max():
        protocol, (low, high), stated = "UAVCAN", _UAVCAN, bank == "UAVCAN" or has_bus
    elif is_dshot or usual < _LEAST_PULSE:
        protocol, (low, high), stated = "DShot", _DSHOT, is_dshot
    else:
        if not np.all(highs > lows):
            raise InputError(
                f"{path}: the PWM_{bank}_MIN and MAX parameters of the motors' outputs are "
                f"{lows.tolist()} and {highs.tolist()}; expected MIN below MAX"
            )
        words = f"pulses, of which one is above {_LARGEST_SHARE:g}: {lows.min():g} to "
        return Outputs(slots, lows, highs, f"{words}{highs.max():g} us")
    if most > high:
        raise InputError(
            f"{path}: actuator_outputs reaches {most:g}; expected shares up to 1, pulses in us, "
            f"or numbers of {protocol} up to {high:g}"
        )
    why = "as parameters state" if stated else "since no pulses are like that"
    words = f"{protocol}, {low:g} to {high:g}, {why}"
    return Outputs(slots, np.full(4, low), np.full(4, high), words)
