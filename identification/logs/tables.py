"""Tables of numbers in text and Parquet files: read with errors that say where, written whole or
not at all.
"""

import csv
import gzip
import io
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, cast

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError
from ...runtime.whole_files import replaced

Array = NDArray[np.float64]

SUFFIXES = (".csv", ".csv.gz", ".parquet")
LARGEST = 2**31  # characters of text
_LONGEST_LINE = 1_000_000  # characters
MOST_ROWS = 20_000_000  # a day at 200 Hz


@dataclass(frozen=True)
class Table:
    """A file of named columns, of which only those asked for are turned into numbers."""

    path: Path
    header: tuple[str, ...]
    rows: int
    read: Callable[
        [Sequence[str]], dict[str, Array]
    ]  # names to columns (rows,); empty fields are NaN

    def row(self, index: int) -> str:
        """Return how to find a row (counted from 0) in the file: rows count from 1, lines include
        the header.
        """
        return f"row {index + 1}" if file_kind(self.path) == ".parquet" else _text_row(index)


def _text_row(index: int) -> str:
    return f"row {index + 1} (line {index + 2})"


def file_kind(path: Path) -> str:
    """Return which of ``SUFFIXES`` a file has.

    Raises:
        InputError: none of them.
    """
    for suffix in SUFFIXES:
        if path.name.lower().endswith(suffix):
            return suffix
    raise InputError(
        f"{path}: unknown kind of file; expected a name that ends in {', '.join(SUFFIXES)}"
    )


def open_table(path: Path) -> Table:
    """Open a CSV, gzipped CSV or Parquet file.

    Raises:
        InputError: unreadable, not of its kind, without rows, or with two columns of one name.
    """
    table = (
        _open_parquet(path)
        if file_kind(path) == ".parquet"
        else _open_text(path, _read_lines(path))
    )
    repeated = {name for name in table.header if table.header.count(name) > 1}
    if repeated:
        raise InputError(
            f"{path}: column {', '.join(sorted(repeated))} stands there more than once; expected "
            f"it once"
        )
    if table.rows > MOST_ROWS:
        raise InputError(
            f"{path}: claims {table.rows} rows; expected one flight, at most {MOST_ROWS}"
        )
    if table.rows == 0:
        raise InputError(f"{path}: no rows; expected a header and at least one row of numbers")
    return table


def _read_lines(path: Path) -> list[str]:
    """Return the lines of a text file, read one by one: as one text, and cut, they would take three
    times the memory.
    """
    lines: list[str] = []
    size = 0
    try:
        # what is packed may unpack to any size
        with gzip.open(path) if file_kind(path) == ".csv.gz" else path.open("rb") as file:
            text = io.TextIOWrapper(cast(IO[bytes], file), encoding="utf-8-sig")
            while line := text.readline(_LONGEST_LINE + 1):
                size += len(line)
                if size > LARGEST or len(line) > _LONGEST_LINE:
                    limit = (
                        f"{LARGEST} characters of text"
                        if size > LARGEST
                        else f"{_LONGEST_LINE} in line {len(lines) + 1}"
                    )
                    raise InputError(f"{path}: more than {limit}; expected one flight")
                if "\0" in line:
                    raise InputError(f"{path}: not a text file (it holds zero bytes); expected CSV")
                lines.append(line.rstrip("\n"))
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not a text file (behind line {len(lines)} it is not UTF-8); expected CSV"
        ) from error
    while lines and not lines[-1].strip():
        lines.pop()
    return lines


def _open_text(path: Path, lines: list[str]) -> Table:
    if any('"' in line for line in lines):
        try:
            lines = [
                ",".join(field.replace(",", " ") for field in row)
                for row in csv.reader(lines, strict=True)
            ]
        except csv.Error as error:
            raise InputError(f"{path}: not valid CSV: {error}") from error
    if not lines:
        raise InputError(f"{path}: empty file; expected a header and at least one row of numbers")
    header = tuple(name.strip() for name in lines[0].split(","))
    body = lines[1:]

    def read(names: Sequence[str]) -> dict[str, Array]:
        commas = len(header) - 1
        for i, line in enumerate(body):
            if line.count(",") != commas:
                raise InputError(
                    f"{path}: {_text_row(i)} has {line.count(',') + 1} field(s); expected "
                    f"{commas + 1}, "
                    "as many as the header"
                )
        # the fast parser knows no empty field; two passes, because neighbours share a comma
        filled = body
        if any(",," in line or line[:1] == "," or line[-1:] == "," for line in body):
            filled = [
                f",{line},".replace(",,", ",nan,").replace(",,", ",nan,")[1:-1] for line in body
            ]
        where = [header.index(name) for name in names]
        try:
            values = np.loadtxt(filled, delimiter=",", comments=None, usecols=where, ndmin=2)
        except ValueError as error:
            raise _bad_number(path, filled, names, where) from error
        return {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}

    return Table(path, header, len(body), read)


def _bad_number(
    path: Path, lines: Sequence[str], names: Sequence[str], where: Sequence[int]
) -> InputError:
    """Return the error for the first field that is not a number."""
    for i, line in enumerate(lines):
        fields = line.split(",")
        for name, j in zip(names, where, strict=True):
            try:
                float(
                    fields[j].replace("_", "?")
                )  # Python's numbers may hold underscores, the fast parser's not
            except ValueError:
                return InputError(
                    f"{path}: column {name}, {_text_row(i)}: {fields[j]!r} is not a number; "
                    "expected a decimal number"
                )
    return InputError(f"{path}: not a table of numbers; expected CSV")


def _open_parquet(path: Path) -> Table:
    parquet = _import_parquet(path)
    import pyarrow

    try:
        file = parquet.ParquetFile(path)
        header, rows = tuple(file.schema_arrow.names), int(file.metadata.num_rows)
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read as Parquet: {error}") from error

    def read(names: Sequence[str]) -> dict[str, Array]:
        columns = {}
        for name in names:
            try:
                column = file.read(columns=[name]).column(0).cast(pyarrow.float64())
            except (OSError, pyarrow.ArrowException) as error:
                raise InputError(
                    f"{path}: column {name} cannot be read: {error}; expected numbers"
                ) from error
            if len(column) != rows:
                raise InputError(
                    f"{path}: column {name} has {len(column)} rows; expected the {rows} that the "
                    f"file claims"
                )
            columns[name] = np.array(column.to_numpy(), dtype=np.float64)
        return columns

    return Table(path, header, rows, read)


def _import_parquet(path: Path):  # type: ignore[no-untyped-def]
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise InputError(
            f"{path}: Parquet needs pyarrow, which is not installed: pip install "
            f"'windwrench[parquet]', "
            "or use .csv.gz"
        ) from error
    return parquet


def write_table(columns: Mapping[str, Array], path: Path) -> None:
    """Write columns (rows,) to a CSV, gzipped CSV or Parquet file; numbers read back exactly, NaN
    as an empty field.

    Raises:
        InputError: the name's ending is unknown or the file cannot be written.
    """
    kind = file_kind(path)
    with replaced(path) as temporary:
        if kind == ".parquet":
            parquet = _import_parquet(path)
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
