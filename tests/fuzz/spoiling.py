"""How files are spoiled, as hypothesis strategies: bytes, cells, rows, columns, words and lines."""

import re

from hypothesis import strategies as st

NUMBERS = ("nan", "inf", "-inf", "1e999", "-1e308", "1e308", "1e-320", "0", "-0.0", "-1", "1", "2")
LARGE = ("1e9", "-1e9", "1e18", "18446744073709551616", "9" * 400)
NEARLY_NUMBERS = ("0x10", "1_000", "1,5", "1;5", "1e", "--1", "٣", "\ufeff1", "=1+1", "1:61")
WORDS = ("", " ", "\t", "None", "null", "true", "yes", "abc", "x" * 5000, "ünïcode", "\udcff")
QUOTES = ("'", '"', '"1', "[]", "{}", "[1, 2]", "{a: 1}", "~", "&a [*a]", "*a", "? ", "- ")
OBJECTS = ("!!python/object/apply:os.system ['exit 3']", "!!python/name:os.system")
YAML = ("!!binary aaaa", "!!timestamp 0000-00-00", "2024-02-30", "%YAML 9.9")
PATHS = ("../../etc/passwd", "$HOME", "rotor_dragg")
TOKENS = (*NUMBERS, *LARGE, *NEARLY_NUMBERS, *WORDS, *QUOTES, *OBJECTS, *YAML, *PATHS)
LAUGHS = "\n".join(
    [
        "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]",
        *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)),
        "mass: *a11",
    ]
)
LINES = (LAUGHS, "[" * 3000, "- " * 500, "a: &x {b: *x}", "<<: *a")
ABSURD_COUNTS = (0, 1, 10**9, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1)
tokens = st.sampled_from(TOKENS)


def places(things):
    """Return a strategy for the index of one of some things, 0 where there are none."""
    return st.integers(0, max(len(things) - 1, 0))


@st.composite
def spoiled_bytes(draw, data):
    """Put other bytes in a stretch's place or before it, or lose all that follows."""
    start = draw(places(data))
    stop = min(start + draw(st.sampled_from((0, 1, 4, 16, 256, 4096))), len(data))
    stretch = data[start:stop]
    other = draw(places(data))
    filled = st.sampled_from((b"\x00", b"\xff", b"\x7f")).map(lambda byte: byte * len(stretch))
    count = st.sampled_from(ABSURD_COUNTS).map(lambda number: number.to_bytes(8, "little"))
    copied = st.sampled_from((b"", 2 * stretch, 50 * stretch, data[other : other + len(stretch)]))
    put = draw(st.one_of(st.binary(max_size=64), filled, count, copied))
    return data[:start] + put + draw(st.sampled_from((data[stop:], data[start:], b"")))


@st.composite
def spoiled_table(draw, data):
    """Spoil cells, a row, a column or the line ends of CSV text."""
    rows = [line.split(",") for line in data.decode("utf-8", "surrogateescape").split("\n")]
    row = draw(places(rows))
    other = draw(places(rows))
    column = draw(places(rows[row]))
    end = "\n"
    how = draw(st.sampled_from(("cells", "row", "exchange", "column", "scale", "cut", "ends")))
    if how == "cells":
        for at in draw(st.lists(places(rows[row]), min_size=1, max_size=4)):
            rows[row][at] = draw(tokens)
    elif how == "row":
        rows[row : row + 1] = draw(st.sampled_from(([], [rows[other], rows[row]])))
    elif how == "exchange":
        rows[row], rows[other] = rows[other], rows[row]
    elif how == "column":  # the column goes, or holds one token below its name
        token = draw(st.none() | tokens)
        for cells in rows[0 if token is None else 1 :]:
            cells[column : column + 1] = [] if token is None else [token]
    elif how == "scale":  # the column has another unit
        factor = draw(st.sampled_from((1000.0, -1.0, 1e-3, 1e9, 1e150, 0.0)))
        for cells in rows[1:]:
            if column < len(cells) and re.fullmatch(r"[-+.\de]+", cells[column]):
                cells[column] = repr(float(cells[column]) * factor)
    elif how == "cut":
        rows = rows[: draw(st.sampled_from((0, 1, 2, 3, row + 1)))]
    else:
        end = draw(st.sampled_from(("\r\n", "\r", ";", "\x00\n")))
    return end.join(",".join(cells) for cells in rows).encode("utf-8", "surrogateescape")


@st.composite
def spoiled_text(draw, data):
    """Spoil words, a line or an indent of text: YAML, JSON, a setting of an effect, a name."""
    text = data.decode("utf-8", "surrogateescape")
    lines = text.split("\n")
    how = draw(st.sampled_from(("words", "insert", "line", "cut")))
    row = draw(places(lines))
    if how == "words":
        words = list(re.finditer(r"[^\s,:\[\]{}]+", text))
        chosen = draw(st.sets(places(words), min_size=1, max_size=4)) if words else ()
        for word in sorted((words[i] for i in chosen), key=re.Match.start, reverse=True):
            text = text[: word.start()] + draw(tokens) + text[word.end() :]
    elif how == "insert":
        place = draw(places(text))
        text = text[:place] + draw(tokens) + text[place:]
    elif how == "line":
        line = lines[row]
        put = (" " + line, 4 * " " + line, f"{line}\n{line}", *(f"{x}\n{line}" for x in LINES))
        lines[row] = draw(st.sampled_from(("", *put)))
        text = "\n".join(lines)
    else:
        text = "\n".join(lines[:row])
    return text.encode("utf-8", "surrogatepass")
