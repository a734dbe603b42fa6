"""A program that reads a MATLAB file from its input and writes the arrays of numbers in it as a
NumPy archive (.npz): a field of a struct is ``struct.field``. scipy's reader, and HDF5's, may end
the process at a spoiled file, so ``tables`` gives them one of their own.

    python matlab_arrays.py MOST_BYTES < flight.mat > flight.npz
"""

import io
import sys
import warnings
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np
from scipy.io import loadmat


def named(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of numbers within a value by their names."""
    if hasattr(value, "items"):
        for key, inner in value.items():
            if not key.startswith(("__", "#")):
                yield from named(f"{name}.{key}" if name else key, inner)
    elif getattr(value, "dtype", np.dtype(object)).kind in "biuf":
        yield name, value[()]


def main() -> None:
    """Read and write."""
    warnings.simplefilter("ignore")
    try:
        import resource
    except ImportError:  # Windows
        pass
    else:
        most = int(sys.argv[1])
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    data = sys.stdin.buffer.read()
    if data.startswith(b"MATLAB 7.3"):  # HDF5, with its axes turned
        with import_module("h5py").File(io.BytesIO(data), "r") as file:
            found = {name: value.T for name, value in named("", file)}
    else:
        found = dict(named("", loadmat(io.BytesIO(data), simplify_cells=True)))
    np.savez(sys.stdout.buffer, **{f"_{name}": value for name, value in found.items()})


if __name__ == "__main__":
    main()
