"""CSV, packed or not, in two passes: the first counts, the second turns the columns asked for into
numbers. Neither holds more of the text than a piece of it.
"""

import csv
import io
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain, islice
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS
from ...runtime.gunzipping import Gunzip
from ...runtime.regular_files import open_regular
from .table import WHAT, Array, Table, empty_columns, file_kind, text_row

_PIECE = 2**18  # characters read at a time
_BLOCK = 20_000  # lines turned into numbers at a time


def open_csv(path: Path, largest: int) -> Table:
    """Open a CSV or gzipped CSV file of at most ``largest`` characters.

    Raises:
        InputError: unreadable, no text, empty, or more than ``FileLimits`` allows.
    """
    count, quoted = _survey(path, largest)
    if not count:
        raise InputError(f"{path}: empty file; expected a header and at least one row of numbers")
    header = tuple(name.strip() for name in next(_lines(path, count, quoted)).split(","))
    rows = (sum(1 for _ in _lines(path, count, quoted)) if quoted else count) - 1

    def read(names: Sequence[str]) -> dict[str, Array]:
        columns = empty_columns(path, rows, names)
        where = [header.index(name) for name in names]
        lines, done = _lines(path, count, quoted), 0
        next(lines)
        while block := list(islice(lines, _BLOCK)):
            numbers = _numbers(path, block, done, len(header) - 1, names, where)
            if done + len(block) > rows:
                break
            columns[:, done : done + len(block)] = numbers.T
            done += len(block)
        if done != rows:
            raise InputError(f"{path}: changed while it was read; expected a whole file")
        return dict(zip(names, columns, strict=True))

    return Table(path, header, rows, read)


@contextmanager
def _text(path: Path) -> Iterator[io.TextIOWrapper]:
    """Give a file's text, unpacked.

    Raises:
        InputError: it cannot be read, or is no text.
    """
    file: BinaryIO = open_regular(path, WHAT)
    if file_kind(path) == ".csv.gz":
        unpacked = Gunzip(file, path, LIMITS.table_text)
        file = cast(BinaryIO, io.BufferedReader(unpacked, _PIECE))
    try:
        with io.TextIOWrapper(file, encoding="utf-8-sig") as text:
            yield text
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read as {WHAT}: {error}") from error


def _survey(path: Path, largest: int) -> tuple[int, bool]:
    """Return how many lines there are up to the last that is not blank, and whether a quotation
    mark is among them.
    """
    size = lines = kept = line = 0  # the last: characters of the line in hand
    quoted = False
    with _text(path) as text:
        try:
            while piece := text.read(_PIECE):
                size += len(piece)
                if size > largest:
                    raise InputError(
                        f"{path}: more than {largest} characters of text; expected one flight"
                    )
                if "\0" in piece:
                    raise InputError(f"{path}: not a text file (it holds zero bytes); expected CSV")
                first, last = piece.find("\n"), piece.rfind("\n")
                line += len(piece) if first < 0 else first
                if line > LIMITS.table_line:
                    raise InputError(
                        f"{path}: more than {LIMITS.table_line} in line {lines + 1}; expected one "
                        f"flight"
                    )
                if first >= 0:
                    line = len(piece) - 1 - last
                if content := piece.rstrip():
                    kept = lines + content.count("\n") + 1
                lines += piece.count("\n")
                if lines > LIMITS.table_rows + 1:
                    raise InputError(
                        f"{path}: more than {LIMITS.table_rows} rows; expected one flight"
                    )
                quoted = quoted or '"' in piece
        except UnicodeDecodeError as error:
            behind = lines + error.object[: error.start].count(b"\n")
            raise InputError(
                f"{path}: not a text file (behind line {behind} it is not UTF-8); expected CSV"
            ) from error
    return kept, quoted


def _lines(path: Path, count: int, quoted: bool) -> Iterator[str]:
    """Yield the first ``count`` lines, without quotation marks and with no commas but those between
    fields.
    """

    def pieces() -> Iterator[list[str]]:
        with _text(path) as text:
            while piece := text.read(_PIECE):
                yield (piece + text.readline()).removesuffix("\n").split("\n")

    lines = islice(chain.from_iterable(pieces()), count)
    if not quoted:
        yield from lines
        return
    try:
        for row in csv.reader(lines, strict=True):
            yield ",".join(field.replace(",", " ") for field in row)
    except csv.Error as error:
        raise InputError(f"{path}: not valid CSV: {error}") from error


def _numbers(
    path: Path,
    lines: list[str],
    first: int,
    commas: int,
    names: Sequence[str],
    where: Sequence[int],
) -> Array:
    """Return the numbers (n, len(names)) of lines, the first of which is row ``first``, in the
    fields ``where``.
    """
    for i, line in enumerate(lines):
        if line.count(",") != commas:
            raise InputError(
                f"{path}: {text_row(first + i)} has {line.count(',') + 1} field(s); expected "
                f"{commas + 1}, as many as the header"
            )
    # the fast parser knows no empty field; two passes, because neighbours share a comma
    filled = lines
    if any(",," in line or line[:1] == "," or line[-1:] == "," for line in lines):
        filled = [f",{line},".replace(",,", ",nan,").replace(",,", ",nan,")[1:-1] for line in lines]
    try:
        values = np.loadtxt(filled, delimiter=",", comments=None, usecols=where, ndmin=2)
    except ValueError as error:
        raise _bad_number(path, filled, first, names, where) from error
    if len(values) != len(lines):
        raise _bad_number(path, filled, first, names, where)
    return values


def _bad_number(
    path: Path, lines: Sequence[str], first: int, names: Sequence[str], where: Sequence[int]
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
                    f"{path}: column {name}, {text_row(first + i)}: {fields[j][:100]!r} is not a "
                    f"number; expected a decimal number"
                )
    return InputError(f"{path}: not a table of numbers; expected CSV")
