"""Tables of numbers in files of any kind (``open_table``), and in texts, packed or not, of any
layout: separator, decimal comma, lines before the header, a line of units behind it, lists in
fields, whose items are columns ``name[0]`` ...

The layout is found in the first lines. Each separator and each way to write decimals is tried. The
right layout makes the most numbers of a line, in the longest run of lines with equally many fields.
This run is the table, and the line of names before the run is its header. The rows are then
counted, and the columns asked for are turned into numbers: by the core where fields are plain
numbers, else a block of lines at a time.
"""

import codecs
import csv
import gzip
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import date
from itertools import chain, product, starmap
from math import nan
from pathlib import Path
from statistics import mode
from typing import Any, BinaryIO

import numpy as np

from ... import _core
from ...runtime.errors import InputError
from ...runtime.file_limits import LIMITS, check_count
from ...runtime.regular_files import open_regular
from .column_names import is_unit
from .table import (
    ARRAY_SUFFIXES,
    SUFFIXES,
    TEXT_SUFFIXES,
    WHAT,
    Array,
    Lines,
    Rows,
    Table,
    Texts,
    one_line,
)
from .tables import open_arrays, open_parquet

# people's words for a missing value
MISSING_WORDS = frozenset({"na", "n/a", "null", "none", "nil", "-", "--", "?"})

_SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "white space"}
_LATIN = "windwrench-latin-1"  # name of an error handler
_BUFFER = 2**16  # bytes read or unpacked at a time: within the cache of a core
_BLOCK = 200  # lines turned into numbers at a time; their texts stay in the cache of the processor
_LINES = 600  # lines, at most; Betaflight's decoder writes 150 before the header
_LIST = re.compile(  # between separators: numbers in brackets, or nothing
    r'(?:(?<=[,;\t|])|^) {0,9}"?([\[(](?: {0,9}(?:[-+.]?\d|nan)[-+.,; \w]*)?[\])])"?'
    r" {0,9}(?=[,;\t|]|$)",
    re.IGNORECASE,
)
_MOMENT = re.compile(  # a date with a time of day, or this alone
    r"(?:(\d{4}[-/]\d\d[-/]\d\d)[T ])?(\d\d?):(\d\d):(\d\d(?:\.\d+)?)"
    r"(?:Z|[+-]\d\d:?\d\d)?"
)
_MOTION_CAPTURE = {  # first lines of exports
    "Motive": r"Format Version,.*Take Name,",
    "Vicon Nexus": r"(?s)(Objects|Segments|Trajectories|Model Outputs)\b.*\nFrame,Sub Frame,",
}
_COMMENT = re.compile(r"^\s*(#|%|//)[#%/ ]*")
# decimal commas to points; a point beside them may stand for thousands, and is no number's
_POINTS = str.maketrans(",.", ".?")
_DECIMAL_COMMA = (
    "decimal commas between fields that commas separate cannot be told apart: write the table with "
    "semicolons"
)


def _is_missing(field: str) -> bool:
    return not field or field.lower() in MISSING_WORDS


def _items(field: str) -> Lines:
    """Return the items of a list, between commas, semicolons or spaces."""
    return re.sub(r"[\[\](),;]", " ", field).split()


def _seconds(field: str) -> float | None:
    """Return the seconds since 1970 of a date, or since midnight of a time of day; None where a
    field is neither.
    """
    moment = _MOMENT.fullmatch(field)
    if moment is None:
        return None
    day, *clock = moment.groups("1970-01-01")
    try:
        days = date.fromisoformat(day.replace("/", "-")) - date(1970, 1, 1)
    except ValueError:  # the 31st of February
        return None
    hours, minutes, seconds = map(float, clock)
    return days.total_seconds() + 3600.0 * hours + 60.0 * minutes + seconds


_Lists = tuple[tuple[int, int], ...]  # fields (from 0) of lists, and their lengths


@dataclass(frozen=True)
class _TextLayout:
    """How the lines of a text table are written."""

    separator: str = ","  # " ": any white space
    decimal: str = "."  # or ","
    lists: _Lists = ()

    def fields(self, line: str) -> Lines:
        """Return the fields of a line without the space around them, as ``split``."""
        return list(map(str.strip, self.split(line)))

    def split(self, line: str) -> Lines:
        """Return the fields of a line, an item of a list each; empty for quotation marks against
        CSV.
        """
        if self.separator == " ":
            return line.split()
        if self.lists:
            line = _LIST.sub(r'"\1"', line)
        if '"' not in line:
            fields = line.split(self.separator)
        else:
            rows = csv.reader([line], delimiter=self.separator, skipinitialspace=True, strict=True)
            try:
                fields = next(rows)
            except csv.Error:
                return []
        for i, count in reversed(self.lists):  # as many empty fields as an empty list has items
            if i < len(fields):
                fields[i : i + 1] = _items(fields[i]) or [""] * count
        return fields

    def names(self, line: str) -> Lines:
        """Return the columns' names of a header; a separator behind the last name, and the mark of
        a comment before the first, belong to none.
        """
        names = [name.strip('" ') for name in self.fields(_COMMENT.sub("", line))]
        while len(names) > 1 and not names[-1]:
            names.pop()
        return names

    def number(self, field: str) -> float | None:
        """Return the number in a field, or the seconds of a date or a time of day; NaN: empty,
        None: something else.
        """
        if _is_missing(field):
            return nan
        if self.decimal == ",":
            field = field.translate(_POINTS)
        try:
            return float(field.replace("_", "?"))  # Python's numbers may hold underscores
        except ValueError:
            return _seconds(field) if ":" in field else None

    def is_blank(self, line: str) -> bool:
        """Return whether all fields of a line are empty."""
        return not line.strip().strip(f'{self.separator} "')


def is_table(path: Path) -> bool:
    """Return whether a file has a table's name: arrays, or a text, packed or not."""
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
    name = path.name.lower()
    if name.endswith(ARRAY_SUFFIXES):
        return open_arrays(path)
    if name.endswith(".parquet"):
        return open_parquet(path)
    if is_table(path):
        return _open_text(path)
    raise InputError(
        f"{path}: unknown kind of file; expected a table whose name ends in "
        f"{', '.join(dict.fromkeys((*TEXT_SUFFIXES, *SUFFIXES, *ARRAY_SUFFIXES)))}"
    )


def _open_text(path: Path) -> Table:
    """Open a text table.

    Raises:
        InputError: unreadable, no text, no table, or more than ``FileLimits`` allows.
    """
    written: Lines = []
    for line in chain.from_iterable(map(_text_lines, _blocks(path))):
        written.append(line)
        if len(written) == _LINES or sum(map(len, written)) > 2**18:
            break
    for program, beginning in _MOTION_CAPTURE.items():
        if re.match(beginning, "\n".join(written[:8])):
            raise InputError(
                f"{path}: an export of {program}: motion capture alone, without motors; expected "
                "the poses and the rotor speeds of the autopilot's log in one table"
            )
    head = [_LIST.sub("0", line) for line in written]
    layout, first = _layout(path, head)
    header, first = _header(path, head, layout, first)
    layout = replace(layout, lists=_lists(layout, written[first:]))
    between = [] if header is None else list(filter(str.strip, head[header + 1 : first]))
    said = {
        f"fields separated by {_SEPARATORS[layout.separator]}": True,
        "decimal commas": layout.decimal == ",",
        "no header: columns are 1, 2, 3 ...": header is None,
        f"{header} line(s) before the header": header,
        f"{len(between)} line(s) between header and rows": between,
    }
    if header is None:
        names = [str(i + 1) for i in range(len(layout.fields(head[first])))]
    else:
        names = layout.names(head[header])
    for i, count in reversed(layout.lists):
        names[i : i + 1] = [f"{names[i]}[{k}]" for k in range(count)]
    layout_note = f"layout: {', '.join(words for words, applies in said.items() if applies)}"
    notes = [] if layout_note == "layout: fields separated by comma" else [layout_note]

    blank: list[int] = []
    last = 0, ""  # rows up to the last line that the core does not read, and the line

    def note(lines: Texts, row: int) -> int:
        nonlocal last
        for line in lines:
            if layout.is_blank(line):
                blank.append(row)
            else:
                row, last = row + 1, (row + 1, line)
        return row

    none = np.empty((0, LIMITS.table_rows + _LINES))
    rows = _walk(path, layout, first, np.full(len(names), -1), none, note)
    if rows > 1 and last[0] == rows and len(layout.fields(last[1])) < len(names):
        rows -= 1
        notes.append("the last line was cut off, and left out")

    def load(table: Table, wanted: Texts) -> Array:
        columns = np.empty((len(wanted), rows))
        slots = np.array([wanted.index(name) if name in wanted else -1 for name in names])

        def fill(lines: Texts, row: int) -> int:
            lines = [line for line in lines if not layout.is_blank(line)][: rows - row]
            if lines:
                _fill(table, layout, lines, row, wanted, columns[:, row : row + len(lines)])
            return row + len(lines)

        if _walk(path, layout, first, slots, columns, fill) != rows:
            raise InputError(f"{path}: changed while it was read; expected a whole file")
        return columns

    units = tuple(layout.fields(between[0])) if len(between) == 1 and not layout.lists else ()
    seen = [fields for fields in map(layout.fields, written[first:]) if len(fields) >= len(names)]
    numeric = tuple(
        name
        for name, fields in zip(names, zip(*seen, strict=False), strict=False)
        if None not in map(layout.number, fields)
    )
    return Table(
        path, tuple(names), rows, load, first + 1, tuple(blank), units, tuple(notes), numeric
    )


def _lists(layout: _TextLayout, lines: Texts) -> _Lists:
    """Return the fields (from 0) of lists, and the length of each field's first list with items."""
    lengths: dict[int, int] = {}
    for line in lines if layout.separator != " " else ():
        for i, field in enumerate(layout.fields(_LIST.sub(r'"\1"', line))):
            if field.startswith(("[", "(")) and (count := len(_items(field))):
                lengths.setdefault(i, count)
    return tuple(sorted(lengths.items()))


def _latin(error: UnicodeError) -> tuple[str, int]:
    """Return bytes outside UTF-8 as the Latin-1 of old programs."""
    assert isinstance(error, UnicodeDecodeError)
    return error.object[error.start : error.end].decode("latin-1"), error.end


codecs.register_error(_LATIN, _latin)


@dataclass
class _Packed:
    """The bytes of a gzip file; no more are read than characters were unpacked: a million empty
    parts would take as long as a table.
    """

    file: BinaryIO
    path: Path
    size: int = 0
    unpacked: int = 0  # characters so far

    def read(self, size: int) -> bytes:
        """Return the next bytes.

        Raises:
            InputError: they are more than they unpack to.
        """
        piece = self.file.read(size)
        self.size += len(piece)
        if self.size > self.unpacked + 2**21:  # packed bytes without a line yet
            raise InputError(
                f"{self.path}: {self.size} packed bytes unpack to {self.unpacked}; expected a "
                "packed table"
            )
        return piece


def _blocks(path: Path) -> Iterator[bytes]:
    """Yield a text in blocks of whole lines, unpacked, with one kind of line end.

    Raises:
        InputError: unreadable, no text, or more than ``FileLimits`` allows; everything is counted
            as it comes.
    """
    size, number, rest = 0, 0, b""
    with one_line(f"{path}: cannot be read as {WHAT}"), open_regular(path, WHAT) as file:
        packed: Any = _Packed(file, path)
        source = gzip.GzipFile(fileobj=packed) if path.name.lower().endswith(".gz") else file
        while piece := source.read(_BUFFER):
            piece += source.read(1) if piece.endswith(b"\r") else b""
            piece = piece.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            if b"\0" in piece:
                raise InputError(f"{path}: not a text file (it holds zero bytes); expected CSV")
            block = rest + (piece if size else piece.removeprefix(codecs.BOM_UTF8))
            size += len(piece)
            packed.unpacked = size
            check_count(path, size, LIMITS.table_text, "characters of text")
            length = block.find(b"\n") if b"\n" in piece else len(block)
            check_count(path, length, LIMITS.table_line, f"in line {number + 1}")
            number += piece.count(b"\n")
            check_count(path, number - _LINES, LIMITS.table_rows, "rows")
            end = block.rfind(b"\n") + 1
            rest = block[end:]
            yield block[:end]
        yield rest


def _text_lines(block: bytes) -> Lines:
    """Return the lines of a block, without their ends."""
    return block.decode("utf-8", _LATIN).removesuffix("\n").split("\n") if block else []


def _walk(
    path: Path,
    layout: _TextLayout,
    first: int,
    slots: Rows,
    columns: Array,
    other: Callable[[Texts, int], int],
) -> int:
    """Read the rows of a text from line ``first``, counted from 0, on; return their number.

    Args:
        path: the text.
        layout: of its lines.
        first: the line of the first row.
        slots: (F,) of each field, the line of ``columns`` for its numbers; -1: none.
        columns: (K, N) to fill.
        other: reads lines of other fields than plain numbers, from a row on; returns the next row.
    """
    row = 0
    is_plain = layout.separator != " " and layout.decimal == "." and not layout.lists
    for block in _blocks(path):
        at = 0
        while first and at < len(block):
            first, at = first - 1, block.find(b"\n", at) + 1 or len(block)
        while at < len(block):
            if is_plain:
                count, used = _core.read_text_rows(block, at, layout.separator, slots, columns, row)
                row, at = row + count, at + used
            end = at
            for _ in range(_BLOCK):
                end = block.find(b"\n", end) + 1 or len(block)
            row = other(_text_lines(block[at:end]), row)
            at = end
    return row


def _layout(path: Path, head: Lines) -> tuple[_TextLayout, int]:
    """Return the layout with the most numbers in the first lines, and the line (from 0) of the
    first row full of numbers.

    Raises:
        InputError: none makes a table of them.
    """
    there = {" ", *"".join(head)}
    scores = [
        (*_score(head, layout), layout)
        for layout in starmap(_TextLayout, product(_SEPARATORS, ".,"))
        if layout.separator in there and layout.decimal in {".", *there - {layout.separator}}
    ]
    best, first, layout = max(scores, key=lambda score: round(score[0], 9))
    if best:
        return layout, first
    if not any(head):
        raise InputError(f"{path}: empty file; expected a header and at least one row of numbers")
    raise InputError(
        f"{path}: no table of numbers in its first {len(head)} line(s); expected a header and rows "
        "of at least two numbers"
    )


def _score(head: Lines, layout: _TextLayout) -> tuple[float, int]:
    """Return how many numbers a line has in a layout, and the line of the first row of them."""
    rows = []
    for i, line in enumerate(head):
        fields = layout.fields(line)
        empty, numbers = _counts(layout, fields)
        if numbers and empty + numbers >= 0.5 * len(fields):
            rows.append((i, len(fields), numbers))
    # the later lines decide: before them may stand a program's settings, numbers too
    tail = rows[len(rows) // 4 :]
    width = mode([n for _, n, _ in tail] or [0])
    if width < 2:
        return 0.0, 0
    whole = sum(bool(line.strip()) for line in head[tail[0][0] :])
    counts = [k for _, n, k in tail if n == width]
    start = next(i for i, n, k in rows if n >= 0.8 * width and k >= 0.5 * max(counts))
    return sum(counts) / whole, start


def _counts(layout: _TextLayout, fields: Texts) -> tuple[int, int]:
    """Return how many fields are empty, and how many hold a number (``nan`` among them)."""
    empty = sum(map(_is_missing, fields))
    return empty, sum(number is not None for number in map(layout.number, fields)) - empty


def _header(path: Path, head: Lines, layout: _TextLayout, full: int) -> tuple[int | None, int]:
    """Return the lines (from 0) of the header, if any, and of the first row.

    The header is the nearest line before the first row with a name for nearly every column. Rows
    before the first ``full`` one have empty fields.

    Raises:
        InputError: the rows have up to twice as many fields as a line of names before them.
    """
    width = len(layout.fields(head[full]))
    header, first = None, full
    for i in range(full - 1, -1, -1):
        fields = layout.names(head[i])
        count = len(fields)
        empty, numbers = _counts(layout, fields)
        named = count - empty - numbers
        if 3 * count < 2 * width <= 4 * count and named == count and i == first - 1:
            raise InputError(
                f"{path}: line {first + 1} has {width} fields, the header {count}; {_DECIMAL_COMMA}"
            )
        if count >= width - 1 and named >= max(2, 0.8 * count):
            is_units_line = header is None and sum(map(is_unit, fields)) >= 0.7 * count
            header = i
            if not is_units_line:
                break
        elif header is None and numbers and 2 * named <= len(layout.fields(head[i])) == width:
            first = i
        elif first - i > 5:
            break
    return header, first


def _fill(
    table: Table,
    layout: _TextLayout,
    lines: Texts,
    first: int,
    wanted: Texts,
    out: Array,
) -> None:
    """Put the numbers in the columns ``wanted`` of rows into ``out`` (len(wanted), n).

    Raises:
        InputError: a field holds something else, or a row has more or fewer fields than the header.
    """
    width = len(table.header)
    rows = [layout.split(line) for line in lines]
    for i, fields in enumerate(rows):
        if len(fields) == width + 1 and not fields[-1].strip():  # a separator behind the last
            fields.pop()
        if (count := len(fields)) != width:
            hint = f". {_DECIMAL_COMMA.capitalize()}" if count == 2 * width else ""
            raise InputError(
                f"{table.path}: {table.row(first + i)} has {count} field(s); expected {width}, as "
                f"many as the header{hint}"
            )
    is_plain = "_" not in "".join(lines)  # Python's numbers may hold underscores
    columns = dict(zip(table.header, zip(*rows, strict=True), strict=True))
    for column, values in zip(wanted, out, strict=True):
        texts: Texts = columns[column]
        if layout.decimal == ",":
            texts = "\n".join(texts).translate(_POINTS).split("\n")
        with suppress(ValueError):
            if is_plain:  # Python's own numbers are quick
                values[:] = [float(text or "nan") for text in texts]
                continue
        texts = [text.strip() for text in columns[column]]
        numbers = list(map(layout.number, texts))
        if None in numbers:
            i = numbers.index(None)
            raise InputError(
                f"{table.path}: column {column}, {table.row(first + i)}: "
                f"{texts[i][:100]!r} is not a number; expected a decimal number"
            )
        values[:] = numbers
