"""A table of numbers in a file: its columns by name, and where a row stands."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS

Array = NDArray[np.float64]

SUFFIXES = (".csv", ".csv.gz", ".parquet")
WHAT = "a flight log"  # for errors


@dataclass(frozen=True)
class Table:
    """A file of named columns, of which only those asked for are turned into numbers."""

    path: Path
    header: tuple[str, ...]
    rows: int
    read: Callable[
        [Sequence[str]], dict[str, Array]
    ]  # names to columns (rows,); empty fields are NaN
    first_line: int = 2  # line of a text in which the first row stands
    notes: tuple[str, ...] = ()  # what was left out

    def row(self, index: int) -> str:
        """Return how to find a row (counted from 0) in the file: rows count from 1, lines include
        the header.
        """
        if self.path.name.lower().endswith(".parquet"):
            return f"row {index + 1}"
        return text_row(index, self.first_line)


def text_row(index: int, first_line: int = 2) -> str:
    """Return how to find a row (counted from 0) in a text whose first row is in ``first_line``."""
    return f"row {index + 1} (line {index + first_line})"


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


def empty_columns(path: Path, rows: int, names: Sequence[str]) -> Array:
    """Return room for columns, (len(names), rows).

    Raises:
        InputError: they are more numbers than ``FileLimits.table_numbers``.
    """
    if rows * len(names) > LIMITS.table_numbers:
        raise InputError(
            f"{path}: {rows} rows of {len(names)} columns; expected one flight, at most "
            f"{LIMITS.table_numbers} numbers"
        )
    return np.empty((len(names), rows))
