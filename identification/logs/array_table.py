"""Arrays in MATLAB (.mat) and NumPy (.npz) files as the columns of one table: a field of a struct
is ``struct.field``, a column of a matrix ``name[0]``, ``name[1]`` ...
"""

import io
import math
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

# of a MATLAB file (its manual "MAT-File Format"): bytes of its header; kinds of elements, an array
# and a packed one; classes of arrays; and types of numbers
_HEAD, _MATRIX, _PACKED = 128, 14, 15
_STRUCT, _NUMBERS = 2, range(6, 16)
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"}
_TYPES |= {12: "i8", 13: "u8"}
_Order = Literal["big", "little"]
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
    """Return the numbers and structs of a MATLAB file of version 5 to 7; texts, cells and objects
    are None. scipy's reader takes the same files, but ends the program at a spoiled one.

    Raises:
        InputError: it is of version 7.3 and h5py is not installed, or unpacks to too much.
        ValueError: it is no such file, or is cut.
    """
    if data.startswith(b"MATLAB 7.3"):
        return _hdf5(path, data)
    if data[126:128] not in (b"IM", b"MI"):
        raise ValueError("no MATLAB file of version 5 to 7")
    order: _Order = "big" if data[126:128] == b"MI" else "little"
    found, left = {}, LIMITS.table_text
    for kind, inside in _elements(memoryview(data)[_HEAD:], order):
        element: Any = inside
        if kind == _PACKED:
            machine = zlib.decompressobj()
            unpacked = machine.decompress(inside, left + 1)
            left -= len(unpacked)
            check_count(path, LIMITS.table_text - left, LIMITS.table_text, "bytes unpacked")
            ((kind, element),) = _elements(memoryview(unpacked), order)
        if kind == _MATRIX:
            name, value = _matrix(element, order)
            found[name] = value
    return found


def _elements(data: memoryview, order: _Order) -> Iterator[tuple[int, memoryview]]:
    """Yield the kinds and contents of elements that follow one another, each at a multiple of 8
    bytes behind another that is not packed.

    Raises:
        ValueError: the last one is cut.
    """
    at = 0
    while at < len(data):
        kind, size = (int.from_bytes(data[at + k : at + k + 4], order) for k in (0, 4))
        begin = at + 8
        if kind >> 16:  # a small one: size and kind in one word
            kind, size, begin = kind & 0xFFFF, kind >> 16, at + 4
        if begin + size > len(data):
            raise ValueError("it is cut")
        yield kind, data[begin : begin + size]
        at = begin + size
        at += 0 if kind == _PACKED else -at % 8


def _matrix(data: memoryview, order: _Order) -> tuple[str, Any]:
    """Return the name and the value of an array.

    Raises:
        ValueError: it is none.
    """
    (_, flags), (_, shape), (_, name), *rest = _elements(data, order)
    mark = "<" if order == "little" else ">"
    lengths = np.frombuffer(shape, f"{mark}i4").tolist()
    kind = int.from_bytes(flags[:4], order) & 0xFF
    value: Any = None
    if kind in _NUMBERS and rest:
        values = np.frombuffer(rest[0][1], mark + _TYPES[rest[0][0]])
        value = values.reshape(lengths, order="F")
    elif kind == _STRUCT and math.prod(lengths) == 1:
        (_, width), (_, names), *fields = rest
        step = int.from_bytes(width, order)
        starts = range(0, len(names), step)
        keys = [bytes(names[i : i + step]).partition(b"\0")[0].decode("latin-1") for i in starts]
        value = {key: _matrix(one, order)[1] for key, (_, one) in zip(keys, fields, strict=True)}
    return bytes(name).decode("latin-1"), value


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
