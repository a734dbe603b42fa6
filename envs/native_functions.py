"""C functions of MuJoCo and NumPy by their addresses: through its Python binding each call would
end the compiled loop.
"""

import ctypes
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from ..runtime.errors import InputError


@cache
def mj_step_address() -> int:
    """Return the address of ``void mj_step(const mjModel *, mjData *)`` in the library that the
    Python package has loaded.

    Raises:
        InputError: the package does not hold its library where it always did.
    """
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            return _address(path, "mj_step")
    raise InputError(
        f"mujoco {mujoco.__version__}: expected its library (libmujoco) in {folder}; install "
        f"mujoco's own wheel"
    )


def clock_address(data: "mujoco.MjData") -> int:
    """Return the address of MuJoCo's time in s, a float of 64 bits; it follows a state that MuJoCo
    reset on its own.

    Raises:
        InputError: it is not where MuJoCo's header has it, before the energies.
    """
    address = int(data.energy.ctypes.data) - ctypes.sizeof(ctypes.c_double)
    time, data.time = data.time, -1.25
    found = ctypes.c_double.from_address(address).value == -1.25
    data.time = time
    if not found:
        raise InputError(
            f"mujoco {mujoco.__version__}: expected the time before the energies in mjData, as in "
            f"3.3 and 4.0"
        )
    return address


@cache
def normals_address() -> int:
    """Return the address of ``void random_standard_normal_fill(bitgen_t *, npy_intp, double *)``,
    NumPy's unit normals.

    They are those of ``Generator.standard_normal``, which calls it, bit for bit.

    Raises:
        InputError: this build of NumPy does not export it.
    """
    import numpy.random._generator as library

    try:
        return _address(Path(library.__file__), "random_standard_normal_fill")
    except AttributeError:
        raise InputError(
            f"numpy {np.__version__}: expected random_standard_normal_fill in {library.__file__}; "
            f"install "
            "numpy's own wheel"
        ) from None


def bits_address(generator: np.random.Generator) -> int:
    """Return the address of a generator's ``bitgen_t``, good for as long as the generator lives."""
    return int(generator.bit_generator.ctypes.bit_generator.value)


def _address(library: Path, name: str) -> int:
    address = ctypes.cast(getattr(ctypes.CDLL(str(library)), name), ctypes.c_void_p).value
    assert address is not None
    return address
