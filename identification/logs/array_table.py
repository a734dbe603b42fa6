"""Arrays in MATLAB (.mat) and NumPy (.npz) files as the columns of one table: a field of a struct
is ``struct.field``, a column of a matrix ``name[0]``, ``name[1]`` ...
"""

import io
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS
from ...runtime.regular_files import check_archive, read_bytes
from ...runtime.workers import SINGLE_THREADED
from .table import WHAT, Array, Table, one_line

_MEMORY = 4  # times the bytes that a file may unpack to
_SHOWN = 10  # arrays that a note lists


def open_arrays(path: Path) -> Table:
    """Open the arrays of a file. Rows are as many as most arrays have; arrays of other lengths are
    left out, with a note.

    Raises:
        InputError: unreadable, no arrays of numbers, or more than ``FileLimits`` allows.
    """
    data = read_bytes(path, WHAT, LIMITS.binary_log)
    with one_line(f"{path}: cannot be read as {WHAT}"):
        is_matlab = not path.name.lower().endswith(".npz")
        data = _matlab(path, data) if is_matlab else data
        check_archive(path, io.BytesIO(data), LIMITS.table_text, WHAT)
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            read = {name[is_matlab:]: array for name, array in archive.items()}
        for name, array in list(read.items()):
            read |= {f"{name}.{field}": array[field] for field in array.dtype.names or ()}
        arrays = {name: x.squeeze() for name, x in read.items() if x.dtype.kind in "biuf"}
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

    def load(_: Table, names: Sequence[str]) -> Iterator[Array]:
        return (columns[name] for name in names)

    return Table(path, tuple(columns), rows, load, notes=tuple(notes if other else ()))


def _matlab(path: Path, data: bytes) -> bytes:
    """Return the arrays of numbers in a MATLAB file as a NumPy archive.

    scipy reads it in a process of its own: of 8 x 400 files with spoiled bytes, one in each 8 ended
    the process by a segmentation fault before the 214th.

    Raises:
        InputError: it is of version 7.3 and h5py is not installed.
        ValueError: it is no such file, is spoiled, or unpacks to too much.
    """
    if data.startswith(b"MATLAB 7.3") and find_spec("h5py") is None:
        raise InputError(
            f"{path}: is MATLAB's version 7.3; expected version 7, as save('flight.mat', '-v7') "
            "writes, or h5py installed"
        )
    program = str(Path(__file__).with_name("matlab_arrays.py"))
    command = [sys.executable, "-P", program, str(_MEMORY * LIMITS.table_text)]
    # threads of linear algebra would take memory of what the file may
    alone = {**os.environ, **SINGLE_THREADED}
    ran = subprocess.run(command, input=data, capture_output=True, check=False, env=alone)
    if ran.returncode:
        said = ran.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        raise ValueError(said.partition(": ")[2] or said or "a spoiled MATLAB file")
    return ran.stdout
