"""PX4's motors: which is which rotor, which output drives it, and in what range, by parameters."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....runtime.errors import InputError
from ..log_map import LogMap
from ..map_fit import ways
from ..rotor_orders import ORDERS, Order
from ..table import Array

Parameters = Mapping[str, float]

_QUADRANTS = ((1, 1), (-1, 1), (-1, -1), (1, -1))  # signs of x forward and y left of rotors 1 to 4
_MOTOR1 = 101  # PX4's number of the output function "motor 1"
_BANKS = ("MAIN", "AUX")
_OUTPUTS = 16  # of a bank
_ESCS = 8
_LARGEST_SHARE = 1.5  # an output beyond is a pulse, in us


def motor_order(path: Path, parameters: Parameters) -> tuple[Order, str]:
    """Return PX4's motor of each of the kit's rotors, and the note that says whence: by the
    positions CA_ROTORn_PX and PY, else as on PX4's quad x.

    Raises:
        InputError: the vehicle is no quadrotor, or no rotor is in one of the quadrants.
    """
    count = int(parameters.get("CA_ROTOR_COUNT", 0))
    if count not in (0, 4):
        raise InputError(f"{path}: parameter CA_ROTOR_COUNT is {count}; expected a quadrotor's 4")
    # PX4's body y points right
    places = [
        (parameters.get(f"CA_ROTOR{i}_PX", 0.0), -parameters.get(f"CA_ROTOR{i}_PY", 0.0))
        for i in range(4)
    ]
    order, whence = ORDERS["px4-x"], "as on PX4's quad x, which the log does not state"
    if count and any(x or y for x, y in places):
        signs = [(int(np.sign(x)), int(np.sign(y))) for x, y in places]
        if sorted(signs) != sorted(_QUADRANTS):
            raise InputError(
                f"{path}: parameters CA_ROTORn_PX and CA_ROTORn_PY put the rotors at {places} "
                f"(x forward, y left); expected one in each quadrant, as on a quad x"
            )
        first, second, third, fourth = (signs.index(quadrant) + 1 for quadrant in _QUADRANTS)
        order, whence = (first, second, third, fourth), "by the positions in CA_ROTORn_PX and PY"
    motors = ", ".join(map(str, order))
    return order, f"motors renumbered {whence}: rotors 1, 2, 3, 4 are motors {motors}"


def with_motors(log_map: LogMap, order: Order, parameters: Parameters) -> LogMap:
    """Return the map with the order of the motors, and with the thrust curve of their outputs."""
    factor = min(max(parameters.get("THR_MDL_FAC", 0.0), 0.0), 1.0)
    bank, slots = _output_slots(parameters)
    low, high = _range(parameters, bank, slots)
    rotors, (motors, sent) = log_map.rotors, ways(log_map, "commands")
    assert rotors is not None
    note = (
        f"commands: actuator_outputs, x = 0 to 1 (pulses, of which one is above 1.5: "
        f"{low.min():g} to {high.max():g} us), gives relative thrust f x^2 + (1 - f) x with "
        f"THR_MDL_FAC f = {factor:g}; motors 1 to 4 at outputs "
        f"{', '.join(str(slot + 1) for slot in slots)}"
    )
    sent = replace(sent, order=order, thrust_factor=factor, note=note)
    return replace(
        log_map,
        rotors=replace(rotors, order=order),
        commands=replace(motors, order=order),
        alternatives={**log_map.alternatives, "commands": (sent,)},
    )


def without_ranges(parameters: Parameters) -> Parameters:
    """Return the parameters but for the ranges of pulses."""
    return {n: x for n, x in parameters.items() if not re.search(r"_(MIN|MAX)\d*$", n)}


def slots_of_escs(fields: Mapping[str, Any]) -> list[int]:
    """Return the ESCs, from 0, of motors 1 to 4: by the function that each states, if all do."""
    functions = [f"esc[{i}].actuator_function" for i in range(_ESCS)]
    named = [int(fields[name][-1]) if name in fields else -1 for name in functions]
    return slots_of_motors(named) or list(range(4))


def outputs_of_motors(
    path: Path, columns: Mapping[str, Array], parameters: Parameters
) -> dict[str, Array]:
    """Return what was sent to motors 1 to 4 (N,) as 0 to 1, in their order; nothing, where one of
    the outputs never changes: servos, or a bank that is not in use.

    Raises:
        InputError: a range of pulses is none.
    """
    bank, slots = _output_slots(parameters)
    names = [f"output[{slot}]" for slot in slots]
    if not set(names) <= set(columns):
        return {}
    outputs = np.nan_to_num(np.column_stack([columns[name] for name in names]), nan=0.0)
    if not np.all(np.ptp(outputs, axis=0) > 0.0):
        return {}
    low, high = np.zeros(4), np.ones(4)
    if outputs.max() > _LARGEST_SHARE:
        low, high = _range(parameters, bank, slots)
    if not np.all(high > low):
        raise InputError(
            f"{path}: the PWM_{bank}_MIN and MAX parameters of the motors' outputs are "
            f"{low.tolist()} and {high.tolist()}; expected MIN below MAX"
        )
    shares = np.clip((outputs - low) / (high - low), 0.0, 1.0)
    return {f"output[{motor}]": share for motor, share in enumerate(shares.T)}


def _output_slots(parameters: Parameters) -> tuple[str, list[int]]:
    """Return the bank and the outputs, from 0, of motors 1 to 4."""
    for bank in _BANKS:
        functions = (parameters.get(f"PWM_{bank}_FUNC{i + 1}", 0.0) for i in range(_OUTPUTS))
        if slots := slots_of_motors([int(function) for function in functions]):
            return bank, slots
    return "MAIN", list(range(4))


def slots_of_motors(functions: Sequence[int]) -> list[int]:
    """Return the slots of motors 1 to 4, by PX4's numbers of what each slot does; none: not all
    are there.
    """
    motors = [_MOTOR1 + i for i in range(4)]
    return [functions.index(motor) for motor in motors] if {*motors} <= {*functions} else []


def _range(parameters: Parameters, bank: str, slots: list[int]) -> tuple[Array, Array]:
    """Return the pulses (4,) in us at the ends of outputs' ranges: of each its own parameter, the
    bank's, or PX4's default.
    """

    def ends(end: str, default: float) -> Array:
        names = [(f"PWM_{bank}_{end}{s + 1}", f"PWM_{bank}_{end}", f"PWM_{end}") for s in slots]
        given = [[parameters.get(name, 0.0) for name in one] for one in names]
        return np.array([next((x for x in one if x > 0.0), default) for one in given])

    return ends("MIN", 1000.0), ends("MAX", 2000.0)
