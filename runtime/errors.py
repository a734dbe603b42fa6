"""The error that a user's mistake raises: always a message that names the file, the field and what
was expected.
"""

from collections.abc import Iterable
from difflib import get_close_matches

_LIKENESS = 0.5  # of a suggestion, where 1 is the same


class InputError(ValueError):
    """A file, option, action or measurement of the user's that the kit cannot use."""


class UnreadLogError(InputError):
    """A log that cannot be read yet, and the map that was made for it so far."""

    def __init__(self, message: str, map_text: str) -> None:
        super().__init__(message)
        self.map_text = map_text


def unknown_name(what: str, name: str, known: Iterable[str], where: str = "") -> InputError:
    """Return the error for a name that is not among the known ones, with the nearest of them as a
    suggestion.
    """
    names = sorted(map(str, known))
    near = get_close_matches(str(name), names, n=1, cutoff=_LIKENESS)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    prefix = f"{where}: " if where else ""
    return InputError(f"{prefix}unknown {what} {name!r}; expected one of {', '.join(names)}.{hint}")
