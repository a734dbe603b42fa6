"""Tables of numbers in Parquet, MATLAB and NumPy files: read with the places of errors. Tables of
results and of logs are written whole or not at all.

In Parquet a field of a struct is the column ``struct.field``, an item of a list ``name[0]``,
``name[1]`` ... Arrays of MATLAB (.mat) and NumPy (.npz) files make columns in the same way. A
Parquet file's sizes of columns are checked before unpacking. A dictionary of one text may stand for
any number of its copies, so its columns must be numbers.
"""

import gzip
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from subprocess import PIPE
from tempfile import TemporaryFile
from typing import Any, BinaryIO

import numpy as np

from ...runtime.errors import InputError
from ...runtime.extras import need
from ...runtime.file_limits import LIMITS, check_count
from ...runtime.page_files import write_text
from ...runtime.regular_files import check_archive, check_regular, open_regular
from ...runtime.threads import SINGLE_THREADED
from ...runtime.whole_files import replaced
from .table import WHAT, Array, ArrayMap, Data, Table, Texts, file_kind, one_line


def write_table(columns: ArrayMap, path: Path) -> None:
    """Write columns (rows,) to a CSV, gzipped CSV or Parquet file; numbers read back exactly, NaN
    as an empty field.

    Raises:
        InputError: the name's ending is unknown, the file cannot be written, or pyarrow is not
            installed.
    """
    kind = file_kind(path)
    with replaced(path) as temporary:
        if kind == ".parquet":
            need("pyarrow", "parquet", path)
            import pyarrow
            from pyarrow import parquet

            arrays = {name: pyarrow.array(x, from_pandas=True) for name, x in columns.items()}
            parquet.write_table(pyarrow.table(arrays), temporary)
            return
        data = _csv_text(columns).encode()
        # a fixed time stamp: the same table gives the same bytes
        temporary.write_bytes(gzip.compress(data, 6, mtime=0) if kind == ".csv.gz" else data)


def write_csv(columns: ArrayMap, path: Path) -> None:
    """Write columns (rows,) of results to a CSV file: numbers with nine significant digits, the
    first column's, the time, exactly.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(_csv_text(columns, "nan", "{:.9g}".format), path)


def _csv_text(columns: ArrayMap, missing: str = "", form: Callable[[float], str] = repr) -> str:
    texts = [
        [missing if x != x else form(x) if i else repr(x) for x in column.tolist()]
        for i, column in enumerate(columns.values())
    ]
    return "\n".join([",".join(columns), *map(",".join, zip(*texts, strict=True))]) + "\n"


def open_arrays(path: Path) -> Table:
    """Open the arrays of a file. Rows are as many as most arrays have; arrays of other lengths are
    left out, with a note.
    """
    check_regular(path, WHAT, LIMITS.binary_log)
    is_matlab = not path.name.lower().endswith(".npz")
    with one_line(f"{path}: cannot be read as {WHAT}"), TemporaryFile() as made:
        with open_regular(path, WHAT) as data:
            if is_matlab:
                _write_matlab(path, data, made)
            archived = made if is_matlab else data
            check_archive(path, archived, LIMITS.arrays, WHAT)
            with np.load(archived, allow_pickle=False) as archive:
                read = {name[is_matlab:]: array for name, array in archive.items()}
        for name, array in list(read.items()):
            read |= {f"{name}.{field}": array[field] for field in array.dtype.names or ()}
        arrays = {name: x.squeeze() for name, x in read.items() if x.dtype.kind in "biuf"}
    lengths = Counter(n for array in arrays.values() for n in set(array.shape) if n > 1)
    if not lengths:
        raise InputError(f"{path}: no arrays of numbers; expected a flight's, of one length")
    rows = max(lengths, key=lambda n: (lengths[n], n))
    columns: Data = {}
    other = []
    for name, array in arrays.items():
        array = array if array.shape[:1] == (rows,) else array.T
        if array.shape[:1] == (rows,):
            flat = array.reshape(rows, -1).T
            names = [name] if array.ndim == 1 else [f"{name}[{i}]" for i in range(len(flat))]
            columns |= zip(names, flat, strict=True)
        elif array.size > 1:
            other.append(name)
    note = f"arrays of other lengths than {rows} were left out: {', '.join(other[:10])}"

    def load(_: Table, names: Texts) -> Iterator[Array]:
        return map(columns.__getitem__, names)

    return Table(path, tuple(columns), rows, load, notes=(note,) if other else ())


def _write_matlab(path: Path, data: BinaryIO, made: BinaryIO) -> None:
    """Write the arrays of numbers in a MATLAB file into a file, as a NumPy archive.

    scipy reads the file in a process of its own: in each of 8 runs over 400 files with spoiled
    bytes, a segmentation fault ended the process before the 214th.

    Raises:
        InputError: the file is of version 7.3 and h5py is not installed.
        ValueError: the file is no MATLAB file, is spoiled, or unpacks to too much.
    """
    if data.read(10) == b"MATLAB 7.3" and not find_spec("h5py"):
        raise InputError(
            f"{path}: is MATLAB's version 7.3; expected version 7, as save('flight.mat', '-v7') "
            "writes, or h5py installed"
        )
    program = str(Path(__file__).with_name("matlab_arrays.py"))
    ran = subprocess.run(
        [sys.executable, "-P", program, str(LIMITS.arrays), str(7 * LIMITS.arrays // 4)],
        stdin=data,
        stdout=made,
        stderr=PIPE,
        # threads of linear algebra would take the file's share of memory
        env={**os.environ, **SINGLE_THREADED},
    )
    if ran.returncode:
        said = ran.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        raise ValueError(said.partition(": ")[2] or said or "a spoiled MATLAB file")
    made.seek(0)


def open_parquet(path: Path) -> Table:
    """Open a Parquet file."""
    need("pyarrow", "parquet", path)
    import pyarrow
    from pyarrow import parquet

    check_regular(path, WHAT, LIMITS.table_text)
    with one_line(f"{path}: cannot be read as Parquet"):
        file = parquet.ParquetFile(
            path,
            buffer_size=2**20,
            thrift_string_size_limit=LIMITS.parquet_footer,
            thrift_container_size_limit=LIMITS.parquet_footer,
        )
        rows = file.metadata.num_rows
        nested = [field.name for field in file.schema_arrow if pyarrow.types.is_nested(field.type)]
        _check_claims(path, file, nested, 8 * LIMITS.list_numbers, LIMITS.list_numbers, "of lists")
        columns = []  # names, and arrays of their own or the file's fields
        held = 0
        for field in file.schema_arrow:
            parts = [(field.name, field)]
            if field.name in nested:
                parts = list(_within(path, field.name, _column(path, file, field.name)))
                held += rows * len(parts)
                check_count(path, held, LIMITS.list_numbers, "numbers of lists")
            columns += parts

    def load(_: Table, names: Texts) -> Iterator[Array]:
        for name in names:
            values = dict(columns)[name]
            if not _is_numeric(values.type):
                raise InputError(
                    f"{path}: column {name} cannot be read: it holds {values.type}; expected "
                    "numbers"
                )
            if isinstance(values, pyarrow.Field):
                _check_claims(
                    path,
                    file,
                    [name],
                    LIMITS.table_text,
                    LIMITS.table_numbers,
                    f"in column {name}",
                )
                values = _column(path, file, name)
            if len(values) != rows:
                raise InputError(
                    f"{path}: column {name} has {len(values)} rows; expected the {rows} that the "
                    "file claims"
                )
            yield values.cast(pyarrow.float64()).to_numpy(zero_copy_only=False)

    numeric = tuple(name for name, column in columns if _is_numeric(column.type))
    return Table(path, tuple(name for name, _ in columns), rows, load, numeric=numeric)


def _check_claims(path: Path, file: Any, names: Texts, size: int, count: int, what: str) -> None:
    """Raise InputError where columns unpack to more bytes or numbers, by the file's metadata."""
    claims = [
        (max(chunk.total_uncompressed_size, 0), max(chunk.num_values, 0))
        for group in map(file.metadata.row_group, range(file.metadata.num_row_groups))
        for chunk in map(group.column, range(group.num_columns))
        if chunk.path_in_schema.split(".")[0] in names
    ]
    unpacked, numbers = map(sum, zip((0, 0), *claims, strict=True))
    check_count(path, unpacked, size, f"bytes {what}")
    check_count(path, numbers, count, f"numbers {what}")


def _column(path: Path, file: Any, name: str) -> Any:
    """Return a whole column, in one piece.

    Raises:
        InputError: the column is unreadable.
    """
    with one_line(f"{path}: column {name} cannot be read", "numbers"):
        return file.read(columns=[name]).column(0).combine_chunks()


def _within(path: Path, name: str, array: Any) -> Iterator[tuple[str, Any]]:
    """Yield the columns of structs' fields and of lists' numbers, by their names.

    Raises:
        InputError: the lists of a column have several lengths; empty ones may stand between.
    """
    import pyarrow
    from pyarrow import types

    kind = array.type
    if types.is_struct(kind):
        for field, inner in zip(kind, array.flatten(), strict=True):
            yield from _within(path, f"{name}.{field.name}", inner)
    elif types.is_nested(kind) and not types.is_map(kind) and _is_numeric(kind.value_type):
        lengths = array.value_lengths().fill_null(0).to_numpy(zero_copy_only=False)
        sizes = np.unique(lengths[lengths > 0])
        if len(sizes) > 1:
            raise InputError(
                f"{path}: column {name}: lists of {', '.join(map(str, sizes[:5]))} numbers; "
                "expected one length"
            )
        count = sizes.max(initial=0)
        check_count(path, len(array) * count, LIMITS.list_numbers, f"numbers in column {name}")
        values = np.full((count, len(array)), np.nan)
        if count:
            flat = array.flatten().cast(pyarrow.float64()).to_numpy(zero_copy_only=False)
            values[:, lengths > 0] = flat.reshape(-1, count).T
        for i, column in enumerate(values):  # without a copy
            yield f"{name}[{i}]", pyarrow.array(column)
    else:
        yield name, array


def _is_numeric(kind: Any) -> bool:
    from pyarrow import types

    value = kind.value_type if types.is_dictionary(kind) else kind
    tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_null, types.is_decimal)
    return any(test(value) for test in tests)
