"""Effects in Python: a user's functions of arrays, as C functions for the core.

A process wraps a function once. The core calls the function by its address, with views of the
core's memory; nothing is copied. An error cannot leave the core's step. So the first error is kept,
no further function runs, and ``raise_errors`` raises the error after the step.
"""

import ctypes
import traceback
from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any

import numpy as np

from ... import _core
from ...runtime.errors import InputError
from .base import MEMORY, PARAMETERS, ROTORS, ROW_SIZE, SAMPLE, STATE, VEHICLE, WRENCH, Effect

Function = Callable[..., None]
Layout = np.dtype[Any] | int  # a record, or so many numbers

ERRORS: list[BaseException] = []  # raised in functions of a step, until reported
_C_FUNCTION = ctypes.CFUNCTYPE(None, *(ctypes.c_void_p,) * 4)
_KEPT_VIEWS = 4096


class Fields:
    """The fields of a record as attributes: views (n,), and views () of single numbers."""

    def __init__(self, record: np.ndarray) -> None:
        self.__dict__.update({name: record[name] for name in record.dtype.fields or ()})

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"no field {name}; expected one of {', '.join(self.__dict__)}")

    def __setattr__(self, name: str, value: object) -> None:
        getattr(self, name)[...] = value


@lru_cache(_KEPT_VIEWS)
def _view(address: int, layout: Layout) -> Any:
    """Return a view of the memory at an address: numbers (n,), or the fields of a record."""
    numbers = isinstance(layout, int)
    dtype = np.dtype(("f8", (layout,))) if isinstance(layout, int) else layout
    memory: Any = (ctypes.c_char * dtype.itemsize).from_address(address)
    return np.frombuffer(memory) if numbers else Fields(np.ndarray((), dtype, memory))


def addresses(effect: Effect) -> tuple[int, int]:
    """Return the addresses of an effect's model and ``advance``, C functions of four arrays; 0
    where there is none.

    Raises:
        InputError: the core has no equation of the model's name and the effect's kind.
    """
    if isinstance(effect.model, str):
        in_core = _core.effect_addresses(effect.model, effect.kind)
        if not in_core[0]:
            raise InputError(
                f"effect {effect.name}: model {effect.model!r} is no {effect.kind} of the core"
            )
        return in_core
    third, fourth, size = {
        "wrench": (STATE, WRENCH, ROW_SIZE),
        "rotor input": (ROTORS, MEMORY, PARAMETERS),
        "sensing": (SAMPLE, MEMORY, PARAMETERS),
    }[effect.kind]
    model, advance = (
        ctypes.cast(_wrapped(function, effect.name, layouts), ctypes.c_void_p).value or 0
        if function
        else 0
        for function, layouts in (
            (effect.model, (size, VEHICLE, third, fourth)),
            (effect.advance, (size, VEHICLE, third, ROTORS)),
        )
    )
    return model, advance


@cache
def _wrapped(function: Function, name: str, layouts: tuple[Layout, ...]) -> Any:
    """Return a C function that calls a user's function with views, kept as long as the process."""

    def call(*pointers: int) -> None:
        if not ERRORS:
            try:
                function(*map(_view, pointers, layouts))
            except BaseException as error:  # none can leave a step of the core
                ERRORS.append(_explained(error, function, name))

    return _C_FUNCTION(call)


def _explained(error: BaseException, function: Function, name: str) -> BaseException:
    """Return an error as one line with its place in the user's file."""
    if not isinstance(error, Exception):
        return error  # Ctrl-C
    file = function.__code__.co_filename
    frames = traceback.extract_tb(error.__traceback__)
    line = max((i for i, frame in enumerate(frames) if frame.filename == file), default=-1)
    explained = InputError(
        f"{file}, line {frames[line].lineno}: effect {name}: {type(error).__name__}: {error}"
    )
    explained.__cause__ = error
    return explained


def raise_errors() -> None:
    """Raise the first error of a user's function since the last call, if there was one.

    Raises:
        InputError: naming the file, the line and the effect.
    """
    if ERRORS:
        error = ERRORS[0]
        ERRORS.clear()
        raise error
