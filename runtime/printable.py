"""Text from files and names, made fit for a terminal: what would move its cursor, change its
colours or its title is shown as an escape, never sent.
"""

import unicodedata

# control characters, formats such as those that turn the direction of writing, halves of characters
# (bytes of a name that are no text), private and unassigned ones; separators of lines
_UNFIT = frozenset(("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"))


def printable(text: str, keep: str = "\n\t") -> str:
    r"""Return a text with every character that a terminal might act on as an escape such as
    ``\x1b``; those of ``keep`` stay.
    """
    if text.isascii() and text.isprintable():  # nearly all
        return text
    return "".join(
        c if c in keep or unicodedata.category(c) not in _UNFIT else _escape(c) for c in text
    )


def _escape(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file's name that is no UTF-8 (PEP 383)
        return f"\\x{code - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")
