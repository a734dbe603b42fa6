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
    ROTORS_SIZE,
    SAMPLE_STEP,
    SPEED,
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
def add_wrenches(
    models: np.ndarray, coefficients: Array, vehicle: Array, state: Array, wrench: Array
) -> None:
    """Add what every wrench effect says at ``state`` to ``wrench`` (6,): force in the world, torque
    in the body frame.
    """
    for i in range(len(models)):
        _call(
            models[i],
            coefficients[i].ctypes.data,
            vehicle.ctypes.data,
            state.ctypes.data,
            wrench.ctypes.data,
        )


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
        _call(
            models[i],
            coefficients[i].ctypes.data,
            vehicle.ctypes.data,
            rotors.ctypes.data,
            memory[i].ctypes.data,
        )


@compiled
def advance(
    hooks: np.ndarray, coefficients: Array, vehicle: Array, state: Array, rotors: Array
) -> None:
    """Carry the own states of the wrench effects on by ``rotors[STEP]`` s in a ``state`` that is
    filled in.
    """
    for i in range(len(hooks)):
        if hooks[i] != 0:
            _call(
                hooks[i],
                coefficients[i].ctypes.data,
                vehicle.ctypes.data,
                state.ctypes.data,
                rotors.ctypes.data,
            )


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
        _call(
            models[i],
            coefficients[i].ctypes.data,
            vehicle.ctypes.data,
            sample.ctypes.data,
            memory[i].ctypes.data,
        )


__all__ = ["ROTORS_SIZE", "SPEED", "add_wrenches", "advance", "deliver", "report"]
