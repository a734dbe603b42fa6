"""Tables of numbers in text and Parquet files: read with errors that say where, written whole or
not at all.
"""

import gzip
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS
from ...runtime.whole_files import replaced
from .csv_table import open_csv
from .parquet_table import import_parquet, open_parquet
from .table import SUFFIXES, Array, Table, file_kind

__all__ = ["SUFFIXES", "Array", "Table", "file_kind", "open_table", "write_csv", "write_table"]

LARGEST = LIMITS.table_text


def open_table(path: Path) -> Table:
    """Open a CSV, gzipped CSV or Parquet file.

    Raises:
        InputError: unreadable, not of its kind, no regular file, without rows, with two columns of
            one name, or more than ``FileLimits`` allows.
    """
    table = (open_parquet if file_kind(path) == ".parquet" else open_csv)(path, LARGEST)
    repeated = [name for name, count in Counter(table.header).items() if count > 1]
    if repeated:
        raise InputError(
            f"{path}: column {', '.join(sorted(repeated)[:20])} stands there more than once; "
            f"expected it once"
        )
    if table.rows > LIMITS.table_rows:
        raise InputError(
            f"{path}: claims {table.rows} rows; expected one flight, at most {LIMITS.table_rows}"
        )
    if table.rows == 0:
        raise InputError(f"{path}: no rows; expected a header and at least one row of numbers")
    return table


def write_table(columns: Mapping[str, Array], path: Path) -> None:
    """Write columns (rows,) to a CSV, gzipped CSV or Parquet file; numbers read back exactly, NaN
    as an empty field.

    Raises:
        InputError: the name's ending is unknown or the file cannot be written.
    """
    kind = file_kind(path)
    with replaced(path) as temporary:
        if kind == ".parquet":
            parquet = import_parquet(path)
            import pyarrow

            arrays = {
                name: pyarrow.array(column, from_pandas=True) for name, column in columns.items()
            }
            parquet.write_table(pyarrow.table(arrays), temporary)
            return
        data = _csv_text(columns).encode()
        # a fixed time stamp: the same table gives the same bytes
        temporary.write_bytes(gzip.compress(data, 6, mtime=0) if kind == ".csv.gz" else data)


def _csv_text(columns: Mapping[str, Array], missing: str = "") -> str:
    texts = [
        [missing if value != value else repr(value) for value in column.tolist()]
        for column in columns.values()
    ]
    return "\n".join([",".join(columns), *map(",".join, zip(*texts, strict=True))]) + "\n"


def write_csv(columns: Mapping[str, Array], path: Path, missing: str = "nan") -> None:
    """Write columns (rows,) to a CSV file, with ``missing`` for NaN.

    Raises:
        InputError: the file cannot be written.
    """
    with replaced(path) as temporary:
        temporary.write_text(_csv_text(columns, missing), encoding="utf-8")
