"""The layout of a text table, found from its first lines: separator, decimal comma, lines before
the header, a line of units behind it.

Each separator and each way to write decimals is tried. The right one makes the most numbers of a
line, in the longest run of lines that have as many fields as one another; that run is the table,
and the line of names before it is its header.
"""

import csv
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS
from .column_names import is_unit
from .csv_table import open_csv, text_of
from .parquet_table import open_parquet
from .table import SUFFIXES, Table
from .text_layout import MISSING_WORDS, SEPARATORS, TextLayout, without_mark

# endings of text tables that are read with a map, beside those of the kit's own
TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log")

_PIECE = 2**18  # characters that are looked at
_LINES = 600  # of them; what Betaflight's decoder writes before the header has 150
_FEWEST = 2  # columns of a table
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*([eE][+-]?\d+)?|\.\d+([eE][+-]?\d+)?|nan|inf)", re.I)


@dataclass(frozen=True)
class FoundLayout:
    """A layout, and what is worth saying about it."""

    layout: TextLayout
    units: tuple[str, ...] = ()  # of a line of units behind the header
    words: str = ""  # how it was laid out


def is_parquet(path: Path) -> bool:
    """Return whether a file's name is that of a Parquet table."""
    return path.name.lower().endswith(".parquet")


def is_text_table(path: Path) -> bool:
    """Return whether a file's name may be that of a text table."""
    name = path.name.lower().removesuffix(".gz")
    return name.endswith(TEXT_SUFFIXES)


def stem(path: Path) -> str:
    """Return a table's name without its ending."""
    name = path.name
    for ending in (".gz", ".parquet", *TEXT_SUFFIXES):
        if name.lower().endswith(ending):
            name = name[: -len(ending)]
    return name


def open_any_table(path: Path) -> tuple[Table, FoundLayout]:
    """Open a table of any layout.

    Raises:
        InputError: unreadable, no table, or more than ``FileLimits`` allows.
    """
    if is_parquet(path):
        return open_parquet(path, LIMITS.table_text), FoundLayout(TextLayout())
    if not is_text_table(path):
        raise InputError(
            f"{path}: unknown kind of file; expected a table whose name ends in "
            f"{', '.join(dict.fromkeys((*TEXT_SUFFIXES, *SUFFIXES)))}"
        )
    found = find_layout(path)
    table = open_csv(path, LIMITS.table_text, found.layout)
    if table.rows > LIMITS.table_rows:
        raise InputError(
            f"{path}: {table.rows} rows; expected one flight, at most {LIMITS.table_rows}"
        )
    if table.rows < 1:
        raise InputError(f"{path}: no rows; expected a header and at least one row of numbers")
    return table, found


def find_layout(path: Path) -> FoundLayout:
    """Return how a text table is laid out.

    Raises:
        InputError: unreadable, or no lines that look like a table of numbers.
    """
    lines, encoding = _first_lines(path)
    best: tuple[float, TextLayout, int] | None = None
    for separator in SEPARATORS:
        for decimal in (".", ",") if separator != "," else (".",):
            layout = TextLayout(separator, decimal, encoding=encoding)
            score, start = _score(lines, layout)
            if best is None or score > best[0] + 1e-9:
                best = score, layout, start
    if best is None or best[0] <= 0.0:
        raise InputError(
            f"{path}: no table of numbers in its first {len(lines)} line(s); expected a header "
            "and rows of at least two numbers"
        )
    _, layout, start = best
    return _with_header(path, lines, layout, start)


def _first_lines(path: Path) -> tuple[list[str], str]:
    """Return a text's first lines, and its encoding: UTF-8, or Latin-1 where it is not that."""
    for encoding in ("utf-8-sig", "latin-1"):
        try:
            with text_of(path, encoding) as text:
                piece = text.read(_PIECE)
        except UnicodeDecodeError:
            continue
        break
    if "\0" in piece:
        raise InputError(f"{path}: not a text file (it holds zero bytes); expected a table")
    lines = piece.split("\n")
    whole = lines if len(piece) < _PIECE else lines[:-1]
    if not whole:
        raise InputError(
            f"{path}: its first line has more than {_PIECE} characters; expected a header and "
            "rows of numbers"
        )
    return whole[:_LINES], encoding


def _split(line: str, layout: TextLayout) -> list[str]:
    if layout.separator != " " and '"' in line:
        try:
            return [f.strip() for f in next(csv.reader([line], delimiter=layout.separator))]
        except (csv.Error, StopIteration):
            return []
    return layout.fields(line)


def is_number(field: str, decimal: str = ".") -> bool:
    """Return whether a field is a number as a table writes one."""
    if decimal == ",":
        if "." in field:
            return False
        field = field.replace(",", ".")
    return _NUMBER.fullmatch(field) is not None


def _empty(field: str) -> bool:
    return not field or field.lower() in MISSING_WORDS


def _score(lines: list[str], layout: TextLayout) -> tuple[float, int]:
    """Return how well a layout fits, and the line of the first row of numbers."""
    rows = []
    for i, line in enumerate(lines):
        fields = _split(line, layout)
        numbers = sum(is_number(field, layout.decimal) for field in fields)
        if numbers and numbers + sum(map(_empty, fields)) >= 0.5 * len(fields):
            rows.append((i, len(fields), numbers))
    if not rows:
        return 0.0, 0
    # the later lines decide: before them may stand a program's settings, numbers too
    tail = rows[len(rows) // 4 :]
    width = Counter(n for _, n, _ in tail).most_common(1)[0][0]
    if width < _FEWEST:
        return 0.0, 0
    whole = sum(1 for line in lines[tail[0][0] :] if line.strip())
    most = max(k for _, n, k in tail if n == width)
    start = next(i for i, n, k in rows if n >= 0.8 * width and k >= 0.5 * most)
    return sum(k for _, n, k in tail if n == width) / whole, start


def _with_header(path: Path, lines: list[str], layout: TextLayout, start: int) -> FoundLayout:
    """Return a layout with where its header stands: the nearest line before the first row that has
    a name for nearly every column.

    Raises:
        InputError: the rows have twice as many fields as a line of names before them.
    """
    width = len(_split(lines[start], layout))
    header = None
    for i in range(start - 1, max(-1, start - 6), -1):
        fields = _split(without_mark(lines[i]), layout)
        if fields and not fields[-1]:  # a separator behind the last name
            fields.pop()
        named = [f for f in fields if f and not is_number(f, layout.decimal)]
        if 2 * len(fields) == width and len(named) == len(fields) and i == start - 1:
            raise InputError(
                f"{path}: line {start + 1} has {width} fields, twice as many as the header; "
                "decimal commas between fields that commas separate cannot be told apart: write "
                "the table with semicolons"
            )
        if len(fields) >= width - 1 and len(named) >= 0.8 * len(fields) and len(named) >= 2:
            is_units_line = header is None and sum(map(is_unit, fields)) >= 0.7 * len(fields)
            header = i
            if not is_units_line:
                break
    parts = [f"fields separated by {SEPARATORS[layout.separator]}"]
    if layout.decimal == ",":
        parts.append("decimal commas")
    if header is None:
        made = TextLayout(
            layout.separator, layout.decimal, start, False, 0, encoding=layout.encoding
        )
        return FoundLayout(made, (), ", ".join([*parts, "no header: columns are 1, 2, 3 ..."]))
    between = sum(1 for line in lines[header + 1 : start] if line.strip())
    units = tuple(_split(lines[header + 1], layout)) if between == 1 else ()
    if header:
        parts.append(f"{header} line(s) before the header")
    if between:
        parts.append(f"{between} line(s) between header and rows")
    made = TextLayout(
        layout.separator, layout.decimal, header, True, between, encoding=layout.encoding
    )
    return FoundLayout(made, units, ", ".join(parts))
