"""Calling compiled effect laws by address, from compiled code."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..compiled import Record, compiled
from .base import ROTOR_VOLTAGE, ROTORS_SIZE, SPEED, STEP, Array


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
def add_wrenches(laws: np.ndarray, coefficients: Array, vehicle: Array, state: Array, wrench: Array) -> None:
    """Add what every wrench law says at ``state`` to ``wrench`` (6,): force in the world, torque in the body frame."""
    for i in range(len(laws)):
        _call(laws[i], coefficients[i].ctypes.data, vehicle.ctypes.data, state.ctypes.data, wrench.ctypes.data)


@compiled
def deliver(laws: np.ndarray, coefficients: Array, vehicle: Array, memory: Array, dt: float, voltage: float,
            rotors: Array) -> None:
    """Rewrite the turn rates ``rotors[:4]`` (rad/s) to those that the rotors really deliver; ``rotors`` is (6,)."""
    rotors[STEP] = dt
    rotors[ROTOR_VOLTAGE] = voltage
    for i in range(len(laws)):
        _call(laws[i], coefficients[i].ctypes.data, vehicle.ctypes.data, rotors.ctypes.data, memory[i].ctypes.data)


__all__ = ["ROTORS_SIZE", "SPEED", "add_wrenches", "deliver"]
