"""Whether a law does nothing while all its coefficients but one are zero.

A diagnosis adds an effect by what each of its coefficients changes beside a model that lacks it. A
wind and its drag, or a load's mass and its cable, do nothing alone: no such column leads to them,
and they would never be proposed. Such a law must say where a fit starts (``starting_points``).
"""

import ctypes
from functools import cache

import numpy as np

from ..rotation import matrix_of
from .base import (
    CEILING,
    DIRECTION,
    FLOOR,
    GRAVITY,
    HAS_POSITION,
    HAS_QUATERNION,
    HAS_SPEED,
    HOVER_RATE,
    MASS,
    POSITION,
    RATE,
    REACTION,
    ROTATION,
    ROTOR_ACCELERATION,
    ROTOR_POSITION,
    ROTOR_RADIUS,
    ROTOR_SPEED,
    ROTOR_THRUST,
    ROTOR_TIME,
    ROTOR_VOLTAGE,
    ROTORS_SIZE,
    ROW_SIZE,
    SAMPLE_POSITION,
    SAMPLE_QUATERNION,
    SAMPLE_SIZE,
    SAMPLE_SPEED,
    SAMPLE_STEP,
    SPIN,
    STATE_SIZE,
    STEP,
    TIME,
    VEHICLE_SIZE,
    VELOCITY,
    VOLTAGE,
    VOLTAGE_REF,
    Array,
    Effect,
)

_SAMPLES = 60  # of a made-up flight: at every height, speed and attitude that may matter
_PERIOD = 0.005  # s between them
_SHARE = 0.5  # of a typical size: the change by which a diagnosis asks what a coefficient does
_ARM, _HOVER = 0.13, 400.0  # m, rad/s: of the made-up vehicle
_SPIN = (-1.0, 1.0, -1.0, 1.0)


def does_nothing_alone(effect: Effect) -> bool:
    """Return whether none of an effect's coefficients does anything on a flight while the others
    are zero, though together they do.

    Where it acts nowhere on the made-up flight nothing is known, and so it is for a body effect,
    which has no model of a flight.
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
    """Return what a law makes of each sample (samples, ...) of the made-up flight."""
    states, rotors, samples = _flight()
    c = np.zeros(ROW_SIZE)
    c[: len(coefficients)] = coefficients
    memory = np.zeros(max(effect.memory, 1))
    state, rotor, wrench = np.zeros(STATE_SIZE), np.zeros(ROTORS_SIZE), np.zeros(6)
    sample = np.zeros(SAMPLE_SIZE)
    read, written, other = {
        "wrench": (state, wrench, wrench),
        "rotor input": (rotor, rotor, memory),
        "sensing": (sample, sample, memory),
    }[effect.kind]
    vehicle = _vehicle()
    model = effect.model.ctypes
    given = [_pointer(x) for x in (c, vehicle, read, other)]
    carry_on = effect.advance.ctypes if effect.advance is not None else None
    carried = [_pointer(x) for x in (c, vehicle, state, rotor)]
    out = np.empty((_SAMPLES, len(written)))
    for k in range(_SAMPLES):
        state[:], rotor[:], sample[:], wrench[:] = states[k], rotors[k], samples[k], 0.0
        if carry_on is not None:
            carry_on(*carried)
        model(*given)
        out[k] = written
    return out


def _pointer(x: Array) -> "ctypes._Pointer[ctypes.c_double]":
    return x.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


@cache
def _flight() -> tuple[Array, Array, Array]:
    """Return states, rotors and samples (samples, ...) of the made-up flight, as laws get them."""
    rng = np.random.default_rng(1)
    states = np.zeros((_SAMPLES, STATE_SIZE))
    rotors = np.zeros((_SAMPLES, ROTORS_SIZE))
    samples = np.zeros((_SAMPLES, SAMPLE_SIZE))
    q = np.array([1.0, 0.0, 0.0, 0.0]) + 0.3 * rng.standard_normal((_SAMPLES, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    speeds = rng.uniform(0.5, 1.5, (_SAMPLES, 4)) * _HOVER
    volts, t = rng.uniform(9.0, 12.0, _SAMPLES), 0.3 * np.arange(_SAMPLES)
    at = rng.uniform([-3.0, -3.0, 0.05], [3.0, 3.0, 2.9], (_SAMPLES, 3))
    states[:, POSITION : POSITION + 3] = samples[:, SAMPLE_POSITION : SAMPLE_POSITION + 3] = at
    states[:, ROTATION : ROTATION + 9] = [matrix_of(x).ravel() for x in q]
    states[:, VELOCITY : VELOCITY + 3] = rng.normal(0.0, 3.0, (_SAMPLES, 3))
    states[:, RATE : RATE + 3] = rng.standard_normal((_SAMPLES, 3))
    states[:, ROTOR_SPEED : ROTOR_SPEED + 4] = speeds
    states[:, ROTOR_THRUST : ROTOR_THRUST + 4] = 1.1 * (speeds / _HOVER) ** 2
    states[:, VOLTAGE], states[:, TIME] = volts, t
    states[:, ROTOR_ACCELERATION : ROTOR_ACCELERATION + 4] = rng.normal(0.0, 500.0, (_SAMPLES, 4))
    rotors[:, :4] = samples[:, SAMPLE_SPEED : SAMPLE_SPEED + 4] = speeds
    rotors[:, ROTOR_VOLTAGE], rotors[:, ROTOR_TIME], rotors[:, STEP] = volts, t, _PERIOD
    samples[:, SAMPLE_QUATERNION : SAMPLE_QUATERNION + 4] = q
    samples[:, SAMPLE_STEP], samples[:, DIRECTION] = _PERIOD, 1.0
    samples[:, [HAS_SPEED, HAS_POSITION, HAS_QUATERNION]] = 1.0
    return states, rotors, samples


def _vehicle() -> Array:
    vehicle = np.zeros(VEHICLE_SIZE)
    vehicle[MASS], vehicle[GRAVITY], vehicle[ROTOR_RADIUS] = 0.45, 9.81, 0.1
    vehicle[FLOOR], vehicle[CEILING] = 0.0, 3.0
    vehicle[VOLTAGE_REF], vehicle[HOVER_RATE] = 11.1, _HOVER
    x, y = _ARM * np.array([1, -1, -1, 1]), _ARM * np.array([1, 1, -1, -1])
    vehicle[ROTOR_POSITION : ROTOR_POSITION + 12] = np.column_stack([x, y, np.zeros(4)]).ravel()
    vehicle[SPIN : SPIN + 4] = _SPIN
    vehicle[REACTION : REACTION + 4] = 2e-7
    return vehicle
