"""How a text table is laid out: what separates its fields, how decimals are written, where the
header stands.
"""

from dataclasses import dataclass

# what people write for a value that is not there
MISSING_WORDS = frozenset({"na", "n/a", "null", "none", "nil", "-", "--", "?"})

SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "white space"}


@dataclass(frozen=True)
class TextLayout:
    """The layout of one text table."""

    separator: str = ","  # " ": any white space
    decimal: str = "."  # or ","
    before: int = 0  # lines before the header: comments, what a program says of itself
    header: bool = True  # False: there is none, and columns are named 1, 2, 3 ...
    between: int = 0  # lines between header and first row, such as one of units
    encoding: str = "utf-8-sig"

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line, without the space around them."""
        if self.separator == " ":
            return line.split()
        return [field.strip() for field in line.split(self.separator)]

    def row(self, fields: list[str], width: int) -> str:
        """Return a row's fields as a line of numbers with commas between them and decimal points;
        one that ends in a separator more than the header loses that.
        """
        if len(fields) == width + 1 and not fields[-1]:
            fields = fields[:-1]
        if self.decimal == ",":
            fields = [field.replace(",", ".") for field in fields]
        return ",".join(
            "" if field.lower() in MISSING_WORDS else field.replace(",", " ") for field in fields
        )

    def names(self, fields: list[str]) -> list[str]:
        """Return the columns' names of the header's fields."""
        return [field.replace(",", " ").strip().strip('"').strip() for field in fields]


def without_mark(line: str) -> str:
    """Return a header without the mark of a comment in front of it."""
    bare = line.lstrip()
    for mark in ("#", "%", "//"):
        if bare.startswith(mark):
            return bare.removeprefix(mark).lstrip("#% /")
    return line
