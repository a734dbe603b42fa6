"""Parquet: pages are counted by their own headers before a library unpacks them, and rows while
they are read.

A page of some bytes may unpack to 2 GB, and a dictionary of one text stand for any number of its
copies. So columns must be numbers, whose rows take 8 bytes each, and no page may be large.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS
from ...runtime.regular_files import check_regular, open_regular
from .table import WHAT, Array, Table, empty_columns

_BATCH = 2**16  # rows read at a time
_BUFFER = 2**20  # bytes of a column that are read at a time
_HEADER = 2**16  # bytes that the header of a page may take


def import_parquet(path: Path) -> Any:
    """Return pyarrow's module for Parquet.

    Raises:
        InputError: it is not installed.
    """
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise InputError(
            f"{path}: Parquet needs pyarrow, which is not installed: pip install "
            f"'windwrench[parquet]', "
            "or use .csv.gz"
        ) from error
    return parquet


def open_parquet(path: Path, largest: int) -> Table:
    """Open a Parquet file of at most ``largest`` bytes.

    Raises:
        InputError: unreadable, not Parquet, or more than ``FileLimits`` allows.
    """
    parquet = import_parquet(path)
    import pyarrow

    check_regular(path, WHAT, largest)
    _check_footer(path)
    try:
        file = parquet.ParquetFile(path, buffer_size=_BUFFER)
        header, rows = tuple(file.schema_arrow.names), int(file.metadata.num_rows)
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read as Parquet: {error}") from error

    def read(names: Sequence[str]) -> dict[str, Array]:
        columns = empty_columns(path, rows, names)
        for name in names:
            _check_type(path, file, name)
        _check_pages(path, file, names)
        for name, column in zip(names, columns, strict=True):
            done = 0
            try:
                for batch in file.iter_batches(batch_size=_BATCH, columns=[name]):
                    numbers = batch.column(0).cast(pyarrow.float64())
                    if done + len(numbers) <= rows:
                        column[done : done + len(numbers)] = numbers.to_numpy(zero_copy_only=False)
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
        return dict(zip(names, columns, strict=True))

    return Table(path, header, rows, read)


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
        for group in range(metadata.num_row_groups):
            for i in wanted:
                chunk = metadata.row_group(group).column(i)
                starts = [chunk.data_page_offset, chunk.dictionary_page_offset or 0]
                at = min(start for start in starts if start > 0) if any(starts) else 0
                end = min(size, at + chunk.total_compressed_size)
                while 0 < at < end:
                    header, length = _page_header(path, raw, at)
                    unpacked, packed = header.get(2, 0), header.get(3, 0)
                    values = [part.get(1, 0) for part in header.values() if isinstance(part, dict)]
                    pages += 1
                    too_much = (
                        not 0 <= unpacked <= LIMITS.parquet_page
                        or packed < 0
                        or max(values, default=0) > LIMITS.table_rows
                        or pages > LIMITS.parquet_pages
                    )
                    if too_much:
                        raise InputError(
                            f"{path}: column {leaves[i]}, page {pages}: {max(values, default=0)} "
                            f"values in {unpacked} bytes; expected one flight, pages of at most "
                            f"{LIMITS.parquet_page} bytes, at most {LIMITS.parquet_pages} of them"
                        )
                    at += length + packed


def _page_header(path: Path, file: BinaryIO, at: int) -> tuple[dict[int, Any], int]:
    """Return the fields of a page's header by their numbers (parquet.thrift: 2 is its size
    unpacked, 3 packed, 5, 7 and 8 hold the count of values as 1), and its length.
    """
    file.seek(at)
    data = file.read(_HEADER)
    try:
        return _fields(data, 0, 0)
    except (IndexError, ValueError) as error:
        raise InputError(
            f"{path}: cannot be read as Parquet: no page of values at byte {at}"
        ) from error


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
        if shift > 63:
            raise ValueError("a number of more than 64 bits")


def _fields(data: bytes, at: int, depth: int) -> tuple[dict[int, Any], int]:
    """Return the fields of a struct in Thrift's compact protocol, and where it ends; texts and
    lists as None.
    """
    if depth > 8:
        raise ValueError("structs within structs")
    found: dict[int, Any] = {}
    number = 0
    while data[at]:
        kind, step = data[at] & 0x0F, data[at] >> 4
        at += 1
        if step:
            number += step
        else:
            zigzag, at = _varint(data, at)
            number = (zigzag >> 1) ^ -(zigzag & 1)
        found[number], at = _value(data, at, kind, depth)
    return found, at + 1


def _value(data: bytes, at: int, kind: int, depth: int) -> tuple[Any, int]:
    if kind in (1, 2):  # a truth value, in the kind itself
        return kind == 1, at
    if kind == 3:
        return data[at], at + 1
    if kind in (4, 5, 6):  # whole numbers of 16, 32 and 64 bits
        zigzag, at = _varint(data, at)
        return (zigzag >> 1) ^ -(zigzag & 1), at
    if kind == 7:
        return None, at + 8
    if kind == 8:
        length, at = _varint(data, at)
        return None, at + length
    if kind == 12:
        return _fields(data, at, depth + 1)
    raise ValueError(f"no header of a page has a field of kind {kind}")
