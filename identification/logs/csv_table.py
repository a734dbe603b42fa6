"""CSV, packed or not, in two passes: the first counts, the second turns the columns asked for into
numbers. Neither holds more of the text than a piece of it. A table of another layout (separator,
decimal comma, lines before the header) is turned into lines of this one as they pass by.
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
from .table import WHAT, Array, Table, empty_columns, text_row
from .text_layout import TextLayout, without_mark

_CUT_OFF = "the last line was cut off, and left out"
_PIECE = 2**18  # characters read at a time
_BLOCK = 20_000  # lines turned into numbers at a time
_DECIMAL_COMMA = (
    ". Decimal commas between fields that commas separate cannot be told apart: write the table "
    "with semicolons"
)


def open_csv(path: Path, largest: int, layout: TextLayout | None = None) -> Table:
    """Open a CSV or gzipped CSV file of at most ``largest`` characters.

    Args:
        path: the file.
        largest: characters of text that it may have.
        layout: how the table is laid out; None: as the kit writes it.

    Raises:
        InputError: unreadable, no text, empty, or more than ``FileLimits`` allows.
    """
    encoding = layout.encoding if layout else "utf-8-sig"
    count, quoted = _survey(path, largest, encoding)
    if not count:
        raise InputError(f"{path}: empty file; expected a header and at least one row of numbers")

    def all_lines() -> Iterator[str]:
        if layout is None:
            return _lines(path, count, quoted)
        return _laid_out(path, count, quoted, layout)

    header = tuple(name.strip() for name in next(all_lines()).split(","))
    rows, first_line = count - 1, 2
    notes: tuple[str, ...] = ()
    if layout is not None:
        rows, notes = _whole_rows(all_lines(), len(header))
        first_line = layout.before + layout.header + layout.between + 1
    elif quoted:
        rows = sum(1 for _ in all_lines()) - 1
    elif rows > 1 and _cut_off(path, len(header)):
        rows, notes = rows - 1, (_CUT_OFF,)

    def read(names: Sequence[str]) -> dict[str, Array]:
        columns = empty_columns(path, rows, names)
        where = [header.index(name) for name in names]
        lines, done = all_lines(), 0
        next(lines)
        if notes:  # the last is cut off
            lines = islice(lines, rows)
        while block := list(islice(lines, _BLOCK)):
            numbers = _numbers(path, block, (done, first_line), len(header) - 1, names, where)
            if done + len(block) > rows:
                break
            columns[:, done : done + len(block)] = numbers.T
            done += len(block)
        if done != rows:
            raise InputError(f"{path}: changed while it was read; expected a whole file")
        return dict(zip(names, columns, strict=True))

    return Table(path, header, rows, read, first_line, notes)


@contextmanager
def text_of(path: Path, encoding: str = "utf-8-sig") -> Iterator[io.TextIOWrapper]:
    """Give a file's text, unpacked.

    Raises:
        InputError: it cannot be read, or is no text.
    """
    file: BinaryIO = open_regular(path, WHAT)
    if path.name.lower().endswith(".gz"):
        unpacked = Gunzip(file, path, LIMITS.table_text)
        file = cast(BinaryIO, io.BufferedReader(unpacked, _PIECE))
    try:
        with io.TextIOWrapper(file, encoding=encoding) as text:
            yield text
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be read as {WHAT}: {error}") from error


def _survey(path: Path, largest: int, encoding: str) -> tuple[int, bool]:
    """Return how many lines there are up to the last that is not blank, and whether a quotation
    mark is among them.
    """
    size = lines = kept = line = 0  # the last: characters of the line in hand
    quoted = False
    with text_of(path, encoding) as text:
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
    lines = _raw_lines(path, count, "utf-8-sig")
    if not quoted:
        yield from lines
        return
    try:
        for row in csv.reader(lines, strict=True):
            yield ",".join(field.replace(",", " ") for field in row)
    except csv.Error as error:
        raise InputError(f"{path}: not valid CSV: {error}") from error


def _raw_lines(path: Path, count: int, encoding: str) -> Iterator[str]:
    """Yield the first ``count`` lines as they stand."""

    def pieces() -> Iterator[list[str]]:
        with text_of(path, encoding) as text:
            while piece := text.read(_PIECE):
                yield (piece + text.readline()).removesuffix("\n").split("\n")

    return islice(chain.from_iterable(pieces()), count)


def _laid_out(path: Path, count: int, quoted: bool, layout: TextLayout) -> Iterator[str]:
    """Yield the header and the rows of a table of another layout as lines of this kit's: commas
    between fields, decimal points.
    """
    lines = islice(_raw_lines(path, count, layout.encoding), layout.before, None)
    fields: Iterator[list[str]]
    if quoted and layout.separator != " ":
        reader = csv.reader(lines, delimiter=layout.separator, skipinitialspace=True)
        fields = ([field.strip() for field in row] for row in reader)
    else:
        fields = map(layout.fields, lines)
    try:
        if not layout.header:
            first = next(fields)
            fields, names = chain([first], fields), [str(i + 1) for i in range(len(first))]
        elif quoted and layout.separator != " ":
            names = layout.names(next(fields))
        else:
            names = layout.names(layout.fields(without_mark(next(lines))))
        while len(names) > 1 and not names[-1]:  # a separator behind the last name
            names.pop()
        yield ",".join(names)
        for row in islice(fields, layout.between, None):
            if row and any(row):
                yield layout.row(row, len(names))
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{path}: not valid CSV: {error}") from error


def _whole_rows(lines: Iterator[str], width: int) -> tuple[int, tuple[str, ...]]:
    """Return how many rows follow the header, without a last one that was cut off, and a note on
    that.
    """
    next(lines)
    rows, last = 0, ""
    for last in lines:  # noqa: B007 - the last is wanted
        rows += 1
    if rows > 1 and last.count(",") + 1 < width:
        return rows - 1, (_CUT_OFF,)
    return rows, ()


def _cut_off(path: Path, width: int) -> bool:
    """Return whether a file ends within its last line: without an end of the line, and with fewer
    fields than the header. A recording that was killed leaves such a one.
    """
    if path.name.lower().endswith(".gz"):
        return False
    with open_regular(path, WHAT) as file:
        size = file.seek(0, io.SEEK_END)
        file.seek(max(0, size - LIMITS.table_line))
        last = file.read().rpartition(b"\n")[2]
    return bool(last) and last.count(b",") + 1 < width


def _numbers(
    path: Path,
    lines: list[str],
    first: tuple[int, int],
    commas: int,
    names: Sequence[str],
    where: Sequence[int],
) -> Array:
    """Return the numbers (n, len(names)) of lines in the fields ``where``; ``first`` is the row
    that they begin with, and the line of the table's first row.
    """
    for i, line in enumerate(lines):
        if line.count(",") != commas:
            found = line.count(",") + 1
            raise InputError(
                f"{path}: {text_row(first[0] + i, first[1])} has {found} field(s); expected "
                f"{commas + 1}, as many as the header"
                + _DECIMAL_COMMA
                * (found == 2 * (commas + 1))
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
    path: Path,
    lines: Sequence[str],
    first: tuple[int, int],
    names: Sequence[str],
    where: Sequence[int],
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
                row = text_row(first[0] + i, first[1])
                return InputError(
                    f"{path}: column {name}, {row}: {fields[j][:100]!r} is not a number; expected "
                    "a decimal number"
                )
    return InputError(f"{path}: not a table of numbers; expected CSV")
