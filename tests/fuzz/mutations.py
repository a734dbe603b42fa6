"""Spoiling an input in the ways in which files are spoiled: bytes, fields, rows, columns, and what
attackers write.
"""

import random
import re
from collections.abc import Callable

# what a field may hold that a program did not think of
TOKENS = (
    "",
    " ",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "1e999",
    "-1e308",
    "1e308",
    "1e-320",
    "0",
    "-0.0",
    "-1",
    "1",
    "2",
    "1e9",
    "-1e9",
    "1e18",
    "18446744073709551616",
    "0x10",
    "1_000",
    "1,5",
    "1;5",
    "1e",
    "--1",
    "٣",
    "None",
    "null",
    "true",
    "yes",
    "abc",
    "'",
    '"',
    '"1',
    "[]",
    "{}",
    "[1, 2]",
    "{a: 1}",
    "~",
    "9" * 400,
    "x" * 5000,
    "\t",
    "=1+1",
    "2024-02-30",
    "1:61",
    "\ufeff1",
    "!!python/object/apply:os.system ['exit 3']",
    "!!python/name:os.system",
    "!!binary aaaa",
    "!!timestamp 0000-00-00",
    "&a [*a]",
    "*a",
    "? ",
    "- ",
    "%YAML 9.9",
    "../../etc/passwd",
    "$HOME",
    "rotor_dragg",
    "\udcff",
    "ünïcode",
)
LAUGHS = "\n".join(
    [
        "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]",
        *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)),
        "mass: *a11",
    ]
)
_WORD = re.compile(r"[^\s,:\[\]{}]+")


def spoil_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return bytes with one stretch flipped, overwritten, cut, doubled, moved or filled."""
    if not data:
        return rng.randbytes(rng.randint(0, 64))
    out = bytearray(data)
    start = rng.randrange(len(out))
    length = min(rng.choice((1, 1, 2, 4, 8, 16, 64, 256, 4096)), len(out) - start)
    how = rng.randrange(9)
    if how == 0:
        out[start] ^= 1 << rng.randrange(8)
    elif how == 1:
        out[start : start + length] = rng.randbytes(length)
    elif how == 2:
        del out[start : start + length]
    elif how == 3:
        del out[start:]
    elif how == 4:
        out[start:start] = out[start : start + length] * rng.choice((1, 2, 50))
    elif how == 5:
        out[start : start + length] = rng.choice((b"\x00", b"\xff", b"\x7f", b"\x80")) * length
    elif how == 6:
        out[start:start] = rng.randbytes(length)
    elif how == 7:  # a length or a count that claims something absurd
        number = rng.choice((0, 1, 10**9, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1))
        width = rng.choice((2, 4, 8))
        out[start : start + width] = (number % 256**width).to_bytes(width, "little")
    else:
        other = rng.randrange(len(out))
        out[start : start + length] = out[other : other + length]
    return bytes(out)


def spoil_table(data: bytes, rng: random.Random) -> bytes:
    """Return CSV text with a field, a row, a column or a line end changed."""
    lines = data.decode("utf-8", "surrogateescape").split("\n")
    row = rng.randrange(len(lines))
    fields = lines[row].split(",")
    column = rng.randrange(len(fields))
    how = rng.randrange(12)
    if how < 5:
        for _ in range(rng.choice((1, 1, 3, len(fields)))):
            fields[rng.randrange(len(fields))] = rng.choice(TOKENS)
        lines[row] = ",".join(fields)
    elif how == 5:
        del lines[row]
    elif how == 6:
        lines.insert(row, lines[rng.randrange(len(lines))])
    elif how == 7:
        other = rng.randrange(len(lines))
        lines[row], lines[other] = lines[other], lines[row]
    elif how == 8:  # a column goes, or holds one thing throughout
        token = rng.choice((None, *TOKENS))
        for i, line in enumerate(lines):
            parts = line.split(",")
            if len(parts) > column and (i > 0 or token is None):
                parts[column : column + 1] = [] if token is None else [token]
                lines[i] = ",".join(parts)
    elif how == 9:  # a column in other units, or from another flight
        factor = rng.choice((1000.0, -1.0, 1e-3, 1e9, 1e150, 0.0))
        for i, line in enumerate(lines[1:], 1):
            parts = line.split(",")
            try:
                parts[column] = repr(float(parts[column]) * factor)
            except (ValueError, IndexError):
                continue
            lines[i] = ",".join(parts)
    elif how == 10:
        lines = lines[: rng.choice((0, 1, 2, 3, row + 1))]
    else:
        return rng.choice((b"\r\n", b"\r", b";", b"\x00\n")).join(
            line.encode("utf-8", "surrogateescape") for line in lines
        )
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def spoil_text(data: bytes, rng: random.Random) -> bytes:
    """Return text (YAML, a setting of an effect, a name) with words, lines or indents changed."""
    text = data.decode("utf-8", "surrogateescape")
    lines = text.split("\n")
    row = rng.randrange(len(lines))
    how = rng.randrange(10)
    if how < 5:
        words = list(_WORD.finditer(text))
        if words:
            for word in sorted(
                rng.sample(words, min(len(words), rng.choice((1, 1, 2, 4)))),
                key=lambda w: -w.start(),
            ):
                text = text[: word.start()] + rng.choice(TOKENS) + text[word.end() :]
        return text.encode("utf-8", "surrogatepass")
    if how == 5:
        del lines[row]
    elif how == 6:
        lines.insert(
            row, rng.choice((*lines, LAUGHS, "[" * 3000, "- " * 500, "a: &x {b: *x}", "<<: *a"))
        )
    elif how == 7:
        lines[row] = " " * rng.randrange(5) + lines[row]
    elif how == 8:
        lines = lines[:row]
    else:
        place = rng.randrange(len(text) + 1)
        return (text[:place] + rng.choice(TOKENS) + text[place:]).encode("utf-8", "surrogatepass")
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def spoil(
    data: bytes, ways: tuple[Callable[[bytes, random.Random], bytes], ...], rng: random.Random
) -> bytes:
    """Return an input spoiled one to three times, each time in one of the ``ways``."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        data = rng.choice(ways)(data, rng) or b" "
    return data
