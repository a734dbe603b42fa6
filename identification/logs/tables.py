"""Tables of numbers in text, Parquet, MATLAB and NumPy files: read with errors that say where,
written whole or not at all.
"""

import gzip
from collections.abc import Callable, Mapping
from pathlib import Path

from ...runtime.errors import InputError
from ...runtime.extras import need
from ...runtime.page_files import write_text
from ...runtime.whole_files import replaced
from .array_table import open_arrays
from .parquet_table import open_parquet
from .table import ARRAY_SUFFIXES, SUFFIXES, TEXT_SUFFIXES, Array, Table, file_kind
from .text_table import open_text


def is_table(path: Path) -> bool:
    """Return whether a file's name is that of a table: of arrays, or a text, packed or not."""
    name = path.name.lower()
    return name.endswith((".parquet", *ARRAY_SUFFIXES)) or name.removesuffix(".gz").endswith(
        TEXT_SUFFIXES
    )


def open_table(path: Path) -> Table:
    """Open a table of any layout.

    Raises:
        InputError: unreadable, no table, no regular file, without rows, or more than
            ``FileLimits`` allows.
    """
    if not is_table(path):
        raise InputError(
            f"{path}: unknown kind of file; expected a table whose name ends in "
            f"{', '.join(dict.fromkeys((*TEXT_SUFFIXES, *SUFFIXES, *ARRAY_SUFFIXES)))}"
        )
    name = path.name.lower()
    if name.endswith(ARRAY_SUFFIXES):
        return open_arrays(path)
    return open_parquet(path) if name.endswith(".parquet") else open_text(path)


def write_table(columns: Mapping[str, Array], path: Path) -> None:
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


def write_csv(columns: Mapping[str, Array], path: Path) -> None:
    """Write columns (rows,) of results to a CSV file: numbers with nine significant digits, the
    first column's, the time, exactly.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(_csv_text(columns, "nan", "{:.9g}".format), path)


def _csv_text(
    columns: Mapping[str, Array], missing: str = "", form: Callable[[float], str] = repr
) -> str:
    texts = [
        [missing if x != x else form(x) if i else repr(x) for x in column.tolist()]
        for i, column in enumerate(columns.values())
    ]
    return "\n".join([",".join(columns), *map(",".join, zip(*texts, strict=True))]) + "\n"
