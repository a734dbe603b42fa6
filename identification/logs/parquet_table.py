"""Parquet files as tables: a field of a struct is ``struct.field``, an item of a list ``name[0]``,
``name[1]`` ... What a file says of its columns' sizes is looked at before they are unpacked.

A dictionary of one text may stand for any number of its copies, so columns must be numbers.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.errors import InputError
from ...runtime.extras import need
from ...runtime.file_limits import LIMITS, check_count
from ...runtime.regular_files import check_regular
from .table import WHAT, Array, Table

_BUFFER = 2**20  # bytes of a column that are read at a time


def open_parquet(path: Path) -> Table:
    """Open a Parquet file.

    Raises:
        InputError: unreadable, not Parquet, or more than ``FileLimits`` allows.
    """
    need("pyarrow", "parquet", path)
    import pyarrow
    from pyarrow import parquet

    check_regular(path, WHAT, LIMITS.table_text)
    try:
        file = parquet.ParquetFile(
            path,
            buffer_size=_BUFFER,
            thrift_string_size_limit=LIMITS.parquet_footer,
            thrift_container_size_limit=LIMITS.parquet_footer,
        )
        rows = int(file.metadata.num_rows)
        columns: list[tuple[str, Any]] = []  # names, and arrays of their own or the file's fields
        for field in file.schema_arrow:
            if pyarrow.types.is_nested(field.type):
                columns += _within(path, field.name, _column(path, file, field.name))
            else:
                columns.append((field.name, field))
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read as Parquet: {error}") from error

    def load(_: Table, names: Sequence[str]) -> Iterator[Array]:
        for name in names:
            values = dict(columns)[name]
            if not _is_numeric(values.type):
                raise InputError(
                    f"{path}: column {name} cannot be read: it holds {values.type}; expected "
                    "numbers"
                )
            if isinstance(values, pyarrow.Field):
                values = _column(path, file, name)
            if len(values) != rows:
                raise InputError(
                    f"{path}: column {name} has {len(values)} rows; expected the {rows} that the "
                    "file claims"
                )
            yield values.cast(pyarrow.float64()).to_numpy(zero_copy_only=False)

    numeric = tuple(name for name, column in columns if _is_numeric(column.type))
    return Table(path, tuple(name for name, _ in columns), rows, load, numeric=numeric)


def _column(path: Path, file: Any, name: str) -> Any:
    """Return a whole column, in one piece.

    Raises:
        InputError: it cannot be read, or is more than ``FileLimits`` allows, by what the file says
            of it.
    """
    import pyarrow

    groups = map(file.metadata.row_group, range(file.metadata.num_row_groups))
    chunks = [chunk for group in groups for chunk in map(group.column, range(group.num_columns))]
    chunks = [chunk for chunk in chunks if chunk.path_in_schema.split(".")[0] == name]
    size = sum(max(chunk.total_uncompressed_size, 0) for chunk in chunks)
    most = max((chunk.num_values for chunk in chunks), default=0)
    check_count(path, size, LIMITS.table_text, f"bytes in column {name}")
    check_count(path, most, LIMITS.table_numbers, f"numbers in column {name}")
    try:
        return file.read(columns=[name]).column(0).combine_chunks()
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(
            f"{path}: column {name} cannot be read: {error}; expected numbers"
        ) from error


def _within(path: Path, name: str, array: Any) -> Iterator[tuple[str, Any]]:
    """Yield the columns that fields of structs and items of lists of numbers make, by their names.

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
        count = int(sizes[0]) if len(sizes) else 0
        check_count(path, len(array) * count, LIMITS.table_numbers, f"numbers in column {name}")
        values = np.full((len(array), count), np.nan)
        if count:
            flat = array.flatten().cast(pyarrow.float64()).to_numpy(zero_copy_only=False)
            values[lengths > 0] = flat.reshape(-1, count)
        for i, column in enumerate(values.T):
            yield f"{name}[{i}]", pyarrow.array(column)
    else:
        yield name, array


def _is_numeric(kind: Any) -> bool:
    from pyarrow import types

    value = kind.value_type if types.is_dictionary(kind) else kind
    tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_null, types.is_decimal)
    return any(test(value) for test in tests)
