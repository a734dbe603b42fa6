"""A table of numbers in a file: its columns by name, and where a row stands."""

from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS, check_count

Array = NDArray[np.float64]
SomeArray = Array | None
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]
Names = tuple[str, ...]  # of columns, logs or effects; sentences
Pair = tuple[float, float]  # low and high, or a value and its standard deviation
Values = Mapping[str, float]  # numbers by name
NamedArrays = dict[str, Array]
ArrayMap = Mapping[str, Array]
NamedNumbers = dict[str, float]
ArrayPair = tuple[Array, Array]
NamedTexts = dict[str, str]
Data = dict[str, Any]  # plain values by name
Texts = Sequence[str]
Lines = list[str]
Wanted = Collection[str]  # names of columns, or of topics
Piece = int | None  # of a file, from 1; None: the longest
_T = TypeVar("_T")
Noted = tuple[_T, Lines]  # with notes

WHAT = "a flight log"  # for errors
SUFFIXES = (".csv", ".csv.gz", ".parquet")  # of the kit's own tables
TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log")  # of text tables, packed or not
ARRAY_SUFFIXES = (".mat", ".npz")


@dataclass(frozen=True)
class Table:
    """A file of named columns, turned into numbers on demand, once.

    Raises:
        InputError: the file has no rows, or more than ``FileLimits.table_rows``.
    """

    path: Path
    header: Names
    rows: int
    load: Callable[["Table", Texts], Iterable[Array]]  # gives columns (rows,) by names
    first_line: int = 0  # line of the first row in a text; 0: rows have no lines
    blank_before: tuple[int, ...] = ()  # a row for each blank line before it, in their order
    units: Names = ()  # of a line of units behind the header
    notes: Names = ()  # on layout and omissions
    numeric: Names = ()  # columns of numbers in the first rows; empty: all
    _columns: NamedArrays = field(default_factory=dict, repr=False)  # read so far

    def __post_init__(self) -> None:
        check_count(self.path, self.rows, LIMITS.table_rows, "rows")
        if self.rows < 1:
            raise InputError(
                f"{self.path}: no rows; expected a header and at least one row of numbers"
            )

    def read(self, names: Texts) -> NamedArrays:
        """Return columns (rows,) by their names, read-only; empty fields are NaN.

        Raises:
            InputError: a field is no number; a name stands in the header more than once; the
                numbers are more than ``FileLimits.table_numbers``.
        """
        columns = self._columns
        for name in names:
            if self.header.count(name) > 1:
                raise InputError(
                    f"{self.path}: column {name} stands there more than once; expected it once"
                )
        new = [name for name in dict.fromkeys(names) if name not in columns]
        numbers = self.rows * (len(columns) + len(new))
        check_count(self.path, numbers, LIMITS.table_numbers, "numbers")
        for name, column in zip(new, self.load(self, new) if new else (), strict=True):
            columns[name] = np.asarray(column, float).view()
            columns[name].flags.writeable = False
        return {name: columns[name] for name in names}

    def forget(self) -> None:
        """Forget the columns read so far; they are read anew on demand."""
        self._columns.clear()

    def row(self, index: int) -> str:
        """Return how to find a row (counted from 0) in the file: rows and lines count from 1."""
        if not self.first_line:
            return f"row {index + 1}"
        line = self.first_line + index + bisect_right(self.blank_before, index)
        return f"row {index + 1} (line {line})"


def finite_rows(values: Array) -> Mask:
    """Return the rows (N,) of values (N, k) with finite numbers alone."""
    return np.asarray(np.isfinite(values).all(axis=1))


def lengths(vectors: Array) -> Array:
    """Return the lengths (N,) of vectors (N, k)."""
    return np.asarray(np.linalg.norm(vectors, axis=1))


def median_step(t: Array) -> float:
    """Return the median step of times (N,), s."""
    return float(np.median(np.diff(t)))


@contextmanager
def one_line(what: str, expected: str = "") -> Iterator[None]:
    """Turn a parser's exception at foreign bytes into an InputError of one line.

    Args:
        what: cannot be read, for the error.
        expected: in its place; empty: not said.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        words = f"{what}: {' '.join(str(error).split()) or type(error).__name__}"
        raise InputError(f"{words}; expected {expected}" if expected else words) from error


def file_kind(path: Path) -> str:
    """Return the suffix, of ``SUFFIXES``, of a file to be written.

    Raises:
        InputError: none of them.
    """
    for suffix in SUFFIXES:
        if path.name.lower().endswith(suffix):
            return suffix
    raise InputError(
        f"{path}: unknown kind of file; expected a name that ends in {', '.join(SUFFIXES)}"
    )


def stem(path: Path) -> str:
    """Return a file's name without its ending, and without ``.gz`` behind the ending."""
    return Path(path.name.removesuffix(".gz")).stem
