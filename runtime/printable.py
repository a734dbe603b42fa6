"""Text from files and names, made fit for a terminal: characters for its cursor, colours or title
are shown as an escape, never sent.
"""

import unicodedata

# control characters; formats, such as changes of the direction of writing; halves of characters
# (bytes of a name outside UTF-8); private and unassigned characters; line separators
_UNFIT = frozenset(("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"))


def printable(text: str) -> str:
    r"""Return a text with an escape such as ``\x1b`` for every character with an effect on a
    terminal but line ends and tabs.
    """
    if text.isascii() and text.isprintable():  # nearly all
        return text
    return "".join(
        c if c in "\n\t" or unicodedata.category(c) not in _UNFIT else _escape(c) for c in text
    )


def _escape(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file's name outside UTF-8 (PEP 383)
        return f"\\x{code - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")
