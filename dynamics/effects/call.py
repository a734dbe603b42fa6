"""Calling compiled effect models by address, from compiled code."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ...runtime.compiled import Record, compiled
from .base import (
    DIRECTION,
    HAS_POSITION,
    HAS_QUATERNION,
    HAS_SPEED,
    ROTOR_VOLTAGE,
    SAMPLE_STEP,
    STEP,
    Array,
)


@intrinsic  # type: ignore[untyped-decorator]
def _call(typing_context: Any, address: Any, a: Any, b: Any, c: Record, d: Any) -> Any:
    """Call the C function ``void f(double *, double *, double *, double *)`` at an address."""
    signature = types.void(types.int64, types.intp, types.intp, types.intp, types.intp)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer = ir.DoubleType().as_pointer()
        function = ir.FunctionType(ir.VoidType(), [pointer] * 4)
        target = builder.inttoptr(arguments[0], function.as_pointer())
        builder.call(target, [builder.inttoptr(argument, pointer) for argument in arguments[1:]])
        return context.get_dummy_value()

    return signature, generate


@compiled
def _ask(address: int, c: Array, vehicle: Array, third: Array, fourth: Array) -> None:
    """Call the effect model at an address with its four arrays."""
    _call(address, c.ctypes.data, vehicle.ctypes.data, third.ctypes.data, fourth.ctypes.data)


@compiled
def add_wrenches(
    models: np.ndarray, coefficients: Array, vehicle: Array, state: Array, wrench: Array
) -> None:
    """Add what every wrench effect says at ``state`` to ``wrench`` (6,): force in the world, torque
    in the body frame.
    """
    for i in range(len(models)):
        _ask(models[i], coefficients[i], vehicle, state, wrench)


@compiled
def deliver(
    models: np.ndarray,
    coefficients: Array,
    vehicle: Array,
    memory: Array,
    dt: float,
    voltage: float,
    rotors: Array,
) -> None:
    """Rewrite the rotor speeds ``rotors[:4]`` (rad/s) to those that the rotors really deliver.

    ``rotors`` is (ROTORS_SIZE,) with its time filled in.
    """
    rotors[STEP] = dt
    rotors[ROTOR_VOLTAGE] = voltage
    for i in range(len(models)):
        _ask(models[i], coefficients[i], vehicle, rotors, memory[i])


@compiled
def advance(
    hooks: np.ndarray, coefficients: Array, vehicle: Array, state: Array, rotors: Array
) -> None:
    """Carry the own states of the wrench effects on by ``rotors[STEP]`` s in a ``state`` that is
    filled in.
    """
    for i in range(len(hooks)):
        if hooks[i] != 0:
            _ask(hooks[i], coefficients[i], vehicle, state, rotors)


@compiled
def report(
    models: np.ndarray,
    coefficients: Array,
    vehicle: Array,
    memory: Array,
    dt: float,
    parts: int,
    direction: float,
    sample: Array,
) -> None:
    """Rewrite ``sample`` (SAMPLE_SIZE,) from truth to report (``direction`` +1), or back (-1), in
    the reverse order.

    ``parts``: 1 position, 2 attitude, 4 rotor speeds.
    """
    sample[SAMPLE_STEP], sample[DIRECTION] = dt, direction
    sample[HAS_POSITION] = 1.0 if parts & 1 != 0 else 0.0
    sample[HAS_QUATERNION] = 1.0 if parts & 2 != 0 else 0.0
    sample[HAS_SPEED] = 1.0 if parts & 4 != 0 else 0.0
    for n in range(len(models)):
        i = n if direction > 0.0 else len(models) - 1 - n
        _ask(models[i], coefficients[i], vehicle, sample, memory[i])
