"""Parquet: pages are counted by their own headers before a library unpacks them, and rows while
they are read.

A page of some bytes may unpack to 2 GB, and a dictionary of one text stand for any number of its
copies. So columns must be numbers, whose rows take 8 bytes each, and no page may be large.
"""

import os
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from ...runtime.errors import InputError
from ...runtime.extras import need
from ...runtime.file_limits import LIMITS
from ...runtime.regular_files import check_regular, open_regular
from .table import WHAT, Array, Table

_BATCH = 2**16  # rows read at a time
_BUFFER = 2**20  # bytes of a column that are read at a time
_HEADER = 2**16  # bytes that the header of a page may take
_UNPACKED, _PACKED = 2, 3  # fields of that header (parquet.thrift): bytes of the page
_COUNT = 1  # field of the structs in that header: values in the page
# Thrift's kinds of fields; truth values stand in the kind itself
_BYTES = {1: 0, 2: 0, 3: 1, 7: 8}
_WHOLE_NUMBERS, _TEXT, _STRUCT = (4, 5, 6), 8, 12


def open_parquet(path: Path) -> Table:
    """Open a Parquet file.

    Raises:
        InputError: unreadable, not Parquet, or more than ``FileLimits`` allows.
    """
    need("pyarrow", "parquet", path)
    import pyarrow
    from pyarrow import parquet

    check_regular(path, WHAT, LIMITS.table_text)
    _check_footer(path)
    try:
        file = parquet.ParquetFile(path, buffer_size=_BUFFER)
        header, rows = tuple(file.schema_arrow.names), int(file.metadata.num_rows)
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read as Parquet: {error}") from error

    def fill(table: Table, where: Sequence[int], columns: Array) -> None:
        names = [header[i] for i in where]
        for name in names:
            _check_type(path, file, name)
        _check_pages(path, file, names)
        for name, column in zip(names, columns, strict=True):
            done = 0
            try:
                for batch in file.iter_batches(batch_size=_BATCH, columns=[name]):
                    numbers = batch.column(0).cast(pyarrow.float64())
                    part = column[done : done + len(numbers)]
                    part[:] = numbers.to_numpy(zero_copy_only=False)[: len(part)]
                    done += len(numbers)
                    if done > rows:
                        break
            except (OSError, pyarrow.ArrowException) as error:
                raise InputError(
                    f"{path}: column {name} cannot be read: {error}; expected numbers"
                ) from error
            if done != rows:
                raise InputError(
                    f"{path}: column {name} has {done if done < rows else 'more'} rows; expected "
                    f"the {rows} that the file claims"
                )

    return Table(path, header, rows, fill)


def write_parquet(columns: Mapping[str, Array], path: Path, temporary: Path) -> None:
    """Write columns (rows,) to the file that is to become ``path``; NaN as no value.

    Raises:
        InputError: pyarrow is not installed.
    """
    need("pyarrow", "parquet", path)
    import pyarrow
    from pyarrow import parquet

    arrays = {name: pyarrow.array(column, from_pandas=True) for name, column in columns.items()}
    parquet.write_table(pyarrow.table(arrays), temporary)


def _check_footer(path: Path) -> None:
    """Raise InputError where what describes the file is too long; a library turns it into many
    times its size.
    """
    with open_regular(path, WHAT) as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - 8))
        end = file.read(8)
    length = int.from_bytes(end[:4], "little")
    if end[4:] == b"PAR1" and length > LIMITS.parquet_footer:
        raise InputError(
            f"{path}: its footer has {length} bytes; expected at most {LIMITS.parquet_footer}"
        )


def _check_type(path: Path, file: Any, name: str) -> None:
    import pyarrow

    kind = file.schema_arrow.field(name).type
    types = pyarrow.types
    value = kind.value_type if types.is_dictionary(kind) else kind
    tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_null, types.is_decimal)
    if not any(test(value) for test in tests):
        raise InputError(f"{path}: column {name} cannot be read: it holds {kind}; expected numbers")


def _check_pages(path: Path, file: Any, names: Sequence[str]) -> None:
    """Raise InputError where a page of these columns unpacks to too much, by its own header."""
    metadata, pages = file.metadata, 0
    leaves = [metadata.schema.column(i).path for i in range(metadata.num_columns)]
    wanted = [i for i, leaf in enumerate(leaves) if leaf.split(".")[0] in names]
    with open_regular(path, WHAT) as raw:
        size = os.fstat(raw.fileno()).st_size
        for group, i in product(range(metadata.num_row_groups), wanted):
            chunk = metadata.row_group(group).column(i)
            starts = [chunk.data_page_offset, chunk.dictionary_page_offset or 0]
            at = min((start for start in starts if start > 0), default=0)
            end = min(size, at + chunk.total_compressed_size)
            while 0 < at < end:
                raw.seek(at)
                try:
                    header, length = _struct(raw.read(_HEADER), 0)
                except (IndexError, ValueError) as error:
                    raise InputError(
                        f"{path}: cannot be read as Parquet: no page of values at byte {at}"
                    ) from error
                unpacked, packed = header.get(_UNPACKED, 0), header.get(_PACKED, 0)
                counts = (part.get(_COUNT, 0) for part in header.values() if isinstance(part, dict))
                values, pages = max(counts, default=0), pages + 1
                is_small = 0 <= unpacked <= LIMITS.parquet_page and packed >= 0
                if not is_small or values > LIMITS.table_rows or pages > LIMITS.parquet_pages:
                    raise InputError(
                        f"{path}: column {leaves[i]}, page {pages}: {values} values in {unpacked} "
                        f"bytes; expected one flight, pages of at most {LIMITS.parquet_page} "
                        f"bytes, at most {LIMITS.parquet_pages} of them"
                    )
                at += length + packed


def _struct(data: bytes, at: int, depth: int = 0) -> tuple[dict[int, Any], int]:
    """Return the whole numbers and structs of a struct in Thrift's compact protocol by their
    fields, and where it ends. Other fields are passed over; the header of a page has no lists.
    """
    found: dict[int, Any] = {}
    number = 0
    while data[at]:
        kind, step = data[at] & 0x0F, data[at] >> 4
        at += 1
        if step:
            number += step
        else:
            number, at = _whole_number(data, at)
        if kind == _STRUCT and depth < 8:
            found[number], at = _struct(data, at, depth + 1)
        elif kind in _WHOLE_NUMBERS:
            found[number], at = _whole_number(data, at)
        elif kind == _TEXT:
            length, at = _varint(data, at)
            at += length
        elif kind in _BYTES:
            at += _BYTES[kind]
        else:
            raise ValueError(f"no header of a page has a field of kind {kind}")
    return found, at + 1


def _whole_number(data: bytes, at: int) -> tuple[int, int]:
    zigzag, at = _varint(data, at)
    return (zigzag >> 1) ^ -(zigzag & 1), at


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while shift < 64:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
    raise ValueError("a number of more than 64 bits")
