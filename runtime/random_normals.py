"""NumPy's unit normals as compiled code draws them: by the address of NumPy's function in C, or
through ``Generator.standard_normal``, which calls that function.
"""

from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .addresses import MissingFunctionError, as_c_function, library_function


class Normals(NamedTuple):
    """The unit normals of one generator: compiled code calls ``function(bits, count, out)``, where
    all but ``count`` are addresses.
    """

    function: int
    bits: int
    fixed: int  # address at which they are written whatever ``out`` says; 0: there is none
    kept: object  # must live as long as the addresses are used


@cache
def normals_address() -> int:
    """Return the address of ``void random_standard_normal_fill(bitgen_t *, npy_intp, double *)``.

    Its numbers are those of ``Generator.standard_normal``, which calls it, bit for bit.

    Raises:
        MissingFunctionError: this build of NumPy does not export it.
    """
    name = "random_standard_normal_fill"
    try:
        library = Path(str(import_module("numpy.random._generator").__file__))
    except ImportError:
        raise MissingFunctionError(f"{name} (no numpy.random._generator)") from None
    return library_function(library, name)


def bits_address(generator: np.random.Generator) -> int:
    """Return the address of a generator's ``bitgen_t``, good for as long as the generator lives."""
    return int(generator.bit_generator.ctypes.bit_generator.value)


def normals_in_c(generator: np.random.Generator) -> Normals:
    """Return a generator's normals, drawn by NumPy's function in C.

    Raises:
        MissingFunctionError: as ``normals_address``.
    """
    return Normals(normals_address(), bits_address(generator), 0, generator)


def normals_through_python(generator: np.random.Generator, count: int) -> Normals:
    """Return a generator's normals, ``count`` of them at a time, drawn by
    ``Generator.standard_normal``: slower, and bit for bit the same.
    """
    drawn = np.empty(count)
    function, kept = as_c_function(partial(generator.standard_normal, out=drawn))
    return Normals(function, 0, drawn.ctypes.data, kept)
