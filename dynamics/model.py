"""A vehicle with its effects, as fields of a record that compiled code works on.

Filter and plant each hold one: the filter's has the declared effects, the plant's also those that nobody declared.
"""

import numpy as np

from .compiled import Record, compiled
from .effects import compile_effects
from .effects.base import ROTORS_SIZE, STATE_SIZE, VEHICLE_SIZE, Array
from .effects.call import deliver
from .errors import InputError
from .motion import BODY, body_record, effect_wrench, rotor_wrench
from .vehicle import Vehicle

MAX_EFFECTS = 16  # of a kind
MEMORY = 96  # numbers that a rotor-input effect may keep

MODEL_FIELDS: list[tuple[object, ...]] = [
    ("body", BODY),
    ("constants", "f8", (VEHICLE_SIZE,)),
    ("wrench_laws", "i8", (MAX_EFFECTS,)),
    ("wrench_coefficients", "f8", (MAX_EFFECTS, 8)),
    ("wrench_count", "i8"),
    ("rotor_laws", "i8", (MAX_EFFECTS,)),
    ("rotor_coefficients", "f8", (MAX_EFFECTS, 8)),
    ("rotor_count", "i8"),
    ("memory", "f8", (MAX_EFFECTS, MEMORY)),
    ("time", "f8"),
    ("voltage", "f8"),
    ("wind", "f8", (3,)),
    ("rotors", "f8", (ROTORS_SIZE,)),  # delivered turn rates
    ("rotor_wrench", "f8", (4,)),  # their thrust and torques about the centre of mass
    ("effect_state", "f8", (STATE_SIZE,)),
    ("effect_wrench", "f8", (6,)),  # force in the world, torque in the body frame
]


def load_model(record: np.void, vehicle: Vehicle) -> Vehicle:
    """Fill the model's fields of a record; return the vehicle with its body effects applied.

    Raises:
        InputError: more effects than a model holds.
    """
    bundle = compile_effects(vehicle)
    if max(len(bundle.wrench_laws), len(bundle.rotor_laws)) > MAX_EFFECTS or bundle.rotor_memory > MEMORY:
        raise InputError(f"{vehicle.name}: effects: a model holds at most {MAX_EFFECTS} of a kind")
    record["body"] = body_record(bundle.vehicle)[0]
    record["constants"] = bundle.constants
    for kind, laws, coefficients in (("wrench", bundle.wrench_laws, bundle.wrench_coefficients),
                                     ("rotor", bundle.rotor_laws, bundle.rotor_coefficients)):
        record[f"{kind}_count"] = len(laws)
        record[f"{kind}_laws"][: len(laws)] = laws
        record[f"{kind}_coefficients"][: len(laws)] = coefficients
    return bundle.vehicle


@compiled
def drive(f: Record, rotor_speeds: Array, dt: float, voltage: float) -> None:
    """Work out what the rotors deliver over a step of ``dt`` s at the logged turn rates (4,) rad/s."""
    f.voltage = voltage
    for i in range(4):
        f.rotors[i] = rotor_speeds[i]
    if f.rotor_count > 0:
        deliver(f.rotor_laws[: f.rotor_count], f.rotor_coefficients, f.constants, f.memory, dt, voltage, f.rotors)
    rotor_wrench(f.body, f.rotors, f.rotor_wrench)


@compiled
def apply_effects(f: Record, position: Array, rotation: Array, velocity: Array, omega: Array) -> None:
    """Write what the wrench effects say at a state into ``f.effect_wrench``."""
    if f.wrench_count > 0:
        effect_wrench(f.wrench_laws[: f.wrench_count], f.wrench_coefficients, f.constants, f.body, position, rotation,
                      velocity, omega, f.rotors, f.wind, f.voltage, f.time, f.effect_state, f.effect_wrench)
