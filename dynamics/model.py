"""A vehicle with its effects, as fields of a record for the core.

Filter and plant each hold one: the filter's with the declared effects, the plant's also with
undeclared ones.
"""

import numpy as np

from .. import _core
from ..runtime.errors import InputError
from .effects import Bundle, compile_effects
from .effects.base import (
    HIDDEN,
    MEMORY,
    PARAMETERS,
    ROTORS_SIZE,
    ROW_SIZE,
    SAMPLE_SIZE,
    STATE_SIZE,
    VEHICLE_SIZE,
)
from .motion import BODY, body_record
from .vehicle import Vehicle

MAX_EFFECTS = 16  # a kind
MAX_SENSING = 4

# fields with addresses of compiled effects
_ADDRESSES = ("wrench_models", "wrench_hooks", "rotor_models", "sensing_models")

MODEL_FIELDS: list[tuple[object, ...]] = [
    ("body", BODY),
    ("constants", "f8", (VEHICLE_SIZE,)),
    ("wrench_models", "i8", (MAX_EFFECTS,)),
    ("wrench_coefficients", "f8", (MAX_EFFECTS, ROW_SIZE)),
    ("wrench_hooks", "i8", (MAX_EFFECTS,)),
    ("wrench_count", "i8"),
    ("hooked", "i8"),  # whether any effect has a state of its own
    ("waiting", "i8"),  # whether the states have still to be carried over this step
    ("rotor_models", "i8", (MAX_EFFECTS,)),
    ("rotor_coefficients", "f8", (MAX_EFFECTS, PARAMETERS)),
    ("rotor_count", "i8"),
    ("sensing_models", "i8", (MAX_SENSING,)),
    ("sensing_coefficients", "f8", (MAX_SENSING, PARAMETERS)),
    ("sensing_count", "i8"),
    ("sample", "f8", (SAMPLE_SIZE,)),  # on its way through the sensing effects
    # memories of rotor-input and sensing effects; last: whether rotor speeds were delivered, and
    # which
    ("memory", "f8", (MAX_EFFECTS + MAX_SENSING + 1, MEMORY)),
    ("time", "f8"),
    ("voltage", "f8"),
    ("wind", "f8", (3,)),
    ("rotors", "f8", (ROTORS_SIZE,)),  # delivered rotor speeds
    ("rotor_wrench", "f8", (4,)),  # their thrust and torques about the centre of mass
    ("effect_state", "f8", (STATE_SIZE,)),
    ("effect_wrench", "f8", (6,)),  # force in the world, torque in the body frame
]

assert np.dtype(MODEL_FIELDS).itemsize == _core.MODEL_SIZE, "the core was built for another layout"


def load_model(record: np.void, vehicle: Vehicle) -> Vehicle:
    """Fill the model's fields of a record; return the vehicle with its body effects applied.

    Raises:
        InputError: more effects than a model holds.
    """
    bundle = compile_effects(vehicle)
    if (
        max(len(bundle.wrench_models), len(bundle.rotor_models)) > MAX_EFFECTS
        or len(bundle.sensing_models) > MAX_SENSING
    ):
        raise InputError(
            f"{vehicle.name}: effects: a model holds at most {MAX_EFFECTS} of a kind, and "
            f"{MAX_SENSING} of sensing"
        )
    record["body"] = body_record(bundle.vehicle)[0]
    record["constants"] = bundle.constants
    for kind, coefficients in (
        ("wrench", bundle.wrench_coefficients),
        ("rotor", bundle.rotor_coefficients),
        ("sensing", bundle.sensing_coefficients),
    ):
        record[f"{kind}_count"] = len(coefficients)
        record[f"{kind}_coefficients"][: len(coefficients)] = coefficients
    lay_addresses(record, bundle)
    record["hooked"] = int(np.any(bundle.wrench_hooks != 0))
    return bundle.vehicle


def lay_addresses(record: np.void, bundle: Bundle) -> None:
    """Write where this process has the compiled effects of a vehicle into the model's fields."""
    for name in _ADDRESSES:
        addresses = getattr(bundle, name)
        record[name][: len(addresses)] = addresses


def without_addresses(record: np.ndarray) -> np.ndarray:
    """Return a copy of a record (1,) with a model's fields, readable in another process."""
    copy = record.copy()
    for name in _ADDRESSES:
        copy[name] = 0
    return copy


def reset_model(record: np.void) -> None:
    """Clear the effects' memory, and set the time to zero."""
    record["memory"], record["time"], record["waiting"] = 0.0, 0.0, 0
    record["wrench_coefficients"][:, HIDDEN:] = 0.0
