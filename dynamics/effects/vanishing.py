"""Whether an effect does nothing while all its coefficients but one are zero.

A diagnosis proposes an effect by the change due to each coefficient, in a model without the effect.
A wind without its drag, or a load without its cable, changes nothing, so the diagnosis would never
propose these effects. Such an effect states starting points of a fit (``starting_points``).
"""

import numpy as np

from ... import _core
from .base import MEMORY, ROTORS, ROW_SIZE, SAMPLE, STATE, VEHICLE, Array, Effect
from .own import addresses, raise_errors

_SAMPLES = 60
_SIZES = (0.5, 1.5)  # between which every number of vehicle and flight is drawn
_SHARE = 0.5  # a diagnosis tries coefficients changed by this share of a typical size


def does_nothing_alone(effect: Effect) -> bool:
    """Return whether none of an effect's coefficients does anything to random states of a random
    vehicle while the others are zero, though together they do.

    Without an action at any state nothing is known; nor for a body effect, without a model of a
    flight.

    Raises:
        InputError: an error in a user's function.
    """
    if effect.model is None:
        return False
    typical = np.array([c.typical[0] for c in effect.coefficients])
    nothing = _flown(effect, np.zeros(len(typical)))
    if np.array_equal(_flown(effect, typical), nothing):
        return False
    for i, c in enumerate(effect.coefficients):
        size = _SHARE * (abs(c.typical[0]) or float(np.abs(typical).max()))
        for value in (size, -size):
            alone = np.zeros(len(typical))
            alone[i] = np.clip(value, c.minimum, c.maximum)
            if not np.array_equal(_flown(effect, alone), nothing):
                return False
    return True


def _flown(effect: Effect, coefficients: Array) -> Array:
    """Return a law's result at each random state (samples, ...)."""
    rng = np.random.default_rng(1)
    model, advance = addresses(effect)
    c, wrench = np.zeros(ROW_SIZE), np.zeros(6)
    c[: len(coefficients)] = coefficients
    memory = np.zeros(MEMORY)
    vehicle, state, rotor, sample = (
        rng.uniform(*_SIZES, layout.itemsize // 8) for layout in (VEHICLE, STATE, ROTORS, SAMPLE)
    )
    read, written, other = {
        "wrench": (state, wrench, wrench),
        "rotor input": (rotor, rotor, memory),
        "sensing": (sample, sample, memory),
    }[effect.kind]
    out = np.empty((_SAMPLES, len(written)))
    for k in range(_SAMPLES):
        for numbers in (vehicle, state, rotor, sample):
            numbers[:] = rng.uniform(*_SIZES, len(numbers))
        sample.view(SAMPLE)[["has_speed", "has_position", "has_quaternion", "direction"]] = 1.0
        wrench[:] = 0.0
        if advance:
            _core.call_effect(advance, c, vehicle, state, rotor)
        _core.call_effect(model, c, vehicle, read, other)
        raise_errors()
        out[k] = written
    return out
