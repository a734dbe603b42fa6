"""The error of a user's mistake: its message names the file, the field and the expected value."""

from collections.abc import Iterable
from difflib import get_close_matches

_LIKENESS = 0.5  # least likeness of a suggestion; 1: the same name


class InputError(ValueError):
    """A file, option, action or measurement of the user's, unusable for the kit."""


class UnreadLogError(InputError):
    """A log without a complete map, and the map as far as guessed."""

    def __init__(self, message: str, map_text: str) -> None:
        super().__init__(message)
        self.map_text = map_text


def unknown_name(what: str, name: str, known: Iterable[str], where: str = "") -> InputError:
    """Return the error for an unknown name, with the nearest known one as a suggestion."""
    names = sorted(map(str, known))
    near = get_close_matches(str(name), names, n=1, cutoff=_LIKENESS)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    prefix = f"{where}: " if where else ""
    return InputError(f"{prefix}unknown {what} {name!r}; expected one of {', '.join(names)}.{hint}")
