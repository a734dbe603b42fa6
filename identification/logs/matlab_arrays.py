"""A program to turn a MATLAB file on its input into a NumPy archive (.npz) of the numeric arrays: a
field of a struct is ``struct.field``. scipy's reader, and HDF5's, may end the process at a spoiled
file, so ``tables`` gives them one of their own.

    python matlab_arrays.py MOST_BYTES MEMORY < flight.mat > flight.npz

Files of more than ``MOST_BYTES`` unpacked are refused before an array is made. The limit on the
process's memory refuses other demands of a spoiled file.
"""

import struct
import sys
import warnings
import zlib
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from typing import Any, BinaryIO

import numpy as np
from scipy.io import loadmat

_HEADER = 128  # bytes of a file of version 5 to 7; the last two state the order of bytes
_PACKED = 15  # type of a packed element
_PIECE = 2**16  # bytes packed or unpacked at a time


def _check_unpacked(data: BinaryIO, most: int) -> None:
    """Check that the elements of a file of version 5 to 7 unpack to at most ``most`` bytes.

    Raises:
        ValueError: they do not, or are spoiled.
    """
    order = {b"MI": ">", b"IM": "<"}.get(data.read(_HEADER)[-2:])
    left = most
    while order and len(tag := data.read(8)) == 8:
        kind, size = struct.unpack(f"{order}II", tag)
        if kind != _PACKED:
            left -= size
            data.seek(size, 1)
        machine = zlib.decompressobj()
        while kind == _PACKED and size and left >= 0 and (piece := data.read(min(size, _PIECE))):
            size -= len(piece)
            while piece and left >= 0:
                left -= len(machine.decompress(piece, _PIECE))
                piece = machine.unconsumed_tail
        if left < 0:
            raise ValueError(f"it unpacks to more than {most} bytes; expected one flight")
    data.seek(0)


def named(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of numbers within a value by their names."""
    if hasattr(value, "items"):
        for key, inner in value.items():
            if not key.startswith(("__", "#")):
                yield from named(f"{name}.{key}" if name else key, inner)
    elif getattr(value, "dtype", np.dtype(object)).kind in "biuf":
        yield name, value


def main() -> None:
    """Read and write."""
    warnings.simplefilter("ignore")
    most, memory = map(int, sys.argv[1:])
    with suppress(ImportError):  # Windows
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    data = sys.stdin.buffer
    data.seek(0)  # the caller has read the file's start
    is_hdf5 = data.read(10) == b"MATLAB 7.3"
    data.seek(0)
    if is_hdf5:  # with its axes turned
        with import_module("h5py").File(data, "r") as file:
            sets = dict(named("", file))
            if sum(value.nbytes for value in sets.values()) > most:
                raise ValueError(f"it unpacks to more than {most} bytes; expected one flight")
            arrays = {name: value[()].T for name, value in sets.items()}
    else:
        _check_unpacked(data, most)
        arrays = dict(named("", loadmat(data, simplify_cells=True)))
    np.savez(sys.stdout.buffer, **{f"_{name}": value for name, value in arrays.items()})


if __name__ == "__main__":
    try:
        main()
    except MemoryError:
        raise ValueError(f"it takes more than {sys.argv[2]} bytes of memory") from None
