"""Arrays in MATLAB (.mat) and NumPy (.npz) files as the columns of one table: a field of a struct
is ``struct.field``, a column of a matrix ``name[0]``, ``name[1]`` ...
"""

import io
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...runtime.archives import check_archive
from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS, check_count
from ...runtime.regular_files import read_bytes
from .table import WHAT, Array, Table

_HEAD, _PACKED = 128, 15  # bytes of a MATLAB file's header, and kind of a packed element
_SHOWN = 10  # arrays that a note lists


def open_arrays(path: Path) -> Table:
    """Open the arrays of a file. Rows are as many as most arrays have; arrays of other lengths are
    left out, with a note.

    Raises:
        InputError: unreadable, no arrays of numbers, or more than ``FileLimits`` allows.
    """
    data = read_bytes(path, WHAT, LIMITS.binary_log)
    try:
        if path.name.lower().endswith(".npz"):
            check_archive(path, io.BytesIO(data), LIMITS.table_text, WHAT)
            with np.load(io.BytesIO(data), allow_pickle=False) as archive:
                arrays = dict(_arrays("", dict(archive)))
        else:
            arrays = dict(_arrays("", _matlab(path, data)))
    except InputError:
        raise
    except Exception as error:  # whatever a parser makes of bytes that are none of its kind
        raise InputError(f"{path}: cannot be read as {WHAT}: {error}") from error
    lengths = Counter(n for array in arrays.values() for n in set(array.shape) if n > 1)
    if not lengths:
        raise InputError(f"{path}: no arrays of numbers; expected a flight's, of one length")
    rows = max(lengths, key=lambda n: (lengths[n], n))
    columns: dict[str, Any] = {}
    other = []
    for name, array in arrays.items():
        array = array if array.shape[:1] == (rows,) else array.T
        if array.shape[:1] != (rows,):
            other += [name] if array.size > 1 else []
            continue
        flat = array.reshape(rows, -1)
        names = [name] if array.ndim == 1 else [f"{name}[{i}]" for i in range(flat.shape[1])]
        columns |= dict(zip(names, flat.T, strict=True))
    notes = [f"arrays of other lengths than {rows} were left out: {', '.join(other[:_SHOWN])}"]

    def fill(table: Table, where: Sequence[int], out: Array) -> None:
        for i, column in zip(where, out, strict=True):
            column[:] = columns[table.header[i]]

    return Table(path, tuple(columns), rows, fill, notes=tuple(notes if other else ()))


def _arrays(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of numbers within a value by their names."""
    if not isinstance(value, Mapping):
        try:
            value = np.asarray(value)
        except ValueError:  # a list of arrays of several lengths
            return
        if value.dtype.names is None:
            if value.dtype.kind in "biuf":
                yield name, value.squeeze()
            return
        value = {field: value[field] for field in value.dtype.names}
    for key, inner in value.items():
        if not key.startswith("__"):
            yield from _arrays(f"{name}.{key}" if name else key, inner)


def _matlab(path: Path, data: bytes) -> dict[str, Any]:
    """Return the variables of a MATLAB file.

    Raises:
        InputError: it is of version 7.3 and h5py is not installed, or unpacks to too much.
    """
    if data.startswith(b"MATLAB 7.3"):
        return _hdf5(path, data)
    from scipy.io import loadmat

    loaded: dict[str, Any] = loadmat(io.BytesIO(_unpacked(path, data)), simplify_cells=True)
    return loaded


def _unpacked(path: Path, data: bytes) -> bytes:
    """Return a MATLAB file whose elements are not packed; what they unpack to is counted."""
    order: Literal["big", "little"] = "big" if data[126:128] == b"MI" else "little"
    out, at, left = [data[:_HEAD]], _HEAD, LIMITS.table_text
    while at + 8 <= len(data):
        kind, size = (int.from_bytes(data[at + k : at + k + 4], order) for k in (0, 4))
        element = data[at : at + 8 + size]
        if kind == _PACKED:
            element = zlib.decompressobj().decompress(element[8:], left + 1)
        left -= len(element)
        check_count(path, LIMITS.table_text - left, LIMITS.table_text, "bytes unpacked")
        out.append(element)
        at += 8 + size
    return b"".join(out)


def _hdf5(path: Path, data: bytes) -> dict[str, Any]:
    """Return the arrays of a MATLAB file of version 7.3, which is HDF5 with its axes turned."""
    try:
        h5py = import_module("h5py")
    except ImportError:
        raise InputError(
            f"{path}: is MATLAB's version 7.3; expected version 7, as save('flight.mat', '-v7') "
            "writes, or h5py installed"
        ) from None
    found: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            check_count(path, item.size, LIMITS.table_numbers, "numbers")
            found[name.replace("/", ".")] = item[()].T

    with h5py.File(io.BytesIO(data), "r") as file:
        file.visititems(keep)
    return found
